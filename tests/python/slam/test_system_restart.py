# SPDX-License-Identifier: BSD-3-Clause
"""What a reset and a shutdown owe the user."""

from __future__ import annotations

import threading

import pytest

from orbslam2py import Sensor
from support.small_sequences import new_system, play


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_a_sequence_can_be_played_again_after_a_reset(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 5)
        system.reset()
        play(system, 5)
        assert system.n_resets == 1
        assert [len(trajectory) for trajectory in system.trajectories()] == [5, 5]


def test_keyframes_that_wait_in_localization_mode_are_processed_at_shutdown() -> None:
    with new_system(Sensor.STEREO) as system:
        play(system, 3)
        system.wait_until_idle()
        system.localization_mode = True
        play(system, 1, first=3)
        # As if mapping had been paused before its turn came.
        processed: list[int] = []
        system.pipeline.back_end.mapping.worker._step = processed.append
        system.pipeline.back_end.mapping.worker.submit(7)
        assert system.pipeline.back_end.mapping.worker.n_waiting == 1
    assert processed == [7]


def test_trajectories_may_be_read_while_frames_are_recorded() -> None:
    lengths: list[int] = []
    with new_system(Sensor.RGBD) as system:
        done = threading.Event()

        def read() -> None:
            while not done.is_set():
                trajectory = system.trajectory()
                lengths.append(len(trajectory))
                assert len(trajectory.T_wc) == len(trajectory.timestamps)

        readers = [threading.Thread(target=read) for _ in range(2)]
        for reader in readers:
            reader.start()
        play(system, 15)
        system.reset()
        play(system, 15)
        done.set()
        for reader in readers:
            reader.join()
        assert [len(trajectory) for trajectory in system.trajectories()] == [15, 15]
    assert lengths
