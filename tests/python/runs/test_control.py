# SPDX-License-Identifier: BSD-3-Clause
"""A run that another thread holds, steps through, ends, and watches."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterator

import pytest

from orbslam2py import Sensor, StateError, System, run_sequence
from orbslam2py.runs import FrameRow, RunControl, RunOptions, feeds
from orbslam2py.runs.feeds import RecordedFeed
from support.small_sequences import images, sequence

pytestmark = pytest.mark.watchdog(60)

OPTIONS = RunOptions(Sensor.RGBD, max_frames=6)


class Counter:
    """Counts frames, and lets others wait for a number of them."""

    def __init__(self) -> None:
        self.n_frames = 0
        self._condition = threading.Condition()

    def __call__(self, row: FrameRow, system: System) -> None:
        with self._condition:
            self.n_frames += 1
            self._condition.notify_all()

    def wait_for(self, n_frames: int, seconds: float = 30.0) -> bool:
        with self._condition:
            return self._condition.wait_for(lambda: self.n_frames >= n_frames, seconds)


@contextlib.contextmanager
def running(control: RunControl, count: Counter) -> Iterator[threading.Thread]:
    def run() -> None:
        run_sequence(sequence(Sensor.RGBD), OPTIONS, progress=count, control=control)

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield thread
    finally:
        control.stop.set()
        thread.join()


def test_a_paused_run_takes_frames_only_when_it_is_told() -> None:
    control, count = RunControl(), Counter()
    control.pause()
    with running(control, count) as thread:
        control.step()
        assert count.wait_for(1)
        control.step()
        control.step()
        assert count.wait_for(3)
        assert not count.wait_for(4, seconds=0.3)
        assert control.paused
        control.resume()
        assert count.wait_for(6)
        thread.join(30)
        assert not thread.is_alive()
    assert count.n_frames == 6


def test_a_paused_run_can_be_stopped() -> None:
    control, count = RunControl(), Counter()
    control.pause()
    with running(control, count) as thread:
        control.step()
        assert count.wait_for(1)
        control.stop.set()
        thread.join(30)
        assert not thread.is_alive()
    assert count.n_frames == 1


@pytest.mark.parametrize("told", [False, True])
def test_frames_that_become_due_in_a_pause_are_not_dropped(
    told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 100.0
    monkeypatch.setattr(feeds.time, "perf_counter", lambda: now)
    monkeypatch.setattr(feeds.threading.Event, "wait", lambda *_: False)
    feed = RecordedFeed(sequence(Sensor.RGBD), list(range(4)), realtime=True)
    with contextlib.closing(feed.frames(threading.Event())) as frames:
        next(frames)
        now += 1000.0
        if told:
            feed.delay(1000.0)
        assert next(frames).is_dropped != told


def test_who_watches_is_told_before_the_first_frame_and_after_the_end() -> None:
    happened: list[str] = []

    @contextlib.contextmanager
    def watch(system: System) -> Iterator[None]:
        happened.append("begin")
        yield
        image = images(Sensor.RGBD, 0)
        assert image.depth is not None
        with pytest.raises(StateError):  # it has been shut down
            system.track_rgbd(image.image, image.depth, 1e9)
        happened.append("end")

    def progress(row: FrameRow, system: System) -> None:
        happened.append("frame")

    run_sequence(
        sequence(Sensor.RGBD), RunOptions(Sensor.RGBD, max_frames=2), progress=progress, watch=watch
    )
    assert happened == ["begin", "frame", "frame", "end"]
