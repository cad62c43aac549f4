# SPDX-License-Identifier: BSD-3-Clause
"""The sections of one run's page, in their order."""

from __future__ import annotations

import base64

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.remedies import what_helps
from orbslam2py.runs.report_page import run_plots, stages
from orbslam2py.runs.report_page.explained import FIGURES, TERMS, compared_over
from orbslam2py.runs.report_page.markup import Markup, element, join, section, table
from orbslam2py.runs.report_page.path_section import frame_link
from orbslam2py.runs.report_page.plot import figures
from orbslam2py.runs.report_page.round_numbers import short
from orbslam2py.runs.report_page.story import Story

_MOST_EVENTS = 60


def tiles(story: Story) -> Markup:
    """Return the most important figures."""
    report = story.run.report
    tracked = f"{report.get('tracked', 0)} of {report.get('frames', 0)}"
    part = f"frames tracked ({100 * report.get('tracked_fraction', 0.0):.1f} %)"
    said = [(tracked, part)]
    if report.get("ate_rmse_m") is not None:
        error = f"absolute error (ATE, RMSE) {compared_over(report)}"
        said.append((f"{short(report['ate_rmse_m'])} {story.run.unit}", error))
    if report.get("t_rel_percent") is not None:
        said.append((f"{short(report['t_rel_percent'])} %", "KITTI's error of translation"))
    if len(story.run.path) > 1:
        length = _length(story.run.metres * story.run.path.positions)
        said.append((f"{short(length)} {story.run.unit}", "length of the path"))
    said += [
        (str(report.get("keyframes", 0)), "keyframes"),
        (str(report.get("map_points", 0)), "map points"),
        (str(report.get("loops_closed", 0)), "loops closed"),
        (str(report.get("lost", 0)), "times lost"),
        (short(float(report.get("frames_per_second", 0.0))), "frames a second"),
    ]
    return element(
        "ul",
        *(
            element("li", element("b", value), element("span", text), title=_meaning(text))
            for value, text in said
        ),
        class_="tiles",
    )


def _meaning(text: str) -> str | None:
    """Return the explanation of a tile's words, where needed."""
    return next((told for word, told in TERMS.items() if word in text), None)


def error_section(story: Story) -> Markup | None:
    """Return the error over time, and its largest values; None without ground truth."""
    plot = run_plots.error_plot(story)
    if plot is None:
        return None
    unit = story.run.unit
    rows: list[list[str | Markup]] = [
        [str(number), frame_link(story, moment.position),
         f"{short(moment.value)} {unit}", moment.happened]
        for number, moment in enumerate(story.worst, 1)
    ]  # fmt: skip
    head = ["", "where it is worst", "error", "what happened within a second"]
    note = "Errors of the path after the last optimisation, moved onto the truth as a whole."
    return section(
        "error", "Error", figures(plot), table(head, rows, class_="moments"),
        element("p", note, class_="note"),
    )  # fmt: skip


def tracking_section(story: Story) -> Markup:
    """Return states with reasons, inliers, keyframes, events."""
    frames = story.run.frames
    help_of = {reason: what_helps(reason) for reason in set(frames.reason)}
    rows = run_plots.reasons_rows(frames, help_of)
    reasons = table(["state", "reason", "frames", "what helps"], rows) if rows else None
    events: list[list[str | Markup]] = [
        [frame_link(story, event.position), event.text] for event in story.events[:_MOST_EVENTS]
    ]
    if len(story.events) > _MOST_EVENTS:
        events.append(["", f"and {len(story.events) - _MOST_EVENTS} more: report.json"])
    happened = table(["when", "what happened"], events) if events else None
    plots = None
    if story.run.report.get("tracked"):
        plots = figures(
            run_plots.inliers_plot(story),
            run_plots.found_plot(story),
            run_plots.keyframes_plot(story),
        )
    quiet = element("p", "Never lost; no loop was closed.") if not (rows or events) else None
    return section(
        "tracking", "Tracking", run_plots.state_strip(story), quiet, reasons, happened, plots
    )


def time_section(story: Story) -> Markup:
    """Times per stage."""
    frames = story.run.frames
    return section(
        "times", "Times",
        stages.stage_table(frames), stages.histogram(frames),
        figures(run_plots.times_plot(story)),
        stages.latency_table(story.run.report),
        stages.background_table(story.run.report),
    )  # fmt: skip


def images_section(story: Story) -> Markup | None:
    """Return images of some frames, with their points; None without any."""
    run = story.run
    shown = []
    worst = {int(run.frames.index[moment.position]): k for k, moment in enumerate(story.worst, 1)}
    for position in range(len(run.frames)):
        number = int(run.frames.index[position])
        if number not in run.images:
            continue
        told = _image_text(story, position, worst.get(number))
        data = base64.b64encode(run.images[number]).decode()
        image = element("img", src=f"data:image/jpeg;base64,{data}", alt=told)
        caption = element("figcaption", frame_link(story, position), element("small", told))
        shown.append(element("figure", image, caption, id=f"image-{number}"))
    if not shown:
        return None
    note = "Yellow: points of the map that the keyframe observes, where its pose puts them."
    return section(
        "images", "Images", element("div", *shown, class_="images"),
        element("p", note, class_="note"),
    )  # fmt: skip


def _image_text(story: Story, position: int, worst: int | None) -> str:
    frames = story.run.frames
    said = ["keyframe" if frames.is_keyframe[position] else "no keyframe"]
    if worst is not None:
        said.append(f"worst place {worst}")
    if frames.state[position] == "OK":
        said.append(f"{frames.inliers[position]:.0f} inliers")
    elif frames.reason[position]:
        said = [frames.reason[position]]
    if np.isfinite(story.errors[position]):
        said.append(f"error {short(float(story.errors[position]))} {story.run.unit}")
    return ", ".join(said)


def figures_section(story: Story) -> Markup:
    """Return all figures of report.json with explanations."""
    groups = []
    for title, group in FIGURES.items():
        rows: list[list[str | Markup]] = [
            [element("b", figure.name), join(figure.value(story.run.report), " ",
             element("small", figure.unit)), join(figure.text, " ", element("code", figure.key))]
            for figure in group
            if story.run.report.get(figure.key) is not None
        ]  # fmt: skip
        if rows:
            groups.append(element("div", element("h3", title), table([], rows, class_="figures")))
    note = element("p", "From report.json, where the names are those on the right.", class_="note")
    return section("figures", "All figures", note, element("div", *groups, class_="pair"))


def _length(positions: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
