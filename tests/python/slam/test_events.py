# SPDX-License-Identifier: BSD-3-Clause
"""Callbacks: what they are told, in which thread, and that their failures stay theirs."""

from __future__ import annotations

import logging
import threading
from typing import Any

import numpy as np
import pytest

from orbslam2py import (
    Callbacks,
    KeyframeAdded,
    MapChangeCause,
    MapChanged,
    Relocalized,
    Sensor,
    StateError,
    System,
    TrackingLost,
    TrackingState,
)
from support.small_sequences import black, new_system, play, track

pytestmark = pytest.mark.watchdog(60)


class Listener:
    """Takes note of everything, and of the threads it is called in."""

    def __init__(self) -> None:
        self.events: list[Any] = []
        self.threads: set[str] = set()
        self.callbacks = Callbacks(
            on_loop=self,
            on_keyframe=self,
            on_lost=self,
            on_relocalized=self,
            on_map_change=self,
        )

    def __call__(self, event: object) -> None:
        self.threads.add(threading.current_thread().name)
        self.events.append(event)

    def of(self, kind: type) -> list[Any]:
        return [event for event in self.events if type(event) is kind]


@pytest.mark.watchdog(20)
def test_waiting_in_a_callback_of_the_deterministic_mode_is_refused() -> None:
    """The image waits for the callback, which cannot wait for the image."""
    refused: list[str] = []

    def waits(_: object) -> None:
        for wait in (system.wait_until_idle, lambda: system.run([])):
            with pytest.raises(StateError) as raised:
                wait()
            refused.append(str(raised.value))

    with new_system(
        Sensor.RGBD, callbacks=Callbacks(on_keyframe=waits), deterministic=True
    ) as system:
        track(system, 0)
        assert system.wait_until_idle(5)
    assert len(refused) == 2
    assert all("within a callback" in text for text in refused)


@pytest.mark.parametrize("deterministic", [False, True])
def test_keyframes_losses_and_recoveries_are_told(deterministic: bool) -> None:
    listener = Listener()
    with new_system(
        Sensor.RGBD,
        callbacks=listener.callbacks,
        deterministic=deterministic,
        wait_for_mapping=True,
    ) as system:
        play(system, 60, settled=True)
        assert system.n_keyframes > 5, "a smaller map would be given up"
        lost = track(system, 60, shown=black(Sensor.RGBD))
        assert lost.state is TrackingState.LOST
        track(system, 61, shown=black(Sensor.RGBD))
        found = track(system, 62)
        assert found.state is TrackingState.OK
    added = listener.of(KeyframeAdded)
    assert [event.keyframe for event in added] == sorted({event.keyframe for event in added})
    assert len(added) >= system.n_keyframes
    assert all(event.T_wc.shape == (4, 4) and event.n_map_points > 0 for event in added)
    assert [event.frame_id for event in listener.of(TrackingLost)] == [60], "once, not per frame"
    assert listener.of(TrackingLost)[0].reason == str(lost.reason)
    (relocalized,) = listener.of(Relocalized)
    assert relocalized.frame_id == 62
    np.testing.assert_array_equal(relocalized.T_wc, found.T_wc)
    expected = threading.main_thread().name if deterministic else "callbacks"
    assert listener.threads == {expected}


def test_a_reset_is_told() -> None:
    listener = Listener()
    with new_system(Sensor.STEREO, callbacks=listener.callbacks) as system:
        play(system, 3)
        system.reset()
        track(system, 3)
    assert listener.of(MapChanged) == [MapChanged(0, MapChangeCause.RESET)]
    assert {event.map_index for event in listener.of(KeyframeAdded)} == {0, 1}


@pytest.mark.parametrize("deterministic", [False, True])
def test_a_failing_callback_is_logged_and_harmless(
    caplog: pytest.LogCaptureFixture, deterministic: bool
) -> None:
    def fails(_: KeyframeAdded) -> None:
        raise ZeroDivisionError("users make mistakes")

    with (
        caplog.at_level(logging.ERROR, logger="orbslam2py"),
        new_system(
            Sensor.RGBD, callbacks=Callbacks(on_keyframe=fails), deterministic=deterministic
        ) as system,
    ):
        assert play(system, 5)[-1].state is TrackingState.OK
    assert "a callback failed on KeyframeAdded" in caplog.text
    assert "users make mistakes" in caplog.text


def test_callbacks_may_use_the_system() -> None:
    seen: list[int] = []
    systems: list[System] = []

    def looks(_: KeyframeAdded) -> None:
        system = systems[0]
        seen.append(len(system.map_snapshot().keyframe_ids))
        system.reset()
        system.shutdown(drain=False)

    with new_system(Sensor.RGBD, callbacks=Callbacks(on_keyframe=looks)) as system:
        systems.append(system)
        track(system, 0)
        system.pipeline.back_end.events.worker.wait_until_idle(20)
    systems.clear()
    assert seen == [1]


def test_a_slow_callback_does_not_delay_tracking() -> None:
    release = threading.Event()

    def waits(_: KeyframeAdded) -> None:
        release.wait(20)

    with new_system(Sensor.RGBD, callbacks=Callbacks(on_keyframe=waits)) as system:
        assert play(system, 10)[-1].state is TrackingState.OK
        assert system.wait_until_idle(20), "mapping is not delayed either"
        release.set()
