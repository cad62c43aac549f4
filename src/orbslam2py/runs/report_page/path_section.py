# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory of a run, in three dimensions and from above."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import IntArray
from orbslam2py.runs.report_page import above
from orbslam2py.runs.report_page.markup import Markup, element, join, section
from orbslam2py.runs.report_page.plane_view import FROM_ABOVE, View, choose_view
from orbslam2py.runs.report_page.round_numbers import short
from orbslam2py.runs.report_page.scene import loop_ends
from orbslam2py.runs.report_page.story import Story
from orbslam2py.runs.timeline import gaps_in_time


def path_section(story: Story) -> Markup:
    """Return the trajectory in three dimensions and from above."""
    if not len(story.run.path):
        return section("path", "Path", element("p", "No frame of the main map has a pose."))
    layers = ("points", "keyframes", "truth", "loops")
    there = {
        "points": len(story.run.points) > 0,
        "keyframes": True,
        "truth": story.run.truth is not None,
        "loops": len(loop_ends(story.run)) > 0,
    }
    names = {"truth": "ground truth", "points": "map points"}
    boxes = [
        element("label", element("input", type="checkbox", checked=True, data_layer=layer),
                names.get(layer, layer))
        for layer in layers
        if there[layer]
    ]  # fmt: skip
    views = [
        element("button", text, type="button", data_view=view)
        for view, text in (("above", "from above"), ("side", "from the side"),
                           ("behind", "from behind"), ("near", "+"), ("far", "\N{MINUS SIGN}"))
    ]  # fmt: skip
    solid = element(
        "figure",
        element("figcaption", element("b", "In three dimensions"),
                element("small", " drag to turn; with Shift or two fingers, to move")),
        element("canvas", id="solid", tabindex=0, role="img",
                aria_label="Path in three dimensions; arrow keys turn it, + and - zoom"),
        element("div", *views, class_="buttons"),
        element("div", *boxes, class_="buttons"),
        element("noscript", "Turning needs JavaScript; the path from above does not."),
        class_="plot",
    )  # fmt: skip
    return section("path", "Path", element("div", solid, from_above(story), class_="pair"))


def from_above(story: Story) -> Markup:
    """Return the trajectory from above, with ground truth, coloured errors, and loops."""
    run = story.run
    positions = run.metres * run.path.positions
    view = choose_view(positions)
    flat = view.flatten(positions)
    truth = None if run.truth is None else view.flatten(run.metres * run.truth.positions)
    points = view.flatten(run.metres * run.points[np.isfinite(run.points).all(axis=1)])
    window = above.Window.around(flat if truth is None else np.vstack([flat, truth]), points)
    gaps = _gaps(story)
    marks = [above.points_mark(window, points)]
    legend = [("points", "map points")] if len(window.inside(points)) else []
    if run.truth is not None and truth is not None:
        truth_gaps = np.flatnonzero(gaps_in_time(run.truth.timestamps))
        marks.append(above.path_mark(window, truth, truth_gaps, "truth"))
        legend.append(("truth", "ground truth"))
    scale = None
    if story.has_truth:
        classes, largest = above.colours_of(story.errors[story.of_path])
        marks.append(above.coloured_path(window, flat, gaps, classes))
        scale = colour_bar(largest, run.unit)
    else:
        marks.append(above.path_mark(window, flat, gaps, "path s-path"))
        legend.append(("s-path", "path"))
    keyframes = view.flatten(run.metres * run.keyframes.positions)
    marks.append(above.dots_mark(window, keyframes, "keyframes"))
    legend.append(("keyframes", "keyframes"))
    ends = loop_ends(run)
    if len(ends):
        both = view.flatten(ends.reshape(-1, 3))
        marks.append(above.dots_mark(window, both, "loops"))
        legend.append(("loops", "ends of loops"))
    marks.append(above.dots_mark(window, flat[:1], "start"))
    legend.append(("start", "start"))
    keys = [element("span", element("i", class_=look), name) for look, name in legend]
    which = "From above" if view is FROM_ABOVE else "From behind the first camera"
    caption = element(
        "figcaption",
        element("b", which),
        element("small", f" up in the picture is {view.up_name}, as the first keyframe looked"),
        element("span", *keys, class_="legend"),
    )
    numbers = _numbers_of_worst(story, window, view)
    return element(
        "figure", caption,
        above.plane(window, marks, view, run.unit, above=numbers), scale,
        class_="plot",
    )  # fmt: skip


def colour_bar(largest: float, unit: str) -> Markup:
    """Return the legend of the colours of errors."""
    boxes = [element("i", class_=f"e{k}") for k in range(above.N_COLOURS)]
    return element(
        "p", element("span", "distance to the truth: 0"), element("span", *boxes, class_="colours"),
        element("span", f"{short(largest)} {unit}"), class_="scale",
    )  # fmt: skip


def _numbers_of_worst(story: Story, window: above.Window, view: View) -> Markup:
    links = []
    place_of = {int(position): k for k, position in enumerate(story.of_path)}
    for number, moment in enumerate(story.worst, 1):
        position = story.run.metres * story.run.path.positions[[place_of[moment.position]]]
        x, y = window.place(view.flatten(position))
        style = f"left:{x[0] / 10:.2f}%;top:{100 * y[0] / window.height:.2f}%"
        links.append(frame_link(story, moment.position, str(number), class_="worst", style=style))
    return join(*links)


def frame_link(story: Story, position: int, text: str | None = None, **attributes: str) -> Markup:
    """Return a link that moves the page's cursor to a frame."""
    frames = story.run.frames
    told = f"frame {frames.index[position]}"
    label = text or f"{told}, {frames.seconds[position]:.2f} s"
    title = None if text is None else told
    return element("a", label, href=f"#frame-{frames.index[position]}", title=title, **attributes)


def _gaps(story: Story) -> IntArray:
    """Return before which poses the trajectory has a gap: a loss or a long pause."""
    run = story.run
    gaps = gaps_in_time(run.path.timestamps)
    failed = np.cumsum(~np.isin(run.frames.state, ["OK", "DROPPED"]))
    if len(gaps) > 1:
        gaps[1:] |= np.diff(failed[story.of_path]) > 0
    return np.flatnonzero(gaps)
