# SPDX-License-Identifier: BSD-3-Clause
"""Options of all commands that make many runs."""

from __future__ import annotations

from typing import Annotated

import typer

ResumeFlag = Annotated[
    bool, typer.Option("--resume", help="Continue a batch: finished runs are not repeated.")
]
SchedulerOption = Annotated[
    str | None,
    typer.Option(
        help="A running Dask scheduler [workers on this computer].", metavar="tcp://HOST:PORT"
    ),
]
WorkersOption = Annotated[
    int | None,
    typer.Option(help="Workers to start [one a core]; 0: none, one run after the other.", min=0),
]
MemoryLimitOption = Annotated[
    str | None,
    typer.Option(
        help="Memory of each worker that is started, such as 4GB; at least 500MB [an equal part of "
        "the computer's memory].",
        metavar="SIZE",
    ),
]
ReportPagesFlag = Annotated[
    bool, typer.Option("--report-pages", help="Write report.html for every run.")
]
