# SPDX-License-Identifier: BSD-3-Clause
"""What is asked of frames after the camera was found again, or a map began."""

from __future__ import annotations

from typing import Any

from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.pose_search.probation_period import ProbationPeriod
from support.tracking_scene import FakeFrame

LIMITS = TrackingConfig()
SECOND = 20
FEW, MANY = LIMITS.local_map_inliers, LIMITS.local_map_inliers_after_relocalization


def frame(frame_id: int) -> Any:
    return FakeFrame(frame_id)


def period(*, has_depth: bool) -> ProbationPeriod:
    return ProbationPeriod(SECOND, LIMITS, has_depth=has_depth)


def asked(proving: ProbationPeriod, *ids: int) -> list[int]:
    return [proving.inliers_asked(frame(number)) for number in ids]


def test_the_first_map_of_a_single_camera_proves_itself_for_a_second() -> None:
    assert asked(period(has_depth=False), 1, SECOND - 1, SECOND) == [MANY, MANY, FEW]
    assert asked(period(has_depth=True), 1, SECOND - 1, SECOND) == [FEW, FEW, FEW]


def test_found_elsewhere_it_proves_itself_with_every_sensor() -> None:
    for has_depth in (False, True):
        proving = period(has_depth=has_depth)
        proving.lose()
        proving.found_again(frame(100))
        assert asked(proving, 100, 119, 120) == [MANY, MANY, FEW]


def test_found_where_it_was_expected_it_goes_on_as_before_the_loss() -> None:
    proving = period(has_depth=False)
    proving.lose()
    proving.found_again(frame(100), where_expected=True)
    assert asked(proving, 100) == [FEW]
    proving.found_again(frame(200))
    proving.lose()
    proving.found_again(frame(205), where_expected=True)
    assert asked(proving, 219, 220) == [MANY, FEW], "the second since frame 200 goes on"


def test_a_map_that_begins_later_proves_itself_without_depth_alone() -> None:
    for has_depth, expected in ((False, [MANY, FEW]), (True, [FEW, FEW])):
        proving = period(has_depth=has_depth)
        proving.map_begun(100)
        assert asked(proving, 119, 120) == expected


def test_a_map_that_has_just_begun_is_no_camera_that_was_just_found() -> None:
    proving = period(has_depth=True)
    last = 100 + LIMITS.frames_after_relocalization - 1
    proving.found_again(frame(100))
    assert proving.has_just_begun(frame(last))
    assert proving.was_just_found(frame(last))
    assert not proving.has_just_begun(frame(last + 1))
    assert not proving.was_just_found(frame(last + 1))
    proving.map_begun(100)
    assert proving.has_just_begun(frame(last))
    assert not proving.was_just_found(frame(last))


def test_a_reset_forgets_it_all() -> None:
    proving = period(has_depth=False)
    proving.found_again(frame(100))
    proving.reset()
    assert asked(proving, SECOND) == [FEW]
    assert not proving.has_just_begun(frame(100))
