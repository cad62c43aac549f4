# SPDX-License-Identifier: BSD-3-Clause
"""The page's process: ends with the run's, whatever ends it; the run continues without it."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor, StateError, System, TrackingState
from orbslam2py.runs.control import RunControl
from orbslam2py.viewer import LiveView, Publisher
from orbslam2py.viewer.process.channel import Channel
from support.small_sequences import new_system, play
from support.viewer_pages import wait_until

pytestmark = pytest.mark.watchdog(200)
pytest.importorskip("viser", reason="the viewer's extra is not installed")


def is_running(process: int) -> bool:
    """Whether there is such a process that has not ended."""
    try:
        status = Path(f"/proc/{process}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] not in "ZX"


def is_served(address: str) -> bool:
    """Whether the page can be opened."""
    try:
        with urllib.request.urlopen(address, timeout=30) as answer:
            return bool(answer.status == 200)
    except (urllib.error.URLError, ConnectionError):
        return False


@pytest.fixture
def system() -> Iterator[System]:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        yield system


@pytest.fixture
def view() -> Iterator[LiveView]:
    view = LiveView(port=0)
    yield view
    view.stop()


def shared_memory() -> set[str]:
    """Names of shared memory on this computer, but for locks: tests beside this one have such."""
    folder = Path("/dev/shm")
    if not folder.is_dir():
        return set()
    return {path.name for path in folder.iterdir() if not path.name.startswith("sem.mp-")}


def n_open_files() -> int:
    """File descriptors of this process."""
    return sum(1 for _ in Path("/proc/self/fd").iterdir())


def test_nothing_is_left_behind(system: System) -> None:
    before, threads = shared_memory(), threading.active_count()
    descriptors = n_open_files()
    view = LiveView(port=0)
    view.attach(system)
    process = view.process_id
    with Publisher(system, [view], frame_rate=1e6):
        play(system, 5)
        assert is_served(view.address)
    assert is_served(view.address)  # it stays until it is stopped
    view.stop()
    view.stop()
    assert not is_running(process)
    assert not is_served(view.address)
    assert shared_memory() <= before
    assert threading.active_count() == threads
    assert n_open_files() == descriptors


def test_the_page_gives_way_to_tracking_and_ignores_ctrl_c(view: LiveView) -> None:
    assert os.getpriority(os.PRIO_PROCESS, view.process_id) >= 10
    os.kill(view.process_id, signal.SIGINT)
    assert is_served(view.address)
    assert is_running(view.process_id)


def test_when_it_is_killed_the_run_goes_on_with_one_warning(
    system: System, view: LiveView, caplog: pytest.LogCaptureFixture
) -> None:
    view.attach(system)
    with caplog.at_level(logging.WARNING), Publisher(system, [view], frame_rate=1e6):
        play(system, 5)
        os.kill(view.process_id, signal.SIGKILL)
        records = play(system, 20, first=5)
    view.tell_end("The run has ended.")
    view.wait()  # for what is gone already
    assert all(record.state is TrackingState.OK for record in records)
    said = [record.getMessage() for record in caplog.records]
    assert said == [
        "the viewer stopped: its process was ended by SIGKILL; the run continues without it"
    ]


def test_when_it_is_killed_a_run_that_stands_still_goes_on(system: System, view: LiveView) -> None:
    control = RunControl()
    view.attach(system, control=control)
    with Publisher(system, [view]):
        play(system, 2)
        control.pause()
        os.kill(view.process_id, signal.SIGKILL)
        wait_until(lambda: not control.paused, "a run that goes on")


def test_it_goes_on_although_the_publisher_noticed_first(
    system: System, view: LiveView, monkeypatch: pytest.MonkeyPatch
) -> None:
    control = RunControl()
    left_out = threading.Event()
    end_in_its_thread = view._companion._on_end

    def end_late() -> None:
        left_out.wait(60)
        end_in_its_thread()

    monkeypatch.setattr(view._companion, "_on_end", end_late)
    view.attach(system, control=control)
    with Publisher(system, [view], frame_rate=1e6) as publisher:
        play(system, 2)
        control.pause()
        os.kill(view.process_id, signal.SIGKILL)
        play(system, 2, first=2)
        wait_until(lambda: not publisher._works(), "a publisher without watchers")
        left_out.set()
        wait_until(lambda: not control.paused, "a run that goes on")


def test_a_pause_that_was_its_last_wish_is_ended(system: System, view: LiveView) -> None:
    control = RunControl()
    view.attach(system, control=control)
    os.kill(view.process_id, signal.SIGKILL)
    assert view._companion.ended.wait(30)
    view._companion._answer(1, "pause", ())
    assert not control.paused


def test_one_that_hangs_delays_nobody_and_is_given_up(
    system: System,
    view: LiveView,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("orbslam2py.viewer.process.companion._PATIENCE", 2)
    view.attach(system)
    with caplog.at_level(logging.WARNING), Publisher(system, [view], frame_rate=1e6):
        play(system, 2)
        os.kill(view.process_id, signal.SIGSTOP)
        records = play(system, 30, first=2)
    assert all(record.state is TrackingState.OK for record in records)
    assert "the viewer stopped: its process does not answer" in caplog.text
    wait_until(lambda: not is_running(view.process_id), "its end")


def test_its_end_while_it_starts_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py.viewer.process.companion._CODE", "raise SystemExit(3)")
    with pytest.raises(StateError, match="could not be started: its process has ended"):
        LiveView(port=0)


def test_warnings_of_the_page_are_told_here(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        LiveView(host="0.0.0.0", port=0).stop()
    said = [record for record in caplog.records if record.name == "orbslam2py.viewer.server"]
    assert len(said) == 1
    assert "everyone who reaches this computer over the network" in said[0].getMessage()


_RUN = """
import os, sys, time
sys.path.insert(0, sys.argv[1])
from orbslam2py import Sensor
from orbslam2py.viewer import LiveView, Publisher
from support.small_sequences import new_system, play
with new_system(Sensor.RGBD, deterministic=True) as system:
    view = LiveView(port=0)
    copy = os.fork()  # it keeps a copy of what leads to the page
    if not copy:
        time.sleep(60)
        os._exit(0)
    view.attach(system)
    with Publisher(system, [view]):
        print(view.process_id, copy, flush=True)
        while True:
            play(system, 10)
            system.reset()
"""


def test_when_the_run_is_killed_the_page_ends_within_seconds() -> None:
    support = str(Path(__file__).parent.parent)
    with subprocess.Popen(
        [sys.executable, "-c", _RUN, support], stdout=subprocess.PIPE, text=True
    ) as run:
        assert run.stdout is not None
        process, copy = map(int, run.stdout.readline().split())
        assert is_running(process)
        run.kill()
        run.wait()
        wait_until(lambda: not is_running(process), "the end of the page", patience=10.0)
        os.kill(copy, signal.SIGKILL)


def test_arrays_arrive_as_they_were_sent() -> None:
    import socket  # noqa: PLC0415

    ends = [Channel(end) for end in socket.socketpair()]
    large = np.arange(3_000_000)
    sent = ("name", large, np.zeros((0, 3)), large[::2], {"a": np.eye(3, dtype=np.float32)})
    thread = threading.Thread(target=ends[0].send, args=sent)
    thread.start()
    received = ends[1].receive()
    thread.join()
    assert received is not None
    for before, after in zip(sent[1:4], received[1:4], strict=True):
        assert np.array_equal(before, after)
        assert before.dtype == after.dtype
    assert np.array_equal(received[4]["a"], np.eye(3))
    ends[0].close()
    assert ends[1].receive() is None
    with pytest.raises(OSError):
        ends[1].send("nobody")
    ends[1].close()
