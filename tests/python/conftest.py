# SPDX-License-Identifier: BSD-3-Clause
"""For all tests: no hang, no thread left behind, the extra data."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from orbslam2py._files import atomic_write
from orbslam2py.runs import outputs
from orbslam2py.runs.report_page.markup import Markup
from orbslam2py.runs.report_page.page import PageKind, whole_page
from support.bytecode import keep_bytecode
from support.data import shared_folder
from support.rendered_once import render_once
from support.watchdog import watchdog, worker_threads

keep_bytecode()
# Programs that are started in the background may be told to ignore Ctrl-C, and so is what they
# start: tests press it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# As the command line does (test_plain_messages.py): OpenCV's FFmpeg reads it at the first video,
# which another test may open.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
if "PYTEST_XDIST_WORKER" in os.environ:  # whoever has other workers beside it has one core
    os.environ.setdefault("OMP_NUM_THREADS", "1")
render_once()
# No test cuts the power: nothing need be on the disk before it goes on.
os.fsync = lambda fd: None

#: Files that take longest, and folders of such: with several workers they come first, so that no
#: worker is left alone with one at the end (with ``--no-loadscope-reorder``).
LONGEST_FIRST = (
    "docs/test_snippets.py",
    "slam/test_loops.py",
    "package/test_accuracy.py",
    "package/test_calibration_matrix.py",
    "viewer",
    "batches",
    "slam",
)


PNG_BEGIN = b"\x89PNG\r\n\x1a\n"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; the order within a file stays."""
    here = Path(__file__).parent

    def rank(item: pytest.Item) -> int:
        place = item.path.relative_to(here).as_posix()
        ranks = (i for i, name in enumerate(LONGEST_FIRST) if place.startswith(name))
        return next(ranks, len(LONGEST_FIRST))

    items.sort(key=rank)


@pytest.fixture(autouse=True)
def _no_hang_and_no_thread_left(request: pytest.FixtureRequest) -> Iterator[None]:
    """Serve ``@pytest.mark.watchdog(seconds)``: no test hangs, and none leaves a thread behind."""
    mark = request.node.get_closest_marker("watchdog")
    if mark is None:
        yield
        return
    before = worker_threads()
    with watchdog(*mark.args):
        yield
        if worker_threads() != before:
            gc.collect()  # ends those of a system that nobody holds; slow, hence not every time
        assert worker_threads() == before


@pytest.fixture(autouse=True)
def _no_picture_of_a_run(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out what takes longest in a short run, but with ``@pytest.mark.picture``."""
    if request.node.get_closest_marker("picture") is None:
        monkeypatch.setattr(outputs, "draw_run", lambda path, *_: path.write_bytes(PNG_BEGIN))


def _write_empty_page(path: Path, *_: object) -> None:
    with atomic_write(path) as stream:
        stream.write(whole_page("", "", [], Markup(""), Markup(""), kind=PageKind.RUN))


@pytest.fixture(autouse=True)
def _no_page_of_a_run(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out the page as well, a quarter of a short run, but with ``@pytest.mark.page``."""
    if request.node.get_closest_marker("page") is None:
        monkeypatch.setattr(outputs, "write_report_page", _write_empty_page)


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the extra data (photographs, real sequences); skips the test without it.

    Mark the test with ``@pytest.mark.shared`` as well, so that it can be left out by name.
    """
    folder = shared_folder()
    if not folder.is_dir():
        pytest.skip(f"no extra data in {folder}: set ORBSLAM2PY_SHARED to its folder")
    return folder
