# SPDX-License-Identifier: BSD-3-Clause
"""The results of a benchmark as one page that works without a network."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from orbslam2py._arguments import number_of
from orbslam2py._version import __version__
from orbslam2py.batches.batch import BatchResult
from orbslam2py.batches.standard_sets.entries import LEAST_PART, Entry, is_lost, part_in_path
from orbslam2py.batches.standard_sets.find import StandardSet
from orbslam2py.batches.standard_sets.markdown import (
    SYSTEMS,
    Compared,
    figures_of,
    has_published,
    published_text,
    spread_text,
)
from orbslam2py.batches.standard_sets.pictures import error_picture, paths_pictures, short_name
from orbslam2py.runs.report_page.markup import Markup, element, join, section, table
from orbslam2py.runs.report_page.page import whole_page
from orbslam2py.runs.report_page.round_numbers import NONE
from orbslam2py.runs.report_page.scene import as_script

Cells = list[list[str | Markup]]


def benchmark_page(
    kind: StandardSet, entries: list[Entry], done: BatchResult, command: str | None
) -> str:
    """Make the page.

    Parameters
    ----------
    kind
        The data set.
    entries
        Runs of each sequence with each sensor.
    done
        The batch, whose folder contains the runs.
    command
        The command line; None if it was started from Python.
    """
    sensors = list(dict.fromkeys(entry.sensor for entry in entries))
    parts, links = [_notes(entries, done)], []
    for sensor in sensors:
        mine = [entry for entry in entries if entry.sensor == sensor]
        title = sensor or "not opened"
        name = sensor or "unopened"
        parts.append(section(name, title, _medians(kind, mine), error_picture(kind, mine)))
        links.append((name, title))
    paths = paths_pictures(entries, Path(done.folder))
    if paths:
        parts.append(section("paths", "Paths", element("div", *paths, class_="pair")))
        links.append(("paths", "Paths"))
    parts += [
        section("runs", "All runs", _all_runs(kind, entries)),
        _repeat(kind, entries, command),
    ]
    links += [("runs", "All runs"), ("repeat", "Repeat")]
    n_sequences = len({entry.sequence for entry in entries})
    counts = f"{number_of(n_sequences, 'sequence')}, {number_of(len(done.rows), 'run')}"
    subtitle = f"{counts}, orbslam2py {__version__}"
    nothing = as_script({"paths": [], "points": "", "box": [0, 0, 0, 1]})
    return whole_page(f"{kind.full_name}: benchmark", subtitle, links, join(*parts), nothing)


def _notes(entries: list[Entry], done: BatchResult) -> Markup | None:
    said = []
    if done.n_left:
        said.append(f"The benchmark was stopped: {done.n_left} runs are left (--resume).")
    cut = [name for name in ("option.max_frames", "option.start") if _any(entries, name)]
    if cut and any(entry.published for entry in entries):
        said.append("Only parts of the sequences were run; published figures are of whole ones.")
    n_lost = sum(entry.n_lost for entry in entries)
    if n_lost:
        of = f"{n_lost} of {len(done.rows)} runs were" if n_lost > 1 else "1 run was"
        said.append(f"{of} lost: see All runs for each.")
    if not said:
        return None
    return element("div", *(element("p", text) for text in said), class_="warning", role="note")


def _any(entries: list[Entry], column: str) -> bool:
    return any(row.get(column) for entry in entries for row in entry.rows)


def _medians(kind: StandardSet, entries: list[Entry]) -> Markup:
    figures = figures_of(kind)
    columns = [
        (figure, system)
        for figure in figures
        for system in (None, *(s for s in SYSTEMS if has_published(entries, s, figure)))
    ]
    head = [_heading(figure, system) for figure, system in columns]
    rows: Cells = []
    for entry in entries:
        cells: list[str | Markup] = [_breakable(entry.sequence)]
        for figure, system in columns:
            if system is None:
                text = spread_text(entry.spread(figure.key), figure.digits) or NONE
                cells.append(element("b", text))
            else:
                published = entry.of(system)
                source = None if published is None else published.source
                text = published_text(published, figure)
                cells.append(element("span", text, title=source))
        cells.append(f"{entry.n_lost} of {len(entry.rows)}")
        rows.append(cells)
    shown = table(["sequence", *head, "lost"], rows, class_="compared numbers")
    note = (
        "Ours: median (range) over the runs that were not lost. Published figures: look them up in "
        "the paper before you quote them; an empty cell: none is given here; X: the paper marks "
        "the sequence as lost."
    )
    return join(shown, element("p", note, class_="note"))


def _heading(figure: Compared, system: str | None) -> str:
    return f"{system} {figure.name}" if system else f"{figure.name} [{figure.unit}]"


def _all_runs(kind: StandardSet, entries: list[Entry]) -> Markup:
    figures = figures_of(kind)
    head = ["run", "result", *(f"{f.name} [{f.unit}]" for f in figures)]
    head += ["in the path [%]", "times lost", "frames/s"]
    rows: Cells = []
    for entry in entries:
        for row in entry.rows:
            told = _result(row)
            values = [_number(row.get(figure.key), figure.digits) for figure in figures]
            part = f"{100 * part_in_path(row):.1f}" if row.get("frames") else NONE
            losses = NONE if row.get("lost") is None else str(row["lost"])
            rate = _number(row.get("frames_per_second"), 1)
            rows.append([_breakable(str(row["run"])), told, *values, part, losses, rate])
    note = f"Lost: the run failed, or less than {LEAST_PART:.0%} of the frames have a pose in the "
    note += "path that is judged, which is that of the last map. The error of a lost run is of "
    note += "what it has."
    shown = table(head, rows, class_="compared numbers")
    return join(shown, element("p", note, class_="note"), _failures(entries))


def _breakable(name: str) -> Markup:
    """Allow line breaks between the words of a long name."""
    first, *words = re.split(r"(?<=[_-])", short_name(name))
    return join(first, *(join(Markup("<wbr>"), word) for word in words))


def _result(row: dict[str, Any]) -> Markup:
    if not is_lost(row):
        return element("span", "whole")
    words = "failed" if row["state"] != "done" else "lost"
    return element("span", element("i", class_="lost"), f" {words}")


def _failures(entries: list[Entry]) -> Markup | None:
    """Return why runs failed, for the space below the table."""
    told = [
        element("li", element("b", f"{row['run']}: "), str(row["reason"]))
        for entry in entries
        for row in entry.rows
        if row["state"] != "done"
    ]
    return join(element("h3", "Why runs failed"), element("ul", *told)) if told else None


def _number(value: float | None, digits: int) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def _repeat(kind: StandardSet, entries: list[Entry], command: str | None) -> Markup:
    """Return how to repeat it, the computer, and the sources of published figures."""
    rows = [row for entry in entries for row in entry.rows]
    options = sorted({name for row in rows for name in row if name.startswith("option.")})
    told: Cells = [
        [name.removeprefix("option.").replace("_", " "), ", ".join(_values(rows, name))]
        for name in options
    ]
    told.append(["seeds", ", ".join(_values(rows, "seed"))])
    told.append(["computers", ", ".join(_values(rows, "machine"))])
    sources = dict.fromkeys(one.source for entry in entries for one in entry.published)
    note = "ATE: RMSE of the positions after alignment by a rotation and a translation, for one "
    note += "camera also a scale (Sturm et al., IROS 2012). "
    if kind is StandardSet.KITTI:
        note += "t_rel, r_rel: mean over segments of 100 to 800 m (Geiger et al., CVPR 2012). "
    note += "Frames a second are of runs beside each other."
    return section(
        "repeat",
        "Repeat",
        element("pre", element("code", command)) if command else None,
        table([], told),
        element("p", note, class_="note"),
        element("h3", "Published figures") if sources else None,
        element("ul", *(element("li", source) for source in sources)) if sources else None,
    )


def _values(rows: list[dict[str, Any]], name: str) -> list[str]:
    return sorted({str(row[name]) for row in rows if row.get(name) is not None})
