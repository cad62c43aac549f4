# SPDX-License-Identifier: BSD-3-Clause
"""What is required of frames after a relocalization, or after a map began."""

from __future__ import annotations

from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.state import Probation

LIMITS = TrackingConfig()
SECOND = 20
FEW, MANY = LIMITS.local_map_inliers, LIMITS.local_map_inliers_after_relocalization


def required(probation: Probation, *ids: int) -> list[int]:
    return [probation.required_inliers(number, SECOND, LIMITS) for number in ids]


def test_the_first_map_of_a_single_camera_proves_itself_for_a_second() -> None:
    mono, depth = (Probation.of_first_map(has_depth=has) for has in (False, True))
    assert required(mono, 1, SECOND - 1, SECOND) == [MANY, MANY, FEW]
    assert required(depth, 1, SECOND - 1, SECOND) == [FEW, FEW, FEW]


def test_found_elsewhere_it_proves_itself_with_every_sensor() -> None:
    for has_depth in (False, True):
        found = Probation.of_first_map(has_depth=has_depth).lost().relocalized(100)
        assert required(found, 100, 119, 120) == [MANY, MANY, FEW]


def test_found_where_it_was_expected_it_goes_on_as_before_the_loss() -> None:
    first = Probation.of_first_map(has_depth=False).lost().relocalized(100, where_expected=True)
    assert required(first, 100) == [FEW]
    again = first.relocalized(200).lost().relocalized(205, where_expected=True)
    assert required(again, 219, 220) == [MANY, FEW], "the second since frame 200 goes on"


def test_a_map_that_begins_later_proves_itself_without_depth_alone() -> None:
    for has_depth, expected in ((False, [MANY, FEW]), (True, [FEW, FEW])):
        begun = Probation.of_first_map(has_depth=has_depth).map_begun(100, has_depth=has_depth)
        assert required(begun, 119, 120) == expected


def test_a_map_that_has_just_begun_is_no_camera_that_was_just_found() -> None:
    last = 100 + LIMITS.frames_after_relocalization - 1
    found = Probation.of_first_map(has_depth=True).relocalized(100)
    assert found.has_just_begun(last, LIMITS)
    assert found.was_just_found(last, LIMITS)
    assert not found.has_just_begun(last + 1, LIMITS)
    assert not found.was_just_found(last + 1, LIMITS)
    begun = found.map_begun(100, has_depth=True)
    assert begun.has_just_begun(last, LIMITS)
    assert not begun.was_just_found(last, LIMITS)
