# SPDX-License-Identifier: BSD-3-Clause
"""A velocity predicts motions over any interval, not from one image to the next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.slam.state import Motion, Velocity

TENTH_TURN = core.Pose.exp([0.0, 0.1, 0.0, 0.0, 0.0, 0.0])


def frame(seconds: float, T_cw: core.Pose | None = None) -> Any:
    anchors: list[Any] = []
    return SimpleNamespace(
        id=round(10 * seconds),
        timestamp=seconds,
        T_cw=T_cw,
        big_change=0,
        share_anchor=anchors.append,
    )


def turning(seconds: float) -> core.Pose:
    """One radian a second about y, and a metre a second along the camera's x."""
    return core.Pose.exp([0.0, seconds, 0.0, seconds, 0.0, 0.0])


def test_the_interval_that_was_measured_gives_the_same_motion() -> None:
    assert Velocity(TENTH_TURN, 0.1).over(0.3 - 0.2) is TENTH_TURN


def test_twice_the_interval_gives_the_motion_twice() -> None:
    twice = Velocity(turning(0.1), 0.1).over(0.2)
    np.testing.assert_allclose(twice.matrix, (turning(0.1) @ turning(0.1)).matrix, atol=1e-12)


def test_backwards_in_time_the_motion_is_inverse() -> None:
    back = Velocity(turning(0.1), 0.1).over(-0.1)
    np.testing.assert_allclose(back.matrix, turning(0.1).inverse().matrix, atol=1e-12)
    # Frames before the start are tracked backwards: interval and motion are negative.
    again = Velocity(turning(0.1).inverse(), -0.1).over(-0.2)
    np.testing.assert_allclose(again.matrix, turning(0.2).inverse().matrix, atol=1e-12)


def test_nobody_knows_a_velocity_for_longer_than_a_second() -> None:
    velocity = Velocity(turning(0.1), 0.1)
    np.testing.assert_allclose(velocity.over(60.0).matrix, velocity.over(1.0).matrix)


def test_a_loop_scales_the_translation() -> None:
    scaled = Velocity(turning(0.1), 0.1).scaled(3.0)
    np.testing.assert_allclose(scaled.step.translation, 3 * turning(0.1).translation)
    np.testing.assert_allclose(scaled.step.quaternion_xyzw, turning(0.1).quaternion_xyzw)
    assert scaled.seconds == 0.1


@pytest.mark.parametrize("dropped", [0, 1, 4])
def test_dropped_images_do_not_change_the_prediction(dropped: int) -> None:
    motion = Motion(frame(0.0, turning(0.0)), None, is_tracked=True).after(frame(0.1, turning(0.1)))
    later = frame(0.1 * (2 + dropped))
    motion.predict(later)
    np.testing.assert_allclose(later.T_cw.matrix, turning(later.timestamp).matrix, atol=1e-12)
    tangent = motion.innovation(later)
    assert tangent is not None
    np.testing.assert_allclose(tangent, 0, atol=1e-12)
