# SPDX-License-Identifier: BSD-3-Clause
"""Errors of trajectories, against evo and against paths computed by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D
from scipy.spatial.transform import Rotation

from orbslam2py import DatasetError, Trajectory
from orbslam2py.evaluation import (
    Alignment,
    Similarity,
    align,
    evaluate_trajectory,
    lap_error,
    one_second_pairs,
    scale_drift,
    segment_errors,
)
from support.made_up_paths import straight, wander


def disturbed(truth: Trajectory, scale: float = 1.0, seed: int = 1) -> Trajectory:
    """The same walk with noise, in another world, with jitter in its time stamps."""
    generator = np.random.default_rng(seed)
    n = len(truth)
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, 3] += generator.normal(scale=0.05, size=(n, 3))
    T_wc[:, :3, 3] *= scale
    noise = Rotation.from_rotvec(generator.normal(scale=0.01, size=(n, 3))).as_matrix()
    T_wc[:, :3, :3] = T_wc[:, :3, :3] @ noise
    world = np.eye(4)
    world[:3, :3] = Rotation.from_rotvec([0.3, -0.8, 1.9]).as_matrix()
    world[:3, 3] = [3, -2, 7]
    stamps = truth.timestamps + generator.uniform(-0.004, 0.004, n)
    return Trajectory(stamps, world @ T_wc)


def evo_trajectory(trajectory: Trajectory) -> PoseTrajectory3D:
    return PoseTrajectory3D(
        poses_se3=list(trajectory.T_wc), timestamps=np.array(trajectory.timestamps)
    )


def evo_pair(
    estimate: Trajectory, truth: Trajectory, alignment: Alignment
) -> tuple[PoseTrajectory3D, PoseTrajectory3D]:
    reference, moved = sync.associate_trajectories(
        evo_trajectory(truth), evo_trajectory(estimate), max_diff=0.02
    )
    if alignment is not Alignment.NONE:
        moved.align(reference, correct_scale=alignment is Alignment.SIM3)
    return reference, moved


def evo_rpe(
    pair: tuple[PoseTrajectory3D, PoseTrajectory3D],
    relation: metrics.PoseRelation,
    delta: int,
    all_pairs: bool,
) -> dict[str, float]:
    metric = metrics.RPE(relation, delta, metrics.Unit.frames, all_pairs=all_pairs)
    metric.process_data(pair)
    return dict(metric.get_all_statistics())


# ---- against evo ---------------------------------------------------------------------------------
@pytest.mark.parametrize("alignment", [one for one in Alignment if one is not Alignment.YAW])
@pytest.mark.parametrize("scale", [1.0, 0.2])
def test_equals_evo(alignment: Alignment, scale: float) -> None:
    truth = wander(300)
    estimate = disturbed(truth, scale)
    ours = evaluate_trajectory(estimate, truth, alignment)
    assert ours.ate is not None
    pair = evo_pair(estimate, truth, ours.alignment)

    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    expected = ape.get_all_statistics()
    assert ours.matched_poses == 300
    for name in ("rmse", "mean", "median", "max"):
        assert getattr(ours.ate, name) == pytest.approx(expected[name], rel=1e-9)

    translation, rotation = (
        metrics.PoseRelation.translation_part,
        metrics.PoseRelation.rotation_angle_deg,
    )
    figures = ours.as_dict()
    for key, relation, delta, all_pairs in (
        ("rpe_translation_rmse_m", translation, 1, False),
        ("rpe_rotation_rmse_deg", rotation, 1, False),
        ("rpe_translation_rmse_m_1s", translation, 10, True),
        ("rpe_rotation_rmse_deg_1s", rotation, 10, True),
    ):
        expected = evo_rpe(pair, relation, delta, all_pairs)
        assert figures[key] == pytest.approx(expected["rmse"], rel=1e-9), key


def test_yaw_leaves_errors_of_gravity_and_scale() -> None:
    truth = wander(300)
    world = np.eye(4)
    world[:3, :3] = Rotation.from_rotvec([0, 0, 2.1]).as_matrix()
    world[:3, 3] = [3, -2, 7]
    same = evaluate_trajectory(Trajectory(truth.timestamps, world @ truth.T_wc), truth, "yaw")
    assert same.ate is not None and same.ate.max < 1e-9
    np.testing.assert_allclose(same.transform.R, world[:3, :3].T, atol=1e-12)
    # A world that leans by 0.01 rad, and one with lengths 2 % too short.
    tilt = np.eye(4)
    tilt[:3, :3] = Rotation.from_rotvec([0.01, 0, 0]).as_matrix()
    leaning = evaluate_trajectory(Trajectory(truth.timestamps, tilt @ truth.T_wc), truth, "yaw")
    assert leaning.ate is not None
    offsets = truth.positions - truth.positions.mean(axis=0)
    lift = 0.01 * np.sqrt(np.mean(np.sum(offsets[:, 1:] ** 2, axis=1)))
    assert leaning.ate.rmse == pytest.approx(lift, rel=0.02)
    short = truth.T_wc.copy()
    short[:, :3, 3] *= 0.98
    scaled = evaluate_trajectory(Trajectory(truth.timestamps, short), truth, "yaw")
    size = np.sqrt(np.mean(np.sum(offsets**2, axis=1)))
    assert scaled.ate is not None and scaled.ate.rmse == pytest.approx(0.02 * size, rel=1e-6)


def test_equals_evo_with_gaps_and_denser_truth() -> None:
    truth = wander(2000, rate=200.0)
    estimate = disturbed(truth.select(np.arange(0, 2000, 10)))
    estimate = estimate.select(np.flatnonzero(np.random.default_rng(3).uniform(size=200) > 0.3))
    # A few frames far outside the truth have no partner.
    stamps = estimate.timestamps.copy()
    stamps[-5:] += 50
    estimate = Trajectory(stamps, estimate.T_wc)
    ours = evaluate_trajectory(estimate, truth)
    assert ours.ate is not None
    pair = evo_pair(estimate, truth, Alignment.SE3)
    ape = metrics.APE(metrics.PoseRelation.translation_part)
    ape.process_data(pair)
    assert ours.matched_poses == len(estimate) - 5
    assert ours.ate.rmse == pytest.approx(ape.get_all_statistics()["rmse"], rel=1e-9)
    expected = evo_rpe(pair, metrics.PoseRelation.translation_part, 1, False)["rmse"]
    assert ours.rpe_translation is not None
    assert ours.rpe_translation.rmse == pytest.approx(expected, rel=1e-9)


def test_lost_poses_do_not_count() -> None:
    truth = wander(100)
    T_wc = truth.T_wc.copy()
    T_wc[40:50, :3, 3] += 100
    lost = np.zeros(100, bool)
    lost[40:50] = True
    result = evaluate_trajectory(Trajectory(truth.timestamps, T_wc, lost), truth)
    assert result.matched_poses == 90
    assert result.ate is not None
    assert result.ate.rmse < 1e-9


# ---- alignment -----------------------------------------------------------------------------------
def test_alignment_finds_the_transform() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    known = Similarity(2.5, Rotation.from_rotvec([1, 2, 0.5]).as_matrix(), np.array([1.0, 2, 3]))
    found = align(points, known.apply(points), with_scale=True)
    assert found.scale == pytest.approx(2.5)
    np.testing.assert_allclose(found.R, known.R, atol=1e-12)
    np.testing.assert_allclose(found.t, known.t, atol=1e-12)
    np.testing.assert_allclose(found.inverse().apply(known.apply(points)), points, atol=1e-12)


def test_alignment_of_a_mirrored_path_stays_a_rotation() -> None:
    points = np.random.default_rng(0).normal(size=(50, 3))
    found = align(points, points * [1, 1, -1])
    assert np.linalg.det(found.R) == pytest.approx(1.0)


@pytest.mark.parametrize("alignment", list(Alignment))
@pytest.mark.parametrize("still", ["estimate", "truth", "both"])
def test_standing_still(alignment: Alignment, still: str) -> None:
    truth = wander(50)
    estimate = disturbed(truth)
    if still in ("truth", "both"):
        truth = Trajectory(truth.timestamps, np.tile(truth.T_wc[:1], (50, 1, 1)))
    if still in ("estimate", "both"):
        estimate = Trajectory(estimate.timestamps, np.tile(estimate.T_wc[:1], (50, 1, 1)))
    result = evaluate_trajectory(estimate, truth, alignment)
    values = [value for value in result.as_dict().values() if isinstance(value, float)]
    assert np.isfinite(values).all()
    if still == "both":
        assert result.transform.scale == 1.0
        assert result.rpe_translation is not None
        assert result.rpe_translation.rmse < 1e-12
        if alignment is not Alignment.NONE:
            assert result.ate is not None
            assert result.ate.rmse < 1e-12


@pytest.mark.parametrize("with_scale", [False, True])
@pytest.mark.parametrize("n", [1, 2, 30])
def test_straight_lines_and_single_points(n: int, with_scale: bool) -> None:
    points = np.arange(n)[:, None] * np.array([[1.0, 2.0, 0.5]])
    turned = points @ Rotation.from_rotvec([0.4, 1.0, -2.0]).as_matrix().T + [5, 6, 7]
    found = align(points, turned, with_scale=with_scale)
    np.testing.assert_allclose(found.apply(points), turned, atol=1e-9)
    np.testing.assert_allclose(found.R @ found.R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(found.R) == pytest.approx(1.0)


def test_paths_that_have_nothing_in_common_keep_their_scale() -> None:
    points = np.array([[-1.0, 0, 0], [1, 0, 0], [-1, 0, 0], [1, 0, 0]])
    targets = np.array([[-1.0, 0, 0], [-1, 0, 0], [1, 0, 0], [1, 0, 0]])
    assert align(points, targets, with_scale=True).scale == 1.0


# ---- auto ----------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("scale", "single_camera", "expected"),
    [
        (1.0, None, "se3"),
        (1.2, None, "se3"),
        (0.3, None, "sim3"),
        (4.0, None, "sim3"),
        (1.0, True, "sim3"),
        (0.3, False, "se3"),
    ],
)
def test_auto(scale: float, single_camera: bool | None, expected: str) -> None:
    truth = wander(100)
    estimate = disturbed(truth, scale)
    result = evaluate_trajectory(estimate, truth, single_camera=single_camera)
    assert str(result.alignment) == expected
    assert result.hint == ""


def test_hint_for_a_single_camera() -> None:
    truth = wander(100)
    assert "--alignment sim3" in evaluate_trajectory(disturbed(truth, 0.3), truth, "se3").hint
    single = evaluate_trajectory(disturbed(truth), truth, "se3", single_camera=True)
    assert "cannot see metres" in single.hint
    assert evaluate_trajectory(disturbed(truth), truth, "se3").hint == ""


def test_noise_is_no_unit() -> None:
    generator = np.random.default_rng(0)
    T_wc = wander(50).T_wc.copy()
    T_wc[:, :3, 3] = generator.normal(size=(50, 3))
    result = evaluate_trajectory(Trajectory(wander(50).timestamps, T_wc), wander(50))
    assert result.alignment is Alignment.SE3


def test_alignment_that_does_not_exist() -> None:
    with pytest.raises(DatasetError, match="the alignment is 'sim2'; give one of se3, sim3"):
        evaluate_trajectory(wander(5), wander(5), "sim2")


# ---- what was matched ----------------------------------------------------------------------------
def test_what_was_matched() -> None:
    truth = straight(101, 1.0)
    part = truth.select(np.r_[10:31, 61:81]).shifted(0.003)
    matched = evaluate_trajectory(part, truth).matched
    assert (matched.poses, matched.estimate_poses, matched.truth_poses) == (41, 41, 101)
    assert matched.path == pytest.approx(20 + 19), "the gap of 30 m is not covered"
    assert matched.truth_path == pytest.approx(100)
    assert matched.median_difference == pytest.approx(0.003)
    assert (matched.first, matched.last) == pytest.approx((1.003, 8.003))
    assert "41 of 41 poses matched, from 1.003 to 8.003 s, over 39.00 of 100.00 m" in str(matched)
    assert "differ by 3.00 ms" in str(matched)


def test_offset_of_the_clocks() -> None:
    truth = wander(50)
    result = evaluate_trajectory(truth.shifted(-12.5), truth, offset=12.5)
    assert result.matched_poses == 50
    assert result.matched.max_difference < 1e-9
    with pytest.raises(DatasetError, match="--offset"):
        evaluate_trajectory(truth.shifted(-12.5), truth)


# ---- one second ----------------------------------------------------------------------------------
def test_pairs_of_one_second() -> None:
    first, second = one_second_pairs(np.array([0.0, 0.5, 0.95, 1.04, 1.5, 2.2, 3.31]))
    pairs = list(zip(first.tolist(), second.tolist(), strict=True))
    assert pairs == [(0, 3), (1, 4)]
    assert len(one_second_pairs(np.zeros(0))[0]) == 0


def test_no_figures_over_a_second_without_one() -> None:
    truth = wander(8)
    assert evaluate_trajectory(truth, truth).rpe_translation_1s is None
    numbered = Trajectory(np.arange(8), truth.T_wc)
    assert evaluate_trajectory(numbered, numbered, timed=False).rpe_rotation_1s is None


@pytest.mark.parametrize("alignment", list(Alignment))
def test_single_pose_has_no_error(alignment: Alignment) -> None:
    truth = wander(1)
    figures = evaluate_trajectory(truth, truth, alignment).as_dict()
    assert figures["matched_poses"] == 1
    for name in ("ate_rmse_m", "ate_max_m", "ate_scale", "rpe_translation_rmse_m"):
        assert figures[name] is None, name
    assert figures["t_rel_percent"] is None


def test_scale_of_two_poses_is_not_known() -> None:
    truth = wander(2)
    result = evaluate_trajectory(disturbed(truth), truth, "sim3")
    assert result.ate is None
    assert result.rpe_translation is None
    assert result.rpe_rotation is not None, "turns need no scale"
    assert evaluate_trajectory(disturbed(truth), truth, "se3").ate is not None


def test_figure_that_overflows_leaves_the_others() -> None:
    truth = wander(30)
    T_wc = truth.T_wc.copy()
    T_wc[3, :3, 3] = 1e300
    result = evaluate_trajectory(Trajectory(truth.timestamps, T_wc), truth)
    assert result.ate is None
    assert result.rpe_translation is None
    assert result.rpe_rotation is not None
    assert result.rpe_rotation.rmse < 1e-5
    values = [v for v in result.as_dict().values() if isinstance(v, float)]
    assert np.isfinite(values).all()


# ---- KITTI's segments by hand --------------------------------------------------------------------
def test_segments_of_a_line_that_is_too_long() -> None:
    """251 poses 1 m apart, the estimate 1 % too long.

    A segment ends at the first pose MORE than its length away: 100 m ends after 101 m, 200 m after
    201 m. Segments of 100 m start at poses 0, 10, ... 140 (15 of them, the last one ends at 241;
    150 + 101 = 251 does not exist), those of 200 m at 0, 10, ... 40 (5 of them).
    """
    truth, estimate = straight(251, 1.0), straight(251, 1.01)
    errors = segment_errors(estimate.T_wc, truth.T_wc)
    assert errors.shape == (20, 2)
    np.testing.assert_allclose(errors[:15, 0], 0.01 * 101 / 100)
    np.testing.assert_allclose(errors[15:, 0], 0.01 * 201 / 200)
    result = evaluate_trajectory(estimate, truth)
    expected = (15 * 1.01 + 5 * 1.005) / 20
    assert result.t_rel_percent == pytest.approx(expected, rel=1e-12)
    assert result.r_rel_deg_per_100m == pytest.approx(0.0, abs=1e-12)


def test_segments_of_a_line_that_turns_slowly() -> None:
    """Straight truth, 0.75 m between poses; the estimate's orientation turns 0.01 deg per pose.

    It stays in place, so a motion of n poses is seen rotated by the heading at its start, and its
    own turn is n times 0.01 deg. Segments of 100 m take n = 134 poses (100.5 m): the distance of
    the two end points differs by the chord 2 * 100.5 * sin(heading / 2), heading being k * 0.01 deg
    at the start k. With 171 poses they start at k = 0, 10, 20, 30.
    """
    n, turn = 171, math.radians(0.01)
    truth = straight(n, 0.75)
    T_wc = truth.T_wc.copy()
    T_wc[:, :3, :3] = Rotation.from_rotvec(
        np.arange(n)[:, None] * turn * np.array([[0.0, 1.0, 0.0]])
    ).as_matrix()
    errors = segment_errors(T_wc, truth.T_wc)
    chords = [2 * 100.5 * math.sin(k * turn / 2) / 100 for k in (0, 10, 20, 30)]
    np.testing.assert_allclose(errors[:, 0], chords, atol=1e-14)
    np.testing.assert_allclose(errors[:, 1], 134 * turn / 100)
    result = evaluate_trajectory(Trajectory(truth.timestamps, T_wc), truth)
    assert result.r_rel_deg_per_100m == pytest.approx(134 * 0.01)
    assert result.t_rel_percent == pytest.approx(100 * sum(chords) / 4)


def test_segments_do_not_depend_on_the_world() -> None:
    truth = straight(1000, 1.0)
    estimate = straight(1000, 0.98)
    world = np.eye(4)
    world[:3, :3] = Rotation.from_rotvec([1, 2, 3]).as_matrix()
    world[:3, 3] = [10, 20, 30]
    np.testing.assert_allclose(
        segment_errors(world @ estimate.T_wc, truth.T_wc),
        segment_errors(estimate.T_wc, truth.T_wc),
        atol=1e-12,
    )
    assert len(segment_errors(estimate.T_wc, truth.T_wc)) == sum(
        len(range(0, 1000 - length - 1, 10)) for length in range(100, 900, 100)
    )


def test_segments_of_one_camera_are_scaled() -> None:
    truth = straight(300, 1.0)
    result = evaluate_trajectory(straight(300, 0.1), truth, Alignment.SIM3)
    assert result.t_rel_percent == pytest.approx(0.0, abs=1e-9)


def test_no_segments_on_short_paths() -> None:
    truth = straight(101, 1.0)
    result = evaluate_trajectory(truth, truth)
    assert result.t_rel_percent is None
    assert result.r_rel_deg_per_100m is None


# ---- bad input -----------------------------------------------------------------------------------
def test_no_common_time() -> None:
    truth = wander(10)
    later = Trajectory(truth.timestamps + 1000, truth.T_wc)
    with pytest.raises(DatasetError, match=r"10 poses from 1100\.000 to 1100\.900 s"):
        evaluate_trajectory(later, truth)
    empty = Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    with pytest.raises(DatasetError, match="no poses"):
        evaluate_trajectory(empty, truth)


NO_POSES = {
    "nan": (np.full((4, 4), np.nan), "holds a number that is not finite"),
    "infinite": (np.diag([1, 1, 1, math.inf]), "holds a number that is not finite"),
    "zero": (np.zeros((4, 4)), "is no pose"),
    "mirror": (np.diag([1.0, 1, -1, 1]), "is no pose"),
}


@pytest.mark.parametrize("kind", NO_POSES)
@pytest.mark.parametrize("whose", ["estimate", "truth"])
@pytest.mark.parametrize("compare", [evaluate_trajectory, lap_error, scale_drift])
def test_what_is_no_pose_is_told_by_its_number(kind: str, whose: str, compare: Any) -> None:
    good = wander(20)
    bad_pose, reason = NO_POSES[kind]
    T_wc = good.T_wc.copy()
    T_wc[7] = bad_pose
    bad = Trajectory(good.timestamps, T_wc)
    pair = (bad, good) if whose == "estimate" else (good, bad)
    with pytest.raises(DatasetError, match=f"^pose 7 of the {whose} {reason}.*; correct it, or"):
        compare(*pair)


def test_lost_poses_may_be_anything() -> None:
    good = wander(20)
    T_wc = good.T_wc.copy()
    T_wc[7] = np.nan
    partly_lost = Trajectory(good.timestamps, T_wc, np.arange(20) == 7)
    ate = evaluate_trajectory(partly_lost, good).ate
    assert ate is not None
    assert ate.rmse == pytest.approx(0, abs=1e-9)
