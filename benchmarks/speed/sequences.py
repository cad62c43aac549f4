# SPDX-License-Identifier: BSD-3-Clause
"""Whole sequences beside the reference: speed, real time, and fusing as it happens in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from rich.table import Table

from benchmarks.harness import reference
from benchmarks.harness.folders import MISSING, sequence_folder, shared_folder
from benchmarks.harness.reference import SequenceFigure
from benchmarks.harness.runs import median_of, run_report
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Measurement, Times, Yardstick


def sequence_tables(yardstick: Yardstick, n_runs: int) -> Iterator[object]:
    """All of them."""
    if shared_folder() is None:
        yield f"[yellow]Sequences: left out, {MISSING}"
        return
    offline = new_table(
        f"Whole sequences, offline, threads ({n_runs} runs each, median)",
        ["sequence"],
        [
            "frames/s here\nmedian (max)",
            "slower\nhere by",
            "there\nours",
            "there\nreference",
            "ours /\nreference",
            "target",
            "met",
            "track ms here\nmedian / p99",
            "reference there",
            "ATE m",
            "ATE m\nreference",
        ],
    )
    summed = new_table(
        "The same by the original's formula: frames / (sum of tracking + sum of mapping)",
        ["sequence", "mode"],
        [
            "frames/s here",
            "slower\nhere by",
            "there\nours",
            "there\nreference",
            "ours /\nreference",
            "ATE m",
            "ATE m\nreference",
        ],
    )
    realtime = new_table(
        "Real time: p99 of tracking",
        ["sequence"],
        ["track ms here\nmedian", "p99", "period", "met", "dropped", "track ms there\nreference"],
    )
    fusing = new_table(
        "Fusing a keyframe with its neighbours (in the sequences, mapping inline)",
        ["sequence"],
        ["ms here\nmedian", "p99", "ms there\nmedian", "reference", "limit", "met"],
    )
    for figure in reference.SEQUENCES:
        folder = sequence_folder(figure.folder)
        reports, measured = _add_offline(offline, yardstick, figure, folder, n_runs)
        _add_summed(summed, yardstick, figure, folder, reports, measured)
        _add_realtime(realtime, figure, folder, n_runs)
        _add_fusing(fusing, yardstick, figure, folder)
    yield from (offline, summed, realtime, fusing)


def _add_offline(
    table: Table, yardstick: Yardstick, figure: SequenceFigure, folder: Path, n_runs: int
) -> tuple[list[dict[str, Any]], Measurement]:
    reports: list[dict[str, Any]] = []

    def work() -> float:
        reports.append(run_report(folder, figure.sensor))
        return 1e3 / float(reports[-1]["slam_frames_per_second"])

    measured = yardstick.around([work] * n_runs)
    here = Times.of([report["slam_frames_per_second"] for report in reports])
    there = 1e3 / measured.carried
    ratio = there / figure.frames_per_second
    table.add_row(
        figure.name,
        f"{here.median:.0f} ({max(r['slam_frames_per_second'] for r in reports):.0f})",
        f"{measured.slower:.2f}",
        f"{there:.0f}",
        f"{figure.frames_per_second}",
        f"{ratio:.2f}",
        f"{reference.SEQUENCE_SPEED_RATIO}",
        verdict(ratio >= reference.SEQUENCE_SPEED_RATIO),
        f"{median_of(reports, 'milliseconds', 'track', 'median'):.1f} / "
        f"{median_of(reports, 'milliseconds', 'track', 'p99'):.1f}",
        f"{figure.track_ms[0]} / {figure.track_ms[1]}",
        f"{median_of(reports, 'ate_rmse_m'):.4f}",
        f"{figure.ate}",
    )
    return reports, measured


def _summed_milliseconds(report: dict[str, Any]) -> float:
    """Tracking and mapping together, per frame."""
    stages = report["milliseconds"]
    total = sum(stages[part]["mean"] * stages[part]["count"] for part in ("track", "mapping"))
    return float(total / stages["track"]["count"])


def _add_summed(
    table: Table,
    yardstick: Yardstick,
    figure: SequenceFigure,
    folder: Path,
    threaded: list[dict[str, Any]],
    with_threads: Measurement,
) -> None:
    """Threads slow each other down on two processors; inline mapping has the same formula."""
    inline: list[dict[str, Any]] = []

    def work() -> float:
        inline.append(run_report(folder, figure.sensor, "--deterministic"))
        return _summed_milliseconds(inline[-1])

    inline_times = yardstick.around([work] * 3)
    with_threads = replace(
        with_threads, ours=Times.of([_summed_milliseconds(report) for report in threaded])
    )
    for mode, m, reports in (
        ("threads", with_threads, threaded),
        ("mapping inline", inline_times, inline),
    ):
        there = 1e3 / m.carried
        table.add_row(
            figure.name,
            mode,
            f"{1e3 / m.ours.median:.0f}",
            f"{m.slower:.2f}",
            f"{there:.0f}",
            f"{figure.frames_per_second}",
            f"{there / figure.frames_per_second:.2f}",
            f"{median_of(reports, 'ate_rmse_m'):.4f}",
            f"{figure.ate}",
        )


def _add_realtime(table: Table, figure: SequenceFigure, folder: Path, n_runs: int) -> None:
    reports = [run_report(folder, figure.sensor, "--realtime") for _ in range(min(n_runs, 3))]
    p99 = median_of(reports, "milliseconds", "track", "p99")
    table.add_row(
        figure.name,
        f"{median_of(reports, 'milliseconds', 'track', 'median'):.1f}",
        f"{p99:.1f}",
        f"{figure.period_ms}",
        verdict(p99 < figure.period_ms),
        f"{median_of(reports, 'dropped_frames'):.0f}",
        f"{figure.track_ms[0]} / {figure.track_ms[1]}",
    )


def _add_fusing(table: Table, yardstick: Yardstick, figure: SequenceFigure, folder: Path) -> None:
    stages: dict[str, float] = {}

    def work() -> float:
        report = run_report(folder, figure.sensor, "--deterministic")
        stages.update(report["milliseconds"]["mapping.fuse"])
        return stages["median"]

    measured = yardstick.around([work])
    limit = reference.FUSE.limit or 0
    table.add_row(
        figure.name,
        f"{stages['median']:.2f}",
        f"{stages['p99']:.2f}",
        f"{measured.carried:.2f}",
        "26 to 53",
        f"{limit:g}",
        verdict(measured.carried < limit),
    )
