# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the benchmarks."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table


def new_table(title: str, texts: Sequence[str], numbers: Sequence[str], caption: str = "") -> Table:
    """Columns of text, then columns of numbers; a caption below."""
    table = Table(title=title, title_justify="left", caption_justify="left")
    for name in texts:
        table.add_column(name)
    for name in numbers:
        table.add_column(name, justify="right")
    table.caption = caption or None
    return table


def verdict(met: bool) -> str:
    """Whether a target is met."""
    return "[green]yes[/]" if met else "[red]NO[/]"


def in_words(met: bool) -> str:
    """The same within a sentence."""
    return "met" if met else "NOT met"
