# SPDX-License-Identifier: BSD-3-Clause
"""What of a change of motion is beyond the usual, and what a pose is told with because of it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from orbslam2py import Sensor
from orbslam2py.slam.config import AcceptanceConfig, TrackingConfig
from orbslam2py.slam.state import Motion, MotionInnovation
from support.tracking_scene import FakeCore, FakeFrame, Scene, pose

LIMITS = AcceptanceConfig()
ORDINARY = np.array([0.01, 0, 0, 0, 0.1, 0])


def used_to(change: np.ndarray, times: int = 10) -> MotionInnovation:
    usual = MotionInnovation()
    for _ in range(times):
        usual = usual.after(change, LIMITS)
    return usual


def test_nothing_is_unusual_before_a_few_changes_are_known() -> None:
    usual = used_to(ORDINARY, LIMITS.changes_seen - 1)
    assert usual.excess(100 * ORDINARY, LIMITS) is None
    usual = usual.after(ORDINARY, LIMITS)
    assert usual.excess(100 * ORDINARY, LIMITS) is not None


def test_up_to_some_times_the_usual_change_nothing_is_beyond_it() -> None:
    usual, most = used_to(ORDINARY), LIMITS.usual_changes
    assert usual.excess(0 * ORDINARY, LIMITS) is None
    assert usual.excess(0.99 * most * ORDINARY, LIMITS) is None
    np.testing.assert_allclose(usual.excess((most + 1) * ORDINARY, LIMITS), ORDINARY)


@pytest.mark.parametrize("larger", [slice(0, 3), slice(3, 6)])
def test_a_turn_or_a_way_alone_is_enough(larger: slice) -> None:
    change = ORDINARY.copy()
    change[larger] *= 8
    share = 1 - LIMITS.usual_changes / 8
    np.testing.assert_allclose(used_to(ORDINARY).excess(change, LIMITS), share * change)


def test_after_a_rest_any_change_is_beyond_the_usual() -> None:
    np.testing.assert_array_equal(used_to(0 * ORDINARY).excess(ORDINARY, LIMITS), ORDINARY)


def test_a_camera_that_was_at_rest_from_the_first_image_on_is_got_used_to() -> None:
    usual = used_to(0 * ORDINARY)
    for _ in range(30):
        usual = usual.after(ORDINARY, LIMITS)
    assert usual.excess(ORDINARY, LIMITS) is None


def test_one_sudden_change_does_not_make_the_next_usual() -> None:
    usual = used_to(ORDINARY)
    usual = usual.after(1000 * ORDINARY, LIMITS)
    beyond = usual.excess(1000 * ORDINARY, LIMITS)
    assert beyond is not None
    assert np.linalg.norm(beyond) > 990 * np.linalg.norm(ORDINARY)


def test_a_camera_that_shakes_from_now_on_is_got_used_to() -> None:
    usual = used_to(ORDINARY)
    for _ in range(30):
        usual = usual.after(20 * ORDINARY, LIMITS)
    assert usual.excess(20 * ORDINARY, LIMITS) is None


_CHANGES = arrays(np.float64, 6, elements=st.floats(-10, 10))


@given(st.lists(_CHANGES, max_size=8), _CHANGES)
def test_what_is_beyond_points_along_the_change_and_is_no_longer(
    seen: list[np.ndarray], change: np.ndarray
) -> None:
    usual = MotionInnovation()
    for one in seen:
        usual = usual.after(one, LIMITS)
    beyond = usual.excess(change, LIMITS)
    if beyond is None:
        return
    assert np.isfinite(beyond).all()
    assert np.linalg.norm(beyond) <= np.linalg.norm(change) * (1 + 1e-12)
    np.testing.assert_allclose(
        np.outer(beyond, change), np.outer(change, beyond), atol=1e-9 * np.dot(change, change)
    )


def test_the_change_is_from_the_pose_to_where_the_motion_led() -> None:
    motion: Any = Motion()
    frames = [FakeFrame(i) for i in range(3)]
    for frame, x in zip(frames, (0.0, 1.0, 1.5), strict=True):
        frame.T_cw = pose(x)
    assert motion.innovation(frames[0]) is None
    for frame in frames[:2]:
        motion = motion.after(frame)
    np.testing.assert_allclose(motion.innovation(frames[2]), [0, 0, 0, 0.5, 0, 0])


def test_a_pose_far_from_where_the_motion_led_may_be_a_mistake(
    core: FakeCore, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = Scene(Sensor.STEREO, core, TrackingConfig(local_map_inliers=10), evidence=LIMITS)
    scene.run(40)
    usual = scene.track().estimate.covariance
    optimize = core.optimize_pose

    def elsewhere(frame: FakeFrame) -> SimpleNamespace:
        frame.T_cw = pose(0.5)
        return optimize(frame)

    monkeypatch.setattr(core, "optimize_pose", elsewhere)
    sudden = scene.track().estimate.covariance
    scene.run(1)  # stops again
    calm = scene.track().estimate.covariance
    assert usual is not None
    assert sudden is not None
    assert calm is not None
    added = np.zeros((6, 6))
    added[3, 3] = LIMITS.mistaken_share * 0.5**2
    np.testing.assert_allclose(sudden - usual, added, atol=1e-9)
    np.testing.assert_allclose(calm, usual)
