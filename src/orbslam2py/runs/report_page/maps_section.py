# SPDX-License-Identifier: BSD-3-Clause
"""Several maps of one run: their periods of tracking, their ends, their trajectories."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbslam2py._palette import PAPER_MAPS
from orbslam2py.runs.report_page import above
from orbslam2py.runs.report_page.markup import Markup, element, section, table
from orbslam2py.runs.report_page.path_section import frame_link
from orbslam2py.runs.report_page.plane_view import choose_view
from orbslam2py.runs.report_page.plot import Span, strip
from orbslam2py.runs.report_page.run_folder import RunFolder
from orbslam2py.runs.report_page.story import Story, positions_of
from orbslam2py.runs.timeline import gaps_in_time
from orbslam2py.trajectory import Trajectory

_NOTE = (
    "Each map has a frame and, with one camera, a unit of its own. The relative position of two "
    "maps has no meaning. The main map is that with most tracked frames; it is the one of the "
    "pictures and figures above. Paths of the others are in trajectory_mapK.txt, all are drawn in "
    "maps.png."
)


def maps_section(story: Story) -> Markup | None:
    """Return the table of all maps; None if there was only one."""
    run = story.run
    main = main_number(run)
    paths = {number: path for number, path in run.others.items() if len(path)}
    entries = run.report.get("maps") or []
    if not paths and len(entries) < 2:
        return None
    if len(run.path):
        paths[main] = run.path
    drawn = [_one_map(story, number, paths[number], main) for number in sorted(paths)]
    rows: list[list[str | Markup]] = [
        [
            _chip(entry["map"], f"map {entry['map']}"),
            _state(entry, main),
            *(str(entry[key]) for key in ("keyframes", "map_points", "tracked")),
        ]
        for entry in entries
    ]
    head = ["map", "at the end", "keyframes", "points", "frames with a pose"]
    return section(
        "maps",
        "Maps",
        _strip(story, {entry["map"]: entry for entry in entries}),
        table(head, rows) if rows else None,
        element("div", *drawn, class_="images") if len(drawn) > 1 else None,
        element("p", _NOTE, class_="note") if len(drawn) > 1 else None,
    )


def main_number(run: RunFolder) -> int:
    """Return the number of the main map; folders of earlier versions contain only the last one."""
    numbers = run.frames.map_index[np.isfinite(run.frames.map_index)]
    return int(run.report.get("main_map", numbers[-1] if len(numbers) else 0))


def look_of(number: int) -> str:
    """Return the colour class of a map."""
    return f"map{number % len(PAPER_MAPS)}"


def _chip(number: int, text: str) -> Markup:
    return element("span", element("i", class_=look_of(number)), " ", text, class_="key")


def _state(entry: dict[str, Any], main: int) -> str:
    if entry["state"] == "merged":
        return f"part of map {entry['merged_into']}"
    main_too = ", main" if entry["map"] == main else ""
    return f"{entry['state'].replace('resting', 'rests')}{main_too}"


def _strip(story: Story, entries: dict[int, dict[str, Any]]) -> Markup | None:
    """Return the periods with poses in each map, by its number at that time."""
    frames = story.run.frames
    seconds = frames.seconds
    numbers = np.where(frames.has_pose, np.nan_to_num(frames.map_index, nan=-1.0), -1.0).astype(int)
    there = np.unique(numbers[numbers >= 0]).tolist()
    if len(there) < 2:
        return None
    begins = np.flatnonzero(np.diff(numbers, prepend=-2))
    ends = np.append(begins[1:], len(numbers) - 1)
    spans = [
        Span(float(seconds[b]), float(seconds[e]), look_of(numbers[b]), f"map {numbers[b]}")
        for b, e in zip(begins.tolist(), ends.tolist(), strict=True)
        if numbers[b] >= 0
    ]
    legend = []
    for number in there:
        entry = entries.get(number, {})
        now = entry.get("merged_into")
        text = f"map {number}" if now is None else f"map {number}, part of map {now} at the end"
        legend.append((look_of(number), text))
    ticks = seconds[frames.is_keyframe]
    return strip("plot-maps", "Map in which poses were found", spans, ticks, [], story.duration,
                 legend)  # fmt: skip


def _one_map(story: Story, number: int, path: Trajectory, main: int) -> Markup:
    run = story.run
    unit = "units" if run.is_monocular else "m"
    view = choose_view(path.positions)
    flat = view.flatten(path.positions)
    window = above.Window.around(flat, np.zeros((0, 2)))
    gaps = np.flatnonzero(gaps_in_time(path.timestamps))
    marks = [above.path_mark(window, flat, gaps, f"path {look_of(number)}")]
    marks.append(above.dots_mark(window, flat[:1], "start"))
    first, last = positions_of(run, path)[[0, -1]].tolist()
    name = f"Map {number}{', the main one' if number == main else ''}"
    caption = element(
        "figcaption", _chip(number, name), " ", frame_link(story, first), " to ",
        frame_link(story, last), element("small", f"{len(path)} poses"),
    )  # fmt: skip
    plane = above.plane(window, marks, view, unit, name=f"map-{number}")
    return element("figure", plane, caption, class_="plot")
