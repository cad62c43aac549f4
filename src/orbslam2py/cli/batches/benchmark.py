# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py benchmark``: the sequences of a standard data set beside published figures."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py._arguments import number_of
from orbslam2py.batches.standard_sets import BenchmarkResult, StandardSet
from orbslam2py.batches.standard_sets import benchmark as run_benchmark
from orbslam2py.batches.standard_sets.markdown import (
    SYSTEMS,
    figures_of,
    has_published,
    published_text,
    spread_text,
)
from orbslam2py.cli.batches.arguments import (
    MemoryLimitOption,
    ReportPagesFlag,
    ResumeFlag,
    SchedulerOption,
    WorkersOption,
)
from orbslam2py.cli.batches.watched_runs import exit_as_it_ended, watched_runs
from orbslam2py.cli.run_options import ImuFlag, QuietFlag
from orbslam2py.settings import Sensor

EXAMPLE = """
**Example**

    orbslam2py benchmark kitti dataset --output runs/kitti

    orbslam2py benchmark kitti dataset --sensor stereo --seeds 3
"""


def benchmark(
    kind: Annotated[StandardSet, typer.Argument(help="The data set.", show_default=False)],
    root: Annotated[
        Path, typer.Argument(help="Folder with its sequences, also in folders below it.")
    ],
    output: Annotated[
        Path | None, typer.Option(help="Folder for the results [runs/benchmark-KIND].")
    ] = None,
    sensor: Annotated[
        list[Sensor] | None,
        typer.Option(help="Only this one; may be given several times [all there are images for]."),
    ] = None,
    seeds: Annotated[int, typer.Option(help="Runs of each.", min=1)] = 5,
    deterministic: Annotated[
        bool, typer.Option("--deterministic", help="The same result of a seed every time.")
    ] = False,
    max_frames: Annotated[
        int | None, typer.Option(help="Most frames of each, for a trial.", min=1)
    ] = None,
    imu: ImuFlag = None,
    resume: ResumeFlag = False,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    memory_limit: MemoryLimitOption = None,
    report_pages: ReportPagesFlag = False,
    quiet: QuietFlag = False,
) -> None:
    """Run a data set (TUM RGB-D, KITTI, EuRoC, TUM-VI) beside figures of ORB-SLAM2 and 3."""
    console, errors = Console(quiet=quiet), Console(stderr=True)
    options: dict[str, Any] = {"deterministic": True} if deterministic else {}
    if max_frames is not None:
        options["max_frames"] = max_frames
    if imu is not None:
        options["imu"] = imu
    with watched_runs(console, errors) as (progress, watch, stop):
        done = run_benchmark(
            kind,
            root,
            output or Path("runs") / f"benchmark-{kind}",
            sensors=sensor or None,
            seeds=seeds,
            options=options,
            resume=resume,
            scheduler=scheduler,
            workers=workers,
            memory_limit=memory_limit,
            report_pages=report_pages,
            progress=progress,
            watch=watch,
            stop=stop,
            command=shlex.join(["orbslam2py", *sys.argv[1:]]),
        )
    console.print(_table(done))
    for file in (done.page, done.table):
        console.print(escape(str(file)), highlight=False, soft_wrap=True)
    exit_as_it_ended(done.batch, errors)


benchmark.__doc__ = f"{benchmark.__doc__}\n{EXAMPLE}"


def _table(done: BenchmarkResult) -> Table:
    """Return one line for each figure: a terminal has room for all systems side by side."""
    entries, figures = done.entries, figures_of(done.kind)
    systems = [s for s in SYSTEMS if any(has_published(entries, s, one) for one in figures)]
    table = Table(title=f"{done.kind.full_name}: {number_of(len(done.batch.rows), 'run')}")
    table.add_column("sequence", overflow="fold")
    for name in ("sensor", "figure"):
        table.add_column(name, no_wrap=True)
    for name in ("orbslam2py", *systems, "lost"):
        table.add_column(name, justify="right", no_wrap=name != "orbslam2py")
    for entry in entries:
        lost = f"{entry.n_lost} of {len(entry.rows)}" if entry.n_lost else ""
        for number, figure in enumerate(figures):
            first = (escape(entry.sequence), entry.sensor) if number == 0 else ("", "")
            table.add_row(
                *first,
                escape(f"{figure.name} [{figure.unit}]"),
                spread_text(entry.spread(figure.key), figure.digits),
                *(published_text(entry.of(system), figure) for system in systems),
                lost if number == 0 else "",
            )
    return table
