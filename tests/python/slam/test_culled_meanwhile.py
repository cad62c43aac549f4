# SPDX-License-Identifier: BSD-3-Clause
"""Local mapping culls keyframes while others look at them: not to be there is no error."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.slam.state import LastKnownPose
from support.small_sequences import new_system, play

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture(scope="module")
def slam() -> Iterator[System]:
    with new_system(Sensor.MONOCULAR, deterministic=True) as system:
        play(system, 70)
        yield system


@pytest.fixture
def culled(slam: System) -> int:
    slam_map = slam.pipeline.back_end.map
    alive = slam_map.keyframe_ids().tolist()
    gone = set(range(max(alive))) - set(alive)
    assert gone, "nothing was culled"
    return max(gone)


def test_it_has_no_neighbours_and_no_frame(slam: System, culled: int) -> None:
    slam_map = slam.pipeline.back_end.map
    assert slam_map.best_neighbours(culled, 10).tolist() == []
    assert slam_map.frame_of(culled) == -1
    alive = slam_map.living(culled)
    assert slam_map.best_neighbours(alive, 10).tolist() != []
    assert slam_map.frame_of(alive) == slam_map.keyframe_frame(alive).id


def test_it_looks_like_no_other(slam: System, culled: int) -> None:
    back_end = slam.pipeline.back_end
    assert core.find_loop_candidates(back_end.keyframe_index, back_end.map, culled, 0.0) == []


def test_tracking_goes_on_without_it(slam: System, culled: int) -> None:
    tracking = slam.pipeline.tracking
    frame = core.TrackedFrame(tracking.motion.last.features)
    state = replace(tracking._state, reference_keyframe=culled)
    assert not tracking._search.by_keyframes(frame, state, 10).found


def test_the_place_of_a_loss_is_its_parent_s(slam: System, culled: int) -> None:
    slam_map = slam.pipeline.back_end.map
    last = slam.pipeline.tracking.motion.last
    named = LastKnownPose(last, None, culled).keyframes(slam_map)
    assert named[0] == slam_map.living(culled)
    assert culled not in named
