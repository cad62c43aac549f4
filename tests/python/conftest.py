# SPDX-License-Identifier: BSD-3-Clause
"""What the tests share."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

import pytest

from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.system import System
from support.data import shared_folder
from support.interleaving import LIMIT, Stage
from support.small_sequences import new_system, play
from support.watchdog import watchdog, worker_threads


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
        gc.collect()
        assert worker_threads() == before


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of the extra data (photographs, real sequences); skips the test without it.

    Mark the test with ``@pytest.mark.shared`` as well, so that it can be left out by name.
    """
    folder = shared_folder()
    if not folder.is_dir():
        pytest.skip(f"no extra data in {folder}: set ORBSLAM2PY_SHARED to its folder")
    return folder


@pytest.fixture
def slam() -> Iterator[System]:
    """A system with a small map whose workers have nothing to do."""
    system = new_system(Sensor.RGBD, wait_for_mapping=True)
    play(system, 30)
    assert system.wait_until_idle(LIMIT)
    assert system.n_keyframes >= 3
    yield system
    system.shutdown(drain=False, timeout=LIMIT)


@pytest.fixture
def stage(monkeypatch: pytest.MonkeyPatch) -> Iterator[Stage]:
    stage = Stage(monkeypatch)
    yield stage
    stage.open_all()
