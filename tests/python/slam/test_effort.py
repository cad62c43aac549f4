# SPDX-License-Identifier: BSD-3-Clause
"""How often frames become keyframes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.slam.effort import Effort
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

SENSORS = ("mono", "stereo", "rgbd")


@cache
def corridor(sensor: str, *, noisy: bool = False) -> SyntheticSequence:
    noise = {"noise": 4.0, "depth_noise": 0.003 if sensor == "rgbd" else 0.0} if noisy else {}
    return SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor=sensor, size=(320, 240), frames=70, pace=2, **noise
        )
    )


@cache
def run(sensor: str, effort: Effort, *, noisy: bool = False, **options: bool) -> orb.System:
    sequence = corridor(sensor, noisy=noisy)
    with orb.System(sequence.settings, sensor, effort=effort, **options) as slam:  # type: ignore[arg-type]
        for frame in sequence:
            slam.track(frame.images, frame.timestamp)
        assert slam.wait_until_idle(20)
    return slam


def n_keyframes(slam: orb.System) -> int:
    return sum(there.n_keyframes for there in slam.maps)


@pytest.mark.parametrize("sensor", SENSORS)
def test_less_effort_makes_fewer_keyframes(sensor: str) -> None:
    efforts = (Effort.FAST, Effort.NORMAL, Effort.THOROUGH)
    fast, normal, thorough = (run(sensor, effort, deterministic=True) for effort in efforts)
    assert n_keyframes(fast) < n_keyframes(normal) == n_keyframes(thorough)
    for slam in (fast, normal, thorough):
        assert not slam.trajectory().lost.any()


@pytest.mark.parametrize("effort", list(Effort))
def test_with_one_camera_threads_make_the_map_of_the_deterministic_mode(effort: Effort) -> None:
    """Every frame is in turn, and waits for the mapper."""
    threads = run("mono", effort, wait_for_mapping=True).trajectory()
    inline = run("mono", effort, deterministic=True).trajectory()
    np.testing.assert_array_equal(threads.T_wc, inline.T_wc)


@pytest.mark.parametrize("sensor", SENSORS)
def test_more_effort_errs_less_from_frame_to_frame(sensor: str) -> None:
    """The map is the same; every frame is matched with it again."""
    sequence = corridor(sensor, noisy=True)
    truth = np.array([sequence.T_wc(i) for i in range(len(sequence))])
    errors = []
    for effort in (Effort.NORMAL, Effort.THOROUGH):
        path = run(sensor, effort, noisy=True, deterministic=True).trajectory()
        T_wc = truth[path.indices]
        scale = np.linalg.norm(np.ptp(T_wc[:, :3, 3], axis=0))
        scale /= np.linalg.norm(np.ptp(path.positions, axis=0))
        steps = np.linalg.inv(path.T_wc[:-1]) @ path.T_wc[1:]
        true_steps = np.linalg.inv(T_wc[:-1]) @ T_wc[1:]
        off = scale * steps[:, :3, 3] - true_steps[:, :3, 3]
        errors.append(float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))
    assert errors[1] < errors[0]


@pytest.mark.parametrize("effort", ["slow", "", 1, None])
def test_unknown_effort_is_refused(effort: object) -> None:
    with pytest.raises(orb.SettingsError, match="give one of fast, light, normal, thorough"):
        orb.System("tum1", "rgbd", effort=effort)  # type: ignore[arg-type]
