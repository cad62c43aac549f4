# SPDX-License-Identifier: BSD-3-Clause
"""Every command and every piece of Python in README and documentation is run."""

from __future__ import annotations

import contextlib
import csv
import importlib
import io
import itertools
import json
import os
import pickle
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import pytest

from orbslam2py.calibration.selection import compare_families
from orbslam2py.cli import main
from support.command_line import logging_restored
from support.documentation_data import copy_data, make_data
from support.documents import ROOT, SHELL, SHOWN, Block, blocks_of, documents

#: All blocks that are not run, with the reason; see `test_all_others_run`.
NOT_RUN = {
    "installs packages",
    "installs packages and opens a browser",
    "opens a browser",
    "needs another computer",
    "needs a bucket",
    "builds the checkout",
    "builds Ceres and OpenCV",
    "takes a minute; another test runs it",
    "needs a camera",
    "needs a robot",
    "needs photographs that are not part of the project",
}


#: What is added to the examples of long commands in the help; in documents to `demo` alone.
SHORTER = {
    "batch": "--workers 0",
    "benchmark": "--workers 0 --max-frames 3 --seeds 1",
    "demo": "--frames 12",
    "run": "--max-frames 12",
    "synthesize": "--frames 20 --size 320x240",
}


def runnable(path: Path) -> list[Block]:
    return [b for b in blocks_of(path) if b.language == "python" or b.language in SHELL]


WITH_CODE = [path for path in documents() if runnable(path)]


@pytest.fixture(scope="module", autouse=True)
def _same_board_searched_once() -> Iterator[None]:
    """Pages calibrate with the same video, which takes seconds: all but the first know the result.

    Kept by all that it depends on: by the pixels of an image, by the corners and the size.
    """
    kept: dict[bytes, Any] = {}

    def once(function: Callable[..., Any]) -> Callable[..., Any]:
        def known(*arguments: Any, **named: Any) -> Any:
            key = pickle.dumps((function.__name__, arguments, named))
            if key not in kept:
                kept[key] = pickle.dumps(function(*arguments, **named))
            return pickle.loads(kept[key])

        return known

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cv2, "findChessboardCornersSB", once(cv2.findChessboardCornersSB))
        calibration = "orbslam2py.calibration.calibration"
        patch.setattr(f"{calibration}.compare_families", once(compare_families))
        yield


@pytest.fixture(scope="session")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("documentation")
    make_data(folder)
    return folder


class Page:
    """Runs the blocks of one document, one after the other, in one folder and one namespace."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.namespace: dict[str, Any] = {"__name__": "__main__"}

    def run(self, block: Block) -> None:
        if block.mark("file") is not None:
            (self.folder / str(block.mark("file"))).write_text(block.text)
        elif block.mark("not run") is not None:
            return
        elif block.language == "python":
            # The line numbers of a traceback are those of the document.
            text = "\n" * (block.line - 1) + block.text
            exec(compile(text, str(block.path), "exec"), self.namespace)
        elif block.language in SHELL:
            wanted = int(block.mark("exit code") or 0)
            for command in commands_of(block.text):
                code, printed = self.shell(command)
                assert code == wanted, f"{command}\nexit code {code}, not {wanted}\n{printed}"
        for mark in block.marks:
            if mark.kind == "check":
                self.check(block, mark.text)

    def check(self, block: Block, expression: str) -> None:
        names = {"report_of": self.report_of, "frames_of": self.frames_of, "folder": self.folder}
        assert eval(expression, self.namespace | names), f"below {block.place}: {expression}"

    def report_of(self, name: str) -> dict[str, Any]:
        return dict(json.loads((self.folder / name / "report.json").read_text()))

    def frames_of(self, name: str) -> list[dict[str, str]]:
        with (self.folder / name / "frames.csv").open(newline="") as stream:
            return list(csv.DictReader(stream))

    def shell(self, command: str) -> tuple[int, str]:
        words = shlex.split(command, comments=True)
        if words[0] == "orbslam2py":
            self.make_room(words)
            if words[1] == "demo":
                words += shlex.split(SHORTER["demo"])
            if words[1] in {"batch", "benchmark"} and "--workers" in words:
                # Other tests start workers, which takes seconds (tests/python/batches).
                words[words.index("--workers") + 1] = "0"
            return call(main, words)
        if words[0] == "python":
            return call(lambda: run_python(words[1:]), words[1:])
        assert words[0] in {"head", "cmp", "sed", "ls", "cat"}, f"unknown command: {command}"
        done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, check=False)
        return done.returncode, done.stdout + done.stderr

    def make_room(self, words: list[str]) -> None:
        """Remove a file that was given and that the command is to write."""
        for option, value in itertools.pairwise(words):
            if option in {"--output", "-o"} and (self.folder / value).is_file():
                (self.folder / value).unlink()


def commands_of(text: str) -> list[str]:
    """Commands of a shell block: one a line, those of long lines put together."""
    lines = text.replace("\\\n", " ").splitlines()
    lines = [re.sub(r"^\$ ", "", line).strip() for line in lines]
    return [line for line in lines if line and not line.startswith("#")]


def run_python(words: list[str]) -> None:
    if words[0] == "-m":
        runpy.run_module(words[1], run_name="__main__", alter_sys=True)
    else:
        runpy.run_path(str(ROOT / words[0]), run_name="__main__")


def call(function: Any, arguments: list[str]) -> tuple[int, str]:
    """Call a program in this process; its exit code and what it printed."""
    printed = io.StringIO()
    before = sys.argv
    sys.argv = list(arguments)
    try:
        with (
            logging_restored(),
            contextlib.redirect_stdout(printed),
            contextlib.redirect_stderr(printed),
        ):
            function()
        code: object = 0
    except SystemExit as end:
        code = end.code
    finally:
        sys.argv = before
    return code if isinstance(code, int) else int(code is not None), printed.getvalue()


@pytest.mark.parametrize("path", WITH_CODE, ids=lambda p: str(p.relative_to(ROOT)))
def test_all_blocks_run(
    path: Path, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    copy_data(data, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("COLUMNS", "100")
    page = Page(tmp_path)
    for block in blocks_of(path):
        try:
            page.run(block)
        except BaseException as error:
            error.add_note(f"in the block at {block.place}") if hasattr(error, "add_note") else None
            raise


def test_examples_of_the_commands_run(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the help shows, and the reference of the command line."""
    copy_data(data, tmp_path)
    (tmp_path / "rgbd_dataset_freiburg1_xyz").symlink_to(data / "rgbd_dataset_freiburg1_desk")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(ROOT / "scripts")
    reference = importlib.import_module("command_reference")
    page = Page(tmp_path)
    for command in reference.commands():
        for line in command.text_and_example()[1]:
            if line == "orbslam2py run 0 --sensor mono --settings my.yaml":
                continue  # needs a camera
            if line.startswith(("orbslam2py run realsense:", "orbslam2py run ros2:")):
                continue  # needs a camera or a robot
            if "--viewer" in line or line.startswith("orbslam2py view "):
                continue  # stays until Ctrl-C; tests/python/viewer drives it
            if line.startswith("orbslam2py check-imu "):
                continue  # tests/python/cli/test_check_imu.py, on recordings that have an IMU
            if line.startswith("orbslam2py map "):
                continue  # tests/python/cli/test_map_files.py, on maps that are long enough
            more = "" if line.split()[1] == "demo" else SHORTER.get(line.split()[1], "")
            code, printed = page.shell(f"{line} {more}")
            assert code == 0, f"{line}\n{printed}"


@pytest.mark.parametrize("path", documents(), ids=lambda p: str(p.relative_to(ROOT)))
def test_every_block_says_what_it_is(path: Path) -> None:
    known = SHOWN | SHELL | {"python"}
    unknown = [block.place for block in blocks_of(path) if block.language not in known]
    assert not unknown, f"give these blocks a language; ```text for output: {unknown}"


def test_all_others_run() -> None:
    """What is not run is a short list, each for a reason that is known here."""
    reasons = {
        block.place: block.mark("not run")
        for path in documents()
        for block in blocks_of(path)
        if block.mark("not run") is not None
    }
    assert set(reasons.values()) <= NOT_RUN, reasons
    assert len(reasons) <= 32, reasons
    assert not os.environ.get("ORBSLAM2PY_VOCABULARY"), "the documents name the vocabulary"
