# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the benchmarks."""

from __future__ import annotations

from rich.table import Table


def new_table(title: str, texts: list[str], numbers: list[str]) -> Table:
    """Columns of text, then columns of numbers."""
    table = Table(title=title, title_justify="left")
    for name in texts:
        table.add_column(name)
    for name in numbers:
        table.add_column(name, justify="right")
    return table


def verdict(met: bool) -> str:
    """Whether a target is met."""
    return "[green]yes[/]" if met else "[red]NO[/]"
