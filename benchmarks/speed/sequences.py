# SPDX-License-Identifier: BSD-3-Clause
"""Whole sequences beside the reference: speed, real time, Python's share, locks."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from benchmarks.harness import reference, runs
from benchmarks.harness.reference import SequenceFigure
from benchmarks.harness.tables import new_table, verdict
from benchmarks.harness.yardstick import Measurement, Times, Yardstick, shared_folder
from benchmarks.speed.single_steps import Row

_MISSING = "left out: the sequences are not there (ORBSLAM2PY_SHARED names their folder)"


def _folder(figure: SequenceFigure) -> Path | None:
    shared = shared_folder()
    return None if shared is None else shared / "sequences" / figure.folder


def _median(reports: list[dict[str, Any]], *keys: str) -> float:
    values = []
    for report in reports:
        value: Any = report
        for key in keys:
            value = value[key]
        values.append(float(value))
    return statistics.median(values)


# ---- speed ---------------------------------------------------------------------------------------
def sequence_tables(yardstick: Yardstick, n_runs: int) -> Iterator[object]:
    """Offline speed, real time, and fusing as it happens in the sequences."""
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
        folder = _folder(figure)
        if folder is None:
            yield f"[yellow]{figure.name}: {_MISSING}"
            continue
        reports, measured = _add_offline(offline, yardstick, figure, folder, n_runs)
        _add_summed(summed, yardstick, figure, folder, reports, measured)
        _add_realtime(realtime, figure, folder, n_runs)
        _add_fusing(fusing, yardstick, figure, folder)
    for table in (offline, summed, realtime, fusing):
        if table.row_count:
            yield table


def _add_offline(
    table: Table, yardstick: Yardstick, figure: SequenceFigure, folder: Path, n_runs: int
) -> tuple[list[dict[str, Any]], Measurement]:
    reports: list[dict[str, Any]] = []

    def work() -> float:
        reports.append(runs.run(folder, figure.sensor))
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
        f"{_median(reports, 'milliseconds', 'track', 'median'):.1f} / "
        f"{_median(reports, 'milliseconds', 'track', 'p99'):.1f}",
        f"{figure.track_ms[0]} / {figure.track_ms[1]}",
        f"{_median(reports, 'ate_rmse_m'):.4f}",
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
        inline.append(runs.run(folder, figure.sensor, "--deterministic"))
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
            f"{_median(reports, 'ate_rmse_m'):.4f}",
            f"{figure.ate}",
        )


def _add_realtime(table: Table, figure: SequenceFigure, folder: Path, n_runs: int) -> None:
    reports = [runs.run(folder, figure.sensor, "--realtime") for _ in range(min(n_runs, 3))]
    p99 = _median(reports, "milliseconds", "track", "p99")
    table.add_row(
        figure.name,
        f"{_median(reports, 'milliseconds', 'track', 'median'):.1f}",
        f"{p99:.1f}",
        f"{figure.period_ms}",
        verdict(p99 < figure.period_ms),
        f"{_median(reports, 'dropped_frames'):.0f}",
        f"{figure.track_ms[0]} / {figure.track_ms[1]}",
    )


def program_rows(yardstick: Yardstick, build: Path) -> Iterator[Row]:
    """Fusing in a dense made-up map where everything is covisible: the worst case, from C++."""
    program = build / "benchmarks" / "cpp" / "matching_bench"
    if not program.is_file():
        return
    command = [str(program), "--benchmark_format=json", "--benchmark_filter=fuse"]
    found: dict[str, float] = {}

    def work() -> float:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        for one in json.loads(done.stdout)["benchmarks"]:
            found[one["name"].split("/")[1]] = one["median_ms"]
        return max(found.values())

    unit = yardstick.around([work])
    for name, value in found.items():
        measured = replace(unit, ours=Times(value, value))
        yield Row(f"fuse, dense made-up map ({name})", reference.FUSE, measured)


def _add_fusing(table: Table, yardstick: Yardstick, figure: SequenceFigure, folder: Path) -> None:
    stages: dict[str, float] = {}

    def work() -> float:
        report = runs.run(folder, figure.sensor, "--deterministic")
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


# ---- Python's share ------------------------------------------------------------------------------
def python_table() -> Iterator[object]:
    table = new_table(
        "Python's share of a frame: between the C++ steps",
        ["sequence", "frames"],
        ["ms a frame", "Python ms", "calls of C++", "share", "limit", "met"],
    )
    table.caption = (
        "Every function, method and property of the extension is wrapped to\n"
        "note its time, the rest of the track call is Python (benchmarks/speed/python_share.py).\n"
        "Mapping inline: no other thread uses the interpreter. Freeing C++ objects counts on "
        "neither side."
    )
    table.caption_justify = "left"
    for figure in reference.SEQUENCES:
        folder = _folder(figure)
        if folder is None:
            yield f"[yellow]Python's share, {figure.name}: {_MISSING}"
            continue
        for label, option in (
            ("all, with mapping: mean", []),
            ("not keyframes: median", ["--tracking-only"]),
        ):
            command = [
                sys.executable,
                "-m",
                "benchmarks.speed.python_share",
                str(folder),
                figure.sensor,
            ]
            command += option
            done = subprocess.run(command, capture_output=True, text=True, check=True)
            share = json.loads(done.stdout)
            table.add_row(
                figure.name,
                label,
                f"{share['milliseconds']:.2f}",
                f"{share['python_milliseconds']:.3f}",
                f"{share['calls']:.0f}",
                f"{100 * share['share']:.1f} %",
                f"{100 * reference.PYTHON_SHARE:g} %",
                verdict(share["share"] < reference.PYTHON_SHARE),
            )
    if table.row_count:
        yield table


# ---- locks ---------------------------------------------------------------------------------------
_EDGES_MS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 20.0)


def lock_tables(library: Path) -> Iterator[object]:
    if not library.is_file():
        yield (
            f"[yellow]Locks: left out, {library} is not built "
            "(cmake --preset release, then cmake --build build/release --target lock_times)"
        )
        return
    local, whole = reference.LOCK_HOLD_MS
    table = new_table(
        f"Sections under the map's lock, by milliseconds held (aim: writing {local:g}, a whole map "
        f"{whole:g})",
        ["sequence", ""],
        [
            "n",
            *(f"<{edge:g}" for edge in _EDGES_MS),
            "more",
            "p99",
            "max",
            "max\nused",
            "max\nwait",
        ],
    )
    for figure in reference.SEQUENCES:
        folder = _folder(figure)
        if folder is None:
            yield f"[yellow]Locks, {figure.name}: {_MISSING}"
            continue
        times = runs.LockTimes.measure(folder, figure.sensor, library)
        for kind, sections in (("writing", times.written), ("reading", times.read)):
            if not len(sections):
                continue
            waited, held, used = (sections / 1e3).T
            counts = np.bincount(np.searchsorted(_EDGES_MS, held, side="right"), minlength=11)
            table.add_row(
                figure.name,
                kind,
                str(len(held)),
                *(str(count) for count in counts),
                f"{np.percentile(held, 99):.2f}",
                f"{held.max():.2f}",
                f"{used.max():.2f}",
                f"{waited.max():.2f}",
            )
    table.caption = (
        "Held is wall-clock time: a thread that loses the processor goes on holding the lock. "
        "Used: processor time\nwhile the lock was held."
    )
    table.caption_justify = "left"
    if table.row_count:
        yield table
