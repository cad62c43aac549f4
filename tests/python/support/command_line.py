# SPDX-License-Identifier: BSD-3-Clause
"""The command line, called in this process or as a process of its own."""

from __future__ import annotations

import csv
import json
import logging
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer.main

from orbslam2py.cli import main

#: What a run leaves in its folder.
RUN_FILES = frozenset(
    [
        "trajectory.txt",
        "trajectory_online.txt",
        "keyframes.txt",
        "trajectory_kitti.txt",
        "frames.csv",
        "points.ply",
        "map.npz",
        "trajectory.png",
        "report.json",
        "report.html",
        "frame_images.zip",
        "groundtruth_aligned.txt",
        "settings.yaml",
    ]
)


@dataclass(frozen=True)
class Outcome:
    code: int
    out: str
    err: str


@contextmanager
def logging_restored() -> Iterator[None]:
    """The command directs the package's log to its own console, and sets levels of some rooms."""
    logger = logging.getLogger("orbslam2py")
    before = logger.handlers, logger.propagate
    levels = {each: each.level for each in (logger, *_children(logger))}
    try:
        yield
    finally:
        logger.handlers, logger.propagate = before
        for each in (logger, *_children(logger)):
            each.setLevel(levels.get(each, logging.NOTSET))


def _children(logger: logging.Logger) -> list[logging.Logger]:
    known = list(logging.Logger.manager.loggerDict.values())
    return [
        each
        for each in known
        if isinstance(each, logging.Logger) and each.name.startswith(f"{logger.name}.")
    ]


_get_command = typer.main.get_command


@cache
def _built(app: typer.Typer, columns: int) -> Any:
    return _get_command(app)


def _command_built_once(app: typer.Typer) -> Any:
    """Build the tree of all commands once: it takes longer than most tests take to call one.

    Its help depends on the width of the terminal.
    """
    return _built(app, shutil.get_terminal_size().columns)


class CommandLine:
    """Calls ``orbslam2py`` in the folder of the test."""

    def __init__(
        self, patch: pytest.MonkeyPatch, capture: pytest.CaptureFixture[str], folder: Path
    ) -> None:
        self._patch = patch
        self._capture = capture
        patch.chdir(folder)

    def __call__(self, *arguments: object) -> Outcome:
        self._patch.setattr(typer.main, "get_command", _command_built_once)
        self._patch.setattr(sys, "argv", ["orbslam2py", *map(str, arguments)])
        self._capture.readouterr()
        with logging_restored(), pytest.raises(SystemExit) as end:
            main()
        printed = self._capture.readouterr()
        code = end.value.code
        return Outcome(code if isinstance(code, int) else int(code or 0), printed.out, printed.err)


def refused(done: Outcome, *said: str) -> None:
    """See that a command ended with one line that holds these texts, and with wrong usage."""
    assert done.code == 2, done.out
    assert len(done.err.strip().splitlines()) == 1, done.err
    for text in said:
        assert text in done.err


@dataclass(frozen=True)
class Results:
    """What a run left in its folder."""

    folder: Path

    @property
    def report(self) -> dict[str, Any]:
        return dict(json.loads((self.folder / "report.json").read_text()))

    @property
    def frames(self) -> list[dict[str, str]]:
        with (self.folder / "frames.csv").open(newline="") as stream:
            return list(csv.DictReader(stream))

    def lines(self, name: str) -> list[str]:
        return (self.folder / name).read_text().splitlines()
