# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py report`` and ``orbslam2py compare``: finished runs as pages."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py.cli.messages import log_to
from orbslam2py.cli.targets import check_page
from orbslam2py.runs.report_page import (
    Comparison,
    PageKind,
    compare_runs,
    write_comparison,
    write_report_page,
)

_log = logging.getLogger(__name__)


def report(
    run: Annotated[Path, typer.Argument(help="Folder of a run.")],
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="The page [report.html in the folder of the run]."),
    ] = None,
) -> None:
    """Make the page of a finished run again, from the files in its folder.

    **Example**

        orbslam2py report runs/latest
    """
    log_to(Console(stderr=True), quiet=False)
    page = output or run / "report.html"
    write_report_page(check_page(page, PageKind.RUN), run)
    _tell(page)


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Folders of two runs or more.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The page.")] = Path(
        "compare.html"
    ),
) -> None:
    """Set finished runs side by side: figures, paths, errors and times, in a table and as a page.

    **Example**

        orbslam2py compare runs/06 runs/latest -o both.html
    """
    log_to(Console(stderr=True), quiet=False)
    comparison = compare_runs(runs)
    for warning in comparison.warnings:
        _log.warning("%s", warning.rstrip("."))
    Console().print(_table(comparison))
    write_comparison(check_page(output, PageKind.COMPARISON), comparison)
    _tell(output)


def _tell(page: Path) -> None:
    text = f"The page is [bold]{escape(str(page))}[/]"
    Console().print(text, highlight=False, soft_wrap=True)


def _table(comparison: Comparison) -> Table:
    table = Table(title=escape(", ".join(dict.fromkeys(run.name for run in comparison.runs))))
    table.add_column("figure")
    table.add_column("unit")
    for name in comparison.names:
        table.add_column(escape(name), justify="right")
    for rows in comparison.rows().values():
        for row in rows:
            values = (
                f"[bold]{escape(value)} *[/]" if best else escape(value)
                for value, best in zip(row.values, row.best, strict=True)
            )
            table.add_row(escape(row.figure.name), row.figure.unit, *values)
        table.add_section()
    return table
