# SPDX-License-Identifier: BSD-3-Clause
"""Viewers that cannot begin, or are interrupted while they do, leave no process behind."""

from __future__ import annotations

import subprocess
import threading
from typing import Any

import pytest

from orbslam2py import Sensor, StateError, System, Viewer
from orbslam2py.cli.viewing import ViewerOptions, Viewing
from orbslam2py.viewer import LiveView, live
from orbslam2py.viewer.process import companion
from support.small_sequences import new_system, sequence

pytestmark = pytest.mark.watchdog(100)
pytest.importorskip("viser", reason="the viewer's extra is not installed")


@pytest.fixture
def started(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """Processes of pages that were begun."""
    processes: list[subprocess.Popen[bytes]] = []
    start = companion._start

    def noted(*arguments: Any) -> subprocess.Popen[bytes]:
        processes.append(start(*arguments))
        return processes[-1]

    monkeypatch.setattr(companion, "_start", noted)
    return processes


def pressed(*_: Any, **__: Any) -> None:
    raise KeyboardInterrupt


@pytest.fixture(scope="module")
def system() -> Any:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        yield system


@pytest.mark.parametrize("other", [object(), None, "tum1", System])
def test_what_is_no_system_is_refused(other: Any, started: list[subprocess.Popen[bytes]]) -> None:
    with pytest.raises(StateError, match="a viewer shows a System, not"):
        Viewer(other, port=0, open_browser=False)
    assert started == []


def test_what_is_no_path_is_refused(system: System, started: list[subprocess.Popen[bytes]]) -> None:
    truth: Any = [1, 2]
    with pytest.raises(StateError, match=r"truth is a list; give an orb.*Trajectory, or None"):
        Viewer(system, port=0, truth=truth, open_browser=False)
    assert [process.poll() for process in started] == [0]


@pytest.mark.parametrize("name", ["announce", "Publisher"])
def test_an_interrupted_viewer(
    system: System,
    started: list[subprocess.Popen[bytes]],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
) -> None:
    monkeypatch.setattr(live, name, pressed)
    threads = threading.active_count()
    with pytest.raises(KeyboardInterrupt):
        Viewer(system, port=0, open_browser=False)
    assert [process.poll() for process in started] == [0]
    assert system.pipeline.frame_watchers == ()
    assert threading.active_count() == threads


def test_an_interrupted_command(
    started: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live, "announce", pressed)
    options = ViewerOptions(wanted=True, port=0)
    viewing = Viewing(options, sequence(Sensor.RGBD), threading.Event(), in_real_time=False)
    with pytest.raises(KeyboardInterrupt), viewing:
        pass
    assert [process.poll() for process in started] == [0]


def test_a_page_is_of_a_system(started: list[subprocess.Popen[bytes]]) -> None:
    view = LiveView(port=0)
    try:
        with pytest.raises(StateError, match="a viewer shows a System, not None"):
            view.attach(None)  # type: ignore[arg-type]
    finally:
        view.stop()
    assert [process.poll() for process in started] == [0]
