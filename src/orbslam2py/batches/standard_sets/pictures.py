# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a benchmark: the error of every run, and the trajectories of all seeds."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.batches.standard_sets.entries import Entry, is_lost
from orbslam2py.batches.standard_sets.find import StandardSet
from orbslam2py.batches.standard_sets.markdown import SYSTEMS
from orbslam2py.errors import DatasetError
from orbslam2py.runs.report_page import Comparison, RunFolder, above, read_run
from orbslam2py.runs.report_page.comparison_page import look
from orbslam2py.runs.report_page.markup import Markup, element
from orbslam2py.runs.report_page.plane_view import FROM_ABOVE, choose_view
from orbslam2py.runs.report_page.plot import WIDTH
from orbslam2py.runs.report_page.round_numbers import dots_data
from orbslam2py.runs.timeline import gaps_in_time

#: Height of the line of a sequence in the picture of errors [rem].
_LINE = 2.4
_LABEL = "position:absolute;left:.2rem;white-space:nowrap"
#: Least length of the logarithmic axis: differences that say nothing look small on it.
_DECADES = 1.0
#: Most corners of a path: there are many in one page.
_CORNERS = 500
#: Colours of ours, of lost ones, and of the systems.
_OURS, _LOST, _PUBLISHED = "run0", "lost", ("run1", "run2")


def short_name(sequence: str) -> str:
    """Remove the common beginning of the names of TUM RGB-D."""
    return sequence.removeprefix("rgbd_dataset_")


def error_picture(kind: StandardSet, entries: list[Entry]) -> Markup | None:
    """Draw the absolute error of every run on a logarithmic axis, one line for each sequence."""
    ours = [(k, float(row["ate_rmse_m"]), is_lost(row)) for k, entry in enumerate(entries)
            for row in entry.rows if row.get("ate_rmse_m")]  # fmt: skip
    printed = [
        (k, one.ate_rmse_m, look_of)
        for k, entry in enumerate(entries)
        for system, look_of in zip(SYSTEMS, _PUBLISHED, strict=True)
        if (one := entry.of(system)) is not None and one.ate_rmse_m
    ]
    values = [value for _, value, _ in ours] + [value for _, value, _ in printed]
    if not ours:
        return None
    low, high = math.log10(min(values)), math.log10(max(values))
    room = max(0.06 * (high - low), 0.5 * (_DECADES - high + low))
    low, high = low - room, high + room
    height = 100.0 * len(entries)

    def place(k: float, value: float) -> tuple[float, float]:
        return WIDTH * (math.log10(value) - low) / (high - low), 100 * k + 70

    marks = [
        element("path", class_="grid", d=f"M0 {100 * k + 70}H{WIDTH:.0f}")
        for k in range(len(entries))
    ]
    ticks = [tick for tick in _ticks(low, high) if low < math.log10(tick) < high]
    marks += [
        element("path", class_="grid", d=f"M{place(0, t)[0]:.1f} 0V{height:.0f}") for t in ticks
    ]
    marks += [
        element("path", class_=f"line {name}", d=f"M{x:.1f} {y - 28:.0f}V{y + 28:.0f}")
        for k, value, name in printed
        for x, y in [place(k, value)]
    ]
    for lost, name in ((False, _OURS), (True, _LOST)):
        at = np.array([place(k, value) for k, value, is_out in ours if is_out == lost])
        if len(at):
            marks.append(element("path", class_=f"dots {name}", d=dots_data(at[:, 0], at[:, 1])))
    return _figure(kind, entries, marks, [(t, place(0, t)[0]) for t in ticks], height)


def _figure(
    kind: StandardSet,
    entries: list[Entry],
    marks: list[Markup],
    ticks: list[tuple[float, float]],
    height: float,
) -> Markup:
    legend = [("run", _OURS)]
    legend += [("lost run", _LOST)] if any(entry.n_lost for entry in entries) else []
    legend += [
        (system, name)
        for system, name in zip(SYSTEMS, _PUBLISHED, strict=True)
        if any(entry.of(system) for entry in entries)
    ]
    keys = [element("span", element("i", class_=name), text) for text, name in legend]
    svg = element(
        "svg", *marks, viewBox=f"0 0 {WIDTH:.0f} {height:.0f}", preserveAspectRatio="none",
        role="img", aria_label=f"Absolute error of every run of {kind.full_name}",
    )  # fmt: skip
    names = [
        element("small", short_name(entry.sequence), style=f"{_LABEL};top:{_LINE * k:.1f}rem")
        for k, entry in enumerate(entries)
    ]
    below = [
        element("span", f"{t:g}", class_="xt", style=f"left:{100 * x / WIDTH:.2f}%")
        for t, x in ticks
    ]
    title = element("b", "Absolute error of every run")
    caption = element("figcaption", title, element("span", *keys, class_="legend"))
    canvas = element(
        "div", svg, *names, class_="canvas", style=f"height:{_LINE * len(entries):.1f}rem"
    )
    axis = element("div", *below, element("span", "ATE [m]", class_="xl"), class_="times")
    plot = element("div", canvas, axis, class_="axes", style="padding-left:0")
    return element("figure", caption, plot, class_="plot")


def _ticks(low: float, high: float) -> Iterator[float]:
    steps = (1, 2, 5) if high - low < 1.5 else (1,)
    for power in range(math.floor(low), math.ceil(high) + 1):
        yield from (step * 10.0**power for step in steps)


def paths_pictures(entries: list[Entry], folder: Path) -> list[Markup]:
    """Draw the trajectories of all runs of each sequence and sensor from above."""
    return [
        picture
        for number, entry in enumerate(entries)
        if (picture := _paths(entry, folder, f"paths-{number}")) is not None
    ]


def _paths(entry: Entry, folder: Path, name: str) -> Markup | None:
    runs, seeds = [], []
    for row in entry.rows:
        try:
            run = read_run(folder / "runs" / str(row["run"]))
        except DatasetError:
            continue  # the table of all runs says how it ended
        if len(run.path):
            runs.append(run)
            seeds.append(row["seed"])
    if not runs:
        return None
    first = runs[0]
    own = first.metres * first.path.positions
    paths: list[FloatArray | None] = [own]
    if len(runs) > 1:
        paths = Comparison.of(runs).paths
    view = choose_view(own)
    drawn = _drawn(runs, paths)
    flats = [(look_of, view.flatten(positions), gaps) for look_of, positions, gaps in drawn]
    window = above.Window.around(np.vstack([flat for _, flat, _ in flats]), np.zeros((0, 2)))
    marks = [above.path_mark(window, flat, gaps, look_of) for look_of, flat, gaps in flats]
    keys = [element("span", element("i", class_="truth"), "ground truth")] if first.truth else []
    keys += [
        element("span", element("i", class_=look(k)), f"seed {seed}")
        for k, (seed, path) in enumerate(zip(seeds, paths, strict=True))
        if path is not None
    ]
    caption = element(
        "figcaption", element("b", f"{short_name(entry.sequence)}, {entry.sensor}"),
        element("small", " from above" if view is FROM_ABOVE else " from behind"),
        element("span", *keys, class_="legend"),
    )  # fmt: skip
    plane = above.plane(window, marks, view, first.unit, name=name)
    return element("figure", caption, plane, class_="plot")


def _drawn(
    runs: list[RunFolder], paths: list[FloatArray | None]
) -> Iterator[tuple[str, FloatArray, IntArray]]:
    first = runs[0]
    if first.truth is not None and len(first.truth):
        positions = first.metres * first.truth.positions
        yield "truth", *_thinned(positions, first.truth.timestamps)
    for k, (run, path) in enumerate(zip(runs, paths, strict=True)):
        if path is not None:
            yield look(k), *_thinned(path, run.path.timestamps)


def _thinned(positions: FloatArray, times: FloatArray) -> tuple[FloatArray, IntArray]:
    keep = np.arange(0, len(positions), max(1, len(positions) // _CORNERS))
    return positions[keep], np.flatnonzero(gaps_in_time(times[keep]))
