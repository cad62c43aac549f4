# SPDX-License-Identifier: BSD-3-Clause
"""The covariance that a pose is told with, with the verbs of the core replaced."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py.slam.acceptance import pose_validator
from orbslam2py.slam.config import AcceptanceConfig
from orbslam2py.slam.records import Verdict
from support.tracking_scene import FakeFrame, Scene


@pytest.mark.parametrize(("error", "factor"), [(0.4, 1.0), (0.85, (0.85 / 0.8) ** 2)])
def test_a_pose_is_as_uncertain_as_its_matches_are_off(
    careful: Scene, error: float, factor: float
) -> None:
    usual = careful.track().estimate
    careful.core.match_error = error
    estimate = careful.track().estimate
    assert usual.covariance is not None
    assert estimate.covariance is not None
    assert estimate.evidence is not None
    assert estimate.evidence.verdict is Verdict.STRONG
    assert estimate.covariance[0, 0] == pytest.approx(factor * usual.covariance[0, 0])


def test_where_many_matches_are_accidental_the_uncertainty_grows_faster(careful: Scene) -> None:
    usual = careful.track().estimate
    careful.core.match_error = 2.0
    careful.run(200)  # until that is usual
    estimate = careful.track().estimate
    assert usual.covariance is not None
    assert estimate.covariance is not None
    assert estimate.evidence is not None
    assert estimate.evidence.verdict is Verdict.STRONG
    larger = estimate.covariance[0, 0] / usual.covariance[0, 0]
    assert larger == pytest.approx((2.0 / 0.8 * 2.0 / 1.3) ** 2)


@pytest.mark.parametrize(("n_inliers", "counted"), [(70, 70), (20, 30)])
def test_few_inliers_are_less_certain_than_their_number_says(
    careful: Scene, n_inliers: int, counted: int
) -> None:
    usual = careful.track().estimate
    careful.core.inliers.extend([n_inliers] * 10)  # by whatever way it is searched
    estimate = careful.track().estimate
    assert usual.covariance is not None
    assert estimate.covariance is not None
    assert estimate.n_inliers == n_inliers
    larger = estimate.covariance[0, 0] / usual.covariance[0, 0]
    few = AcceptanceConfig().few_inliers
    # What is stated of the keypoints' noise goes by the number, here in proportion.
    by_number = (1 + (few / counted) ** 4) / (1 + (few / 100) ** 4)
    assert larger == pytest.approx(n_inliers / 100 * by_number)


@pytest.mark.parametrize("n_visible", [3, 600, 1000, 5000])
def test_where_nothing_is_usual_yet_a_pose_is_less_certain(careful: Scene, n_visible: int) -> None:
    """In a map's first frame or in one found again: most where little of what is there is found."""
    usual = careful.track().estimate
    careful.tracking.reset()
    careful.run(1)  # the first frame of a map
    careful.core.n_visible = n_visible  # beside those held
    first = careful.track().estimate
    careful.core.n_visible = 3
    careful.run(AcceptanceConfig().changes_seen + 1)
    later = careful.track().estimate
    assert usual.covariance is not None
    assert first.covariance is not None and first.evidence is not None
    assert later.covariance is not None
    limits = AcceptanceConfig()
    found = max(first.evidence.found, limits.fewest_found)
    few = 1 + (limits.few_found / found) ** 4
    np.testing.assert_allclose(first.covariance, 2 * few * usual.covariance)
    np.testing.assert_allclose(later.covariance, usual.covariance)


@pytest.mark.parametrize(("correlation", "factor"), [(2.5, 2.5), (0.6, 1.0)])
def test_neighbours_that_are_wrong_together_count_as_fewer(
    careful: Scene, correlation: float, factor: float
) -> None:
    usual = careful.track().estimate
    careful.core.correlation = correlation
    estimate = careful.track().estimate
    assert usual.covariance is not None
    assert estimate.covariance is not None
    assert usual.evidence is not None
    assert estimate.evidence is not None
    assert estimate.covariance[0, 0] == pytest.approx(factor * usual.covariance[0, 0])
    assert estimate.evidence.verdict is usual.evidence.verdict


@pytest.mark.parametrize(("turn", "factor"), [(0.02, 1 + (10 / 15) ** 2), (0.5, 1 + 2**2)])
def test_a_turn_that_nobody_expected_makes_a_pose_less_certain(
    careful: Scene, monkeypatch: pytest.MonkeyPatch, turn: float, factor: float
) -> None:
    # Radians; the scene's focal length is 500 pixels.
    usual = careful.track().estimate
    monkeypatch.setattr(pose_validator, "_changes", lambda frame, motion: (np.degrees(turn), 0.0))
    turned_otherwise = careful.track().estimate
    assert usual.covariance is not None
    assert turned_otherwise.covariance is not None
    larger = turned_otherwise.covariance[0, 0] / usual.covariance[0, 0]
    assert larger == pytest.approx(factor)


@pytest.mark.parametrize(("looser", "factor"), [(1.2, 1.0), (2.0, 2.0 / 1.3)])
def test_a_pose_that_is_held_loosely_is_less_certain_still(
    careful: Scene, monkeypatch: pytest.MonkeyPatch, looser: float, factor: float
) -> None:
    usual = careful.track().estimate
    optimize = careful.core.optimize_pose

    def loosely(frame: FakeFrame) -> SimpleNamespace:
        found = optimize(frame)
        found.covariance = looser**2 * found.covariance
        return found

    monkeypatch.setattr(careful.core, "optimize_pose", loosely)
    estimate = careful.track().estimate
    assert usual.covariance is not None
    assert estimate.covariance is not None
    larger = estimate.covariance[0, 0] / usual.covariance[0, 0]
    assert larger == pytest.approx(looser**2 * factor)


def test_a_map_that_moved_was_off_by_as_much(careful: Scene) -> None:
    usual = careful.track().estimate.covariance
    careful.map.keyframe_x += 0.5
    moved = careful.track().estimate.covariance
    later = careful.track().estimate.covariance
    assert usual is not None
    assert moved is not None
    assert later is not None
    np.testing.assert_allclose(np.diag(moved - usual), [0, 0, 0, 0.25, 0, 0], atol=1e-9)
    np.testing.assert_allclose(later, usual)


def test_a_loop_that_moved_the_map_says_nothing_of_now(careful: Scene) -> None:
    usual = careful.track().estimate.covariance
    careful.map.keyframe_x += 0.5
    careful.map.big_change_index += 1
    moved = careful.track().estimate.covariance
    assert usual is not None
    assert moved is not None
    np.testing.assert_allclose(moved, usual)
