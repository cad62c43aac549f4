# SPDX-License-Identifier: BSD-3-Clause
"""Many runs on one screen: progress, failures, and Ctrl-C."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console, RenderableType
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.text import Text

from orbslam2py._arguments import number_of
from orbslam2py.batches import BatchResult
from orbslam2py.batches.batch import Progress as OnProgress
from orbslam2py.batches.engine import Watch
from orbslam2py.cli.exit_codes import ExitCode
from orbslam2py.cli.interrupts import StopOnInterrupt
from orbslam2py.cli.messages import log_to

#: Workers whose run is shown; of a cluster only the first.
_SHOWN_WORKERS = 16


class _Screen(Progress):
    """A bar of all runs, and a line for each worker below it."""

    workers: str = ""

    def get_renderables(self) -> Iterable[RenderableType]:
        yield from super().get_renderables()
        yield Text(self.workers, style="dim", no_wrap=True, overflow="ellipsis")


def lines_of(working: Mapping[str, str]) -> str:
    """Show the present run of each worker, one line each."""
    names = [working[worker] for worker in sorted(working)]
    more = len(names) - _SHOWN_WORKERS
    lines = [f"  {number}  {name}" for number, name in enumerate(names[:_SHOWN_WORKERS], 1)]
    return "\n".join([*lines, f"  and {more} more"] if more > 0 else lines)


@contextmanager
def watched_runs(
    console: Console, errors: Console
) -> Iterator[tuple[OnProgress, Watch, threading.Event]]:
    """Show a bar while runs are made, and the present run of each worker.

    Parameters
    ----------
    console, errors
        For messages, and for errors.

    Yields
    ------
    progress, watch, stop
        Functions to call after each run and at changes of the workers, and the event that Ctrl-C
        sets.
    """
    log_to(errors, quiet=True)  # what single runs say is in their folders
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with (
        StopOnInterrupt() as interrupt,
        _Screen(*columns, TimeRemainingColumn(), console=console, transient=True) as bar,
    ):
        task = bar.add_task("Runs", total=None)

        def progress(row: dict[str, Any], done: int, total: int) -> None:
            if row["state"] != "done":
                console.print(f"[red]failed[/] {escape(row['run'])}: {escape(str(row['reason']))}")
            ending = "; waiting for those that run" if interrupt.event.is_set() else ""
            bar.update(task, completed=done, total=total, description=f"Runs{ending}")

        def watch(working: Mapping[str, str]) -> None:
            bar.workers = lines_of(working)

        yield progress, watch, interrupt.event


def exit_as_it_ended(done: BatchResult, errors: Console) -> None:
    """End with the exit code if runs remain or failed; otherwise do nothing."""
    if done.n_left:
        verb = "is" if done.n_left == 1 else "are"
        errors.print(
            f"{number_of(done.n_left, 'run')} {verb} left; continue with --resume", highlight=False
        )
        raise typer.Exit(ExitCode.INTERRUPTED)
    if done.n_failed:
        raise typer.Exit(ExitCode.FAILED)
