# SPDX-License-Identifier: BSD-3-Clause
"""The page of several runs."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.report_page import above
from orbslam2py.runs.report_page.comparison import Comparison, Row
from orbslam2py.runs.report_page.explained import STAGES
from orbslam2py.runs.report_page.markup import Markup, element, join, section, table
from orbslam2py.runs.report_page.page import PageKind, whole_page
from orbslam2py.runs.report_page.plane_view import FROM_ABOVE, choose_view
from orbslam2py.runs.report_page.plot import Line, TimePlot, figures, strip
from orbslam2py.runs.report_page.round_numbers import NONE
from orbslam2py.runs.report_page.run_plots import state_spans
from orbslam2py.runs.report_page.scene import as_script, rounded
from orbslam2py.runs.report_page.story import Story
from orbslam2py.runs.timeline import gaps_in_time

#: Colours there are; the seventh run has that of the first, dashed.
_N_COLOURS = 6
#: Most corners of a path in three dimensions.
_CORNERS = 2500
#: Most frames of a run for which the cursor shows values.
_FRAMES = 5000


def comparison_page(comparison: Comparison) -> str:
    """Make the page of several runs."""
    names = comparison.names
    warning = None
    if comparison.warnings:
        texts = (element("p", text) for text in comparison.warnings)
        warning = element("div", *texts, class_="warning", role="note")
    parts = {
        "figures": ("Figures", _figures(comparison)),
        "path": ("Paths", _paths(comparison)),
        "error": ("Error", _errors(comparison)),
        "tracking": ("Tracking", _tracking(comparison)),
        "times": ("Times", _times(comparison)),
    }
    links = [(name, title) for name, (title, part) in parts.items() if part]
    body = join(warning, *(part for _, part in parts.values()))
    title = f"{len(names)} runs: {', '.join(names)}"
    sequences = ", ".join(dict.fromkeys(run.name for run in comparison.runs))
    data = as_script(_data(comparison))
    return whole_page(title, sequences, links, body, data, kind=PageKind.COMPARISON)


def look(number: int) -> str:
    """Return the colour class of a run."""
    return f"run{number % _N_COLOURS}{' dashed' if number >= _N_COLOURS else ''}"


def _figures(comparison: Comparison) -> Markup:
    names = [
        join(element("i", class_=look(k)), " ", name) for k, name in enumerate(comparison.names)
    ]
    lines: list[list[str | Markup]] = []
    for group, rows in comparison.rows().items():
        if rows:
            heading = element("span", group, class_="group")
            lines.append([heading, *[""] * len(names)])
            lines += [_cells(row) for row in rows]
    note = "The star marks the best of those that tracked anything. What a figure is: point at it, "
    note += "or see the page of one run."
    shown = table(["", *names], lines, class_="compared numbers")
    return section("figures", "Figures", shown, element("p", note, class_="note"))


def _cells(row: Row) -> list[str | Markup]:
    cells: list[str | Markup] = [
        element(
            "span",
            row.figure.name,
            element("small", f" [{row.figure.unit}]") if row.figure.unit else None,
            title=f"{row.figure.text} ({row.figure.key})",
        ),
    ]
    for value, best in zip(row.values, row.best, strict=True):
        cells.append(element("span", value, class_="best") if best else value)
    return cells


def _paths(comparison: Comparison) -> Markup | None:
    shown = [(k, path) for k, path in enumerate(comparison.paths) if path is not None]
    if not shown:
        return None
    first = comparison.runs[0]
    view = choose_view(shown[0][1])
    truth = None if first.truth is None else view.flatten(first.metres * first.truth.positions)
    flats = [(k, view.flatten(path)) for k, path in shown]
    everything = [flat for _, flat in flats] + ([] if truth is None else [truth])
    window = above.Window.around(np.vstack(everything), np.zeros((0, 2)))
    marks, keys = [], []
    if truth is not None and first.truth is not None:
        gaps = np.flatnonzero(gaps_in_time(first.truth.timestamps))
        marks.append(above.path_mark(window, truth, gaps, "truth"))
        keys.append(element("span", element("i", class_="truth"), "ground truth"))
    for k, flat in flats:
        gaps = np.flatnonzero(gaps_in_time(comparison.runs[k].path.timestamps))
        marks.append(above.path_mark(window, flat, gaps, look(k)))
        keys.append(element("span", element("i", class_=look(k)), comparison.names[k]))
    caption = element(
        "figcaption", element("b", "From above" if view is FROM_ABOVE else "From behind"),
        element("small", f" up in the picture is {view.up_name}"),
        element("span", *keys, class_="legend"),
    )  # fmt: skip
    solid = element(
        "figure",
        element("figcaption", element("b", "In three dimensions"),
                element("small", " drag to turn; with Shift or two fingers, to move")),
        element("canvas", id="solid", tabindex=0, role="img",
                aria_label="Paths in three dimensions; arrow keys turn them, + and - zoom"),
        class_="plot",
    )  # fmt: skip
    plane = above.plane(window, marks, view, first.unit)
    note = f"Each path is moved onto that of {comparison.names[0]} as a whole, by the "
    note += "ground truth where both have it, else by poses at the same times."
    return section(
        "path", "Paths",
        element("div", solid, element("figure", caption, plane, class_="plot"), class_="pair"),
        element("p", note, class_="note"),
    )  # fmt: skip


def _duration(comparison: Comparison) -> float:
    return max(story.duration for story in comparison.stories)


def _lines(comparison: Comparison, values: list[FloatArray]) -> list[Line]:
    return [
        Line(name, story.run.frames.seconds, y, look(k))
        for k, (name, story, y) in enumerate(
            zip(comparison.names, comparison.stories, values, strict=True)
        )
        if np.isfinite(y).any()
    ]


def _errors(comparison: Comparison) -> Markup | None:
    lines = _lines(comparison, [story.errors for story in comparison.stories])
    if not lines:
        return None
    unit = comparison.runs[0].unit
    plot = TimePlot(
        "plot-error", "Distance to the ground truth", unit, lines, _duration(comparison)
    )
    return section("error", "Error", figures(plot))


def _tracking(comparison: Comparison) -> Markup:
    strips = [
        strip(
            f"plot-states-{k}", name, state_spans(story.run.frames),
            story.run.frames.seconds[story.run.frames.is_keyframe], [], _duration(comparison),
            _states(story),
        )
        for k, (name, story) in enumerate(zip(comparison.names, comparison.stories, strict=True))
    ]  # fmt: skip
    tracked = [
        np.where(run.frames.state == "OK", run.frames.inliers, np.nan) for run in comparison.runs
    ]
    unit = "keypoints that agree with the pose"
    plot = TimePlot(
        "plot-inliers", "Inliers", unit, _lines(comparison, tracked), _duration(comparison)
    )
    return section("tracking", "Tracking", *strips, figures(plot))


def _states(story: Story) -> list[tuple[str, str]]:
    frames = story.run.frames
    n = int(np.sum(frames.state == "OK"))
    return [("ok", f"tracked: {n} of {len(frames)}")]


def _times(comparison: Comparison) -> Markup:
    nothing = np.zeros(0)
    calls = [
        run.frames.milliseconds.get("track", np.full(len(run.frames), np.nan))
        for run in comparison.runs
    ]
    known = np.concatenate([nothing, *(ms[np.isfinite(ms)] for ms in calls)])
    top = 1.2 * float(np.quantile(known, 0.99)) if known.any() else None
    plot = TimePlot(
        "plot-times", "Time of the track calls", "ms", _lines(comparison, calls),
        _duration(comparison), top=top,
    )  # fmt: skip
    rows: list[list[str | Markup]] = []
    for stage in (*STAGES, "track", "mapping", "loop.detect"):
        found = [run.report.get("milliseconds", {}).get(stage) for run in comparison.runs]
        if any(found):
            texts = (f"{f['median']:.2f} / {f['p99']:.2f}" if f else NONE for f in found)
            rows.append([stage, *texts])
    head = ["median / p99 [ms]", *comparison.names]
    return section("times", "Times", figures(plot), table(head, rows, class_="compared numbers"))


def _data(comparison: Comparison) -> dict[str, object]:
    paths = []
    for number, path in enumerate(comparison.paths):
        if path is None:
            continue
        keep = np.arange(0, len(path), max(1, len(path) // _CORNERS))
        corners = rounded(path[keep].ravel(), 4)
        run = comparison.runs[number]
        since = run.path.timestamps[keep] - run.frames.timestamps[:1].sum()
        colour = f"--c{number % _N_COLOURS}"
        paths.append({"positions": corners, "look": colour, "seconds": rounded(since, 3)})
    data: dict[str, object] = {"paths": paths, "points": "", "box": [0, 0, 0, 1]}
    data["runs"] = [
        _run_data(story, name, look(k))
        for k, (name, story) in enumerate(zip(comparison.names, comparison.stories, strict=True))
    ]
    truth = comparison.runs[0].truth
    if truth is not None and paths:
        keep = np.arange(0, len(truth), max(1, len(truth) // _CORNERS))
        positions = comparison.runs[0].metres * truth.positions[keep]
        data["truth"] = rounded(positions.ravel(), 4)
    return data


def _run_data(story: Story, name: str, look_of_run: str) -> dict[str, object]:
    """Return the values of a run at the cursor, frame by frame."""
    frames = story.run.frames
    keep = np.arange(0, len(frames), max(1, -(-len(frames) // _FRAMES)))
    tracked = np.where(frames.state == "OK", frames.inliers, np.nan)
    calls = frames.milliseconds.get("track", np.full(len(frames), np.nan))
    return {
        "name": name,
        "look": look_of_run,
        "unit": story.run.unit,
        "seconds": rounded(frames.seconds[keep], 3),
        "index": frames.index[keep].tolist(),
        "state": frames.state[keep].tolist(),
        "error": rounded(story.errors[keep], 4),
        "inliers": rounded(tracked[keep], 0),
        "track": rounded(calls[keep], 2),
    }
