# SPDX-License-Identifier: BSD-3-Clause
"""Messages on the terminal: errors, warnings, notes."""

from __future__ import annotations

import logging
from collections import Counter

from rich.console import Console
from rich.markup import escape


def print_error(console: Console, title: str, text: str) -> None:
    """Print a message in one line, so that paths can be copied."""
    console.print(f"[bold red]{title}:[/] {escape(text)}", highlight=False, soft_wrap=True)


#: How often a warning of one kind is printed before the next ones are only counted.
_TOLD_EACH = 3


class _ConsoleHandler(logging.Handler):
    """Prints warnings like errors, in one line each, so that paths can be copied.

    Warnings of one kind differ only in the things that they name. The fourth and later ones are
    only counted; `tell_rest` prints their number.
    """

    def __init__(self, console: Console) -> None:
        super().__init__()
        self._console = console
        self._counts: Counter[str] = Counter()
        self._last: dict[str, logging.LogRecord] = {}

    def emit(self, record: logging.LogRecord) -> None:
        kind = str(record.msg)
        # Messages are of one kind if their texts without the values are equal.
        if record.levelno < logging.ERROR:
            self._counts[kind] += 1
            if self._counts[kind] > _TOLD_EACH:
                self._last[kind] = record
                return
        self._print(record, self.format(record))

    def tell_rest(self) -> None:
        """Print how many warnings were only counted, by kind, and reset the counts."""
        for kind, record in self._last.items():
            more = self._counts[kind] - _TOLD_EACH
            text = self.format(record)
            self._print(record, text if more == 1 else f"{more} more like this, the last: {text}")
        self._counts.clear()
        self._last.clear()

    def _print(self, record: logging.LogRecord, text: str) -> None:
        colour = "red" if record.levelno >= logging.ERROR else "yellow"
        name = "Note" if record.levelno < logging.WARNING else record.levelname.capitalize()
        title = f"[bold {colour}]{name}:[/]"
        self._console.print(f"{title} {escape(text)}", highlight=False, soft_wrap=True)


def log_to(console: Console, *, quiet: bool) -> None:
    """Print the package's warnings (errors, if quiet) on a console."""
    tell_repeated()
    logger = logging.getLogger("orbslam2py")
    logger.handlers = [_ConsoleHandler(console)]
    logger.propagate = False
    logger.setLevel(logging.ERROR if quiet else logging.WARNING)
    # Guesses about the input are shown as well, and the networks of a run.
    for room in ("datasets", "calibration.camera_files", "ros"):
        level = logging.ERROR if quiet else logging.INFO
        logging.getLogger(f"{logger.name}.{room}").setLevel(level)


def tell_repeated() -> None:
    """Print how many warnings were only counted, because three equal ones were printed."""
    for handler in logging.getLogger("orbslam2py").handlers:
        if isinstance(handler, _ConsoleHandler):
            handler.tell_rest()
