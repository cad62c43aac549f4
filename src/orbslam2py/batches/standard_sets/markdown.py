# SPDX-License-Identifier: BSD-3-Clause
"""The results of a benchmark as a table in Markdown."""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py._version import __version__
from orbslam2py.batches.standard_sets.entries import LEAST_PART, Entry, is_lost
from orbslam2py.batches.standard_sets.find import StandardSet
from orbslam2py.batches.standard_sets.published import Published
from orbslam2py.batches.summary import Spread

SYSTEMS = ("ORB-SLAM2", "ORB-SLAM3")


@dataclass(frozen=True)
class Compared:
    """A figure that is compared with published ones."""

    name: str
    unit: str
    key: str
    """Its name in reports."""
    digits: int
    """Of ours."""
    printed: int
    """Digits of the papers."""


_DRIFT = (
    Compared("t_rel", "%", "t_rel_percent", 2, 2),
    Compared("r_rel", "deg/100 m", "r_rel_deg_per_100m", 2, 2),
)


def figures_of(kind: StandardSet) -> tuple[Compared, ...]:
    """Return the published figures of a data set: segment errors only for KITTI."""
    outdoors = kind is StandardSet.KITTI
    ate = Compared("ATE", "m", "ate_rmse_m", 3, 1 if outdoors else 3)
    return (ate, *(_DRIFT if outdoors else ()))


def spread_text(spread: Spread | None, digits: int) -> str:
    """Return the median, followed by the range if there is one."""
    if spread is None:
        return ""
    median, least, most = (f"{x:.{digits}f}" for x in (spread.median, spread.least, spread.most))
    return median if least == most else f"{median} ({least}\N{EN DASH}{most})"


def published_text(published: Published | None, figure: Compared) -> str:
    """Return a figure in the paper's form; X for a sequence that it marks as lost."""
    if published is None:
        return ""
    if published.is_lost:
        return "X" if figure.key == "ate_rmse_m" else ""
    value = getattr(published, figure.key)
    return "" if value is None else f"{value:.{figure.printed}f}"


def has_published(entries: list[Entry], system: str, figure: Compared) -> bool:
    """Return whether a system has a figure for any of the sequences."""
    return any(published_text(entry.of(system), figure) for entry in entries)


def run_texts(entry: Entry, figure: Compared) -> list[str]:
    """Return a figure of every run: X for a lost one, with its value if there is one."""
    texts = []
    for row in entry.rows:
        value = row.get(figure.key)
        text = "" if value is None else f"{value:.{figure.digits}f}"
        lost = f"X ({text})" if text else "X"
        texts.append(lost if is_lost(row) else text or "\N{EN DASH}")
    return texts


def markdown_table(kind: StandardSet, entries: list[Entry]) -> str:
    """Make one table for each sensor: medians and ranges, published figures, and every run."""
    lines = [f"## {kind.full_name}, orbslam2py {__version__}", ""]
    sources: dict[str, None] = {}
    for sensor in dict.fromkeys(entry.sensor for entry in entries):
        mine = [entry for entry in entries if entry.sensor == sensor]
        sources |= {one.source: None for entry in mine for one in entry.published}
        lines += [f"### {sensor or 'not opened'}", "", *_table(kind, mine), ""]
    lines.append(
        "Median (range) over the runs that were not lost; X: lost, that is without a pose in the "
        f"path for {1 - LEAST_PART:.0%} of the frames or more, or failed. ATE: RMSE after "
        "alignment, with scale for mono."
    )
    lines += ["", *(f"* {source}" for source in sources)] if sources else []
    return "\n".join(lines) + "\n"


def _table(kind: StandardSet, entries: list[Entry]) -> list[str]:
    figures = figures_of(kind)
    systems = [name for name in SYSTEMS if any(entry.of(name) for entry in entries)]
    head = ["sequence"]
    for figure in figures:
        head.append(f"{figure.name} [{figure.unit}]")
        head += [f"{s} {figure.name}" for s in systems if has_published(entries, s, figure)]
    head += ["lost", "ATE of every run [m]"]
    lines = [head, ["---", *["---:"] * (len(head) - 2), "---"]]
    for entry in entries:
        cells = [entry.sequence.replace("|", "\\|")]
        for figure in figures:
            cells.append(spread_text(entry.spread(figure.key), figure.digits))
            there = [s for s in systems if has_published(entries, s, figure)]
            cells += [published_text(entry.of(system), figure) for system in there]
        cells.append(f"{entry.n_lost} of {len(entry.rows)}" if entry.n_lost else "")
        cells.append(", ".join(run_texts(entry, figures[0])))
        lines.append(cells)
    return [f"| {' | '.join(line)} |" for line in lines]
