# SPDX-License-Identifier: BSD-3-Clause
"""How often frames become keyframes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.slam.effort import Effort
from orbslam2py.slam.frame_source import track_images
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

SENSORS = ("mono", "stereo", "rgbd")


@cache
def corridor(sensor: str) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="corridor", sensor=sensor, size=(320, 240), frames=70, pace=2)
    )


def run(sensor: str, effort: Effort | str, **options: bool) -> orb.System:
    sequence = corridor(sensor)
    with orb.System(sequence.settings, sensor, effort=effort, **options) as slam:  # type: ignore[arg-type]
        for frame in sequence:
            track_images(slam, frame.images, frame.timestamp)
        assert slam.wait_until_idle(20)
    return slam


def n_keyframes(slam: orb.System) -> int:
    return sum(there.n_keyframes for there in slam.maps)


@pytest.mark.parametrize("sensor", SENSORS)
def test_less_effort_makes_fewer_keyframes(sensor: str) -> None:
    fast, normal, thorough = (run(sensor, effort, deterministic=True) for effort in Effort)
    # One more or less is culled; with one camera normal and thorough differ by little.
    assert n_keyframes(fast) < n_keyframes(normal) <= n_keyframes(thorough) + 1
    for slam in (fast, normal, thorough):
        assert not slam.trajectory().lost.any()


@pytest.mark.parametrize("sensor", SENSORS)
def test_with_every_frame_in_turn_threads_make_the_map_of_the_deterministic_mode(
    sensor: str,
) -> None:
    threads = run(sensor, "thorough", wait_for_mapping=True).trajectory()
    inline = run(sensor, "thorough", deterministic=True).trajectory()
    np.testing.assert_array_equal(threads.T_wc, inline.T_wc)


@pytest.mark.parametrize("effort", ["slow", "", 1, None])
def test_unknown_effort_is_refused(effort: object) -> None:
    with pytest.raises(orb.SettingsError, match="give one of fast, normal, thorough"):
        orb.System("tum1", "rgbd", effort=effort)  # type: ignore[arg-type]
