# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py batch``: many runs, one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape

from orbslam2py.batches import batch as run_batch
from orbslam2py.cli.batches.arguments import (
    MemoryLimitOption,
    ReportPagesFlag,
    ResumeFlag,
    SchedulerOption,
    WorkersOption,
)
from orbslam2py.cli.batches.printed_table import printed_table
from orbslam2py.cli.batches.watched_runs import exit_as_it_ended, watched_runs
from orbslam2py.cli.run_options import QuietFlag

EXAMPLE = """
**Example**

    orbslam2py batch jobs.yaml --output runs/night

    orbslam2py batch jobs.yaml --output runs/night --resume
"""


def batch(
    jobs: Annotated[Path, typer.Argument(help="Job file (YAML): sequences, options, seeds.")],
    output: Annotated[
        str | None,
        typer.Option(
            help="Folder for the results, or an address such as s3://bucket/night [that of the job "
            "file].",
            metavar="PLACE",
        ),
    ] = None,
    resume: ResumeFlag = False,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    memory_limit: MemoryLimitOption = None,
    report_pages: ReportPagesFlag = False,
    cache: Annotated[
        Path | None,
        typer.Option(
            help="Folder for sequences from elsewhere (s3://, https://, zip, tar), on each worker "
            "[~/.cache/orbslam2py/sequences]."
        ),
    ] = None,
    cache_size: Annotated[
        str | None, typer.Option(help="Most that it takes [20GB].", metavar="SIZE")
    ] = None,
    quiet: QuietFlag = False,
) -> None:
    """Run many sequences, settings and seeds on all cores or a cluster; write one table."""
    console, errors = Console(quiet=quiet), Console(stderr=True)
    with watched_runs(console, errors) as (progress, watch, stop):
        done = run_batch(
            jobs,
            output,
            resume=resume,
            scheduler=scheduler,
            workers=workers,
            memory_limit=memory_limit,
            report_pages=report_pages,
            cache=cache,
            cache_size=cache_size,
            progress=progress,
            watch=watch,
            stop=stop,
        )
    console.print(printed_table(done, console.width))
    console.print(f"Results are in {escape(str(done.files[0]))}", highlight=False, soft_wrap=True)
    exit_as_it_ended(done, errors)


batch.__doc__ = f"{batch.__doc__}\n{EXAMPLE}"
