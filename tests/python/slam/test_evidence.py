# SPDX-License-Identifier: BSD-3-Clause
"""What a pose must have for it to be believed, with the verbs of the core replaced."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import Reason, Sensor, TrackingState
from orbslam2py.slam.evidence import judgement
from orbslam2py.slam.pose_search import MotionModel
from orbslam2py.slam.records import PoseMethod, Verdict
from orbslam2py.slam.thresholds import EvidenceThresholds, TrackingThresholds
from support.tracking_scene import FakeCore, FakeFrame, Scene, every_way_ends_elsewhere, pose

#: Frames until the first second after the start, with its own limit of inliers, is over.
_SETTLED = 40


@pytest.fixture
def careful(core: FakeCore, sensor: Sensor) -> Scene:
    """A tracker that weighs its poses, used to 100 inliers; refuses fewer than 30."""
    scene = Scene(
        sensor, core, TrackingThresholds(local_map_inliers=10), evidence=EvidenceThresholds()
    )
    scene.run(_SETTLED)
    core.calls.clear()
    return scene


def turned(correlation: float = 0.9) -> SimpleNamespace:
    return SimpleNamespace(quaternion_xyzw=np.array([0.0, 0, 0, 1]), correlation=correlation)


def doubted(scene: Scene, first: int, aligned: int, by_words: int, wide: int) -> None:
    """The inliers that each way ends with."""
    scene.core.aligned.append(turned())
    for n_inliers in (first, aligned, by_words, wide):
        scene.core.inliers.extend([50, n_inliers])


def apart(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every way ends somewhere else."""
    monkeypatch.setattr(scene.core, "optimize_pose", every_way_ends_elsewhere(scene.core))


def test_an_ordinary_frame_is_searched_once(careful: Scene) -> None:
    outcome = careful.track()
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert evidence.verdict is Verdict.STRONG
    assert evidence.method is PoseMethod.MOTION_MODEL
    assert evidence.inliers_to_usual == pytest.approx(1)
    assert evidence.n_predicted == 321 + careful.core.n_visible
    assert evidence.found == pytest.approx(100 / evidence.n_predicted)
    assert not evidence.confirmed
    assert careful.core.calls == ["motion", "optimize", "local map", "optimize", "sightings"]


def test_no_evidence_where_the_map_begins_and_where_no_pose_is_found(core: FakeCore) -> None:
    scene = Scene(Sensor.STEREO, core, evidence=EvidenceThresholds())
    assert scene.track().estimate.evidence is None
    core.motion.extend([0] * 4)
    core.words.extend([0] * 4)
    lost = scene.track()
    assert lost.state is TrackingState.LOST
    assert lost.estimate.evidence is None


def test_what_turns_with_the_images_wins(careful: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    apart(careful, monkeypatch)
    doubted(careful, first=40, aligned=90, by_words=0, wide=0)
    outcome = careful.track()
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert evidence.method is PoseMethod.ALIGNED_IMAGES
    assert evidence.verdict is Verdict.STRONG
    assert outcome.estimate.n_inliers == 90
    assert "words" not in careful.core.calls, "enough was found"
    assert careful.core.calls.count("sightings") == 1, "only what is believed is counted"


def test_the_first_pose_stays_unless_another_is_clearly_better(
    careful: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    apart(careful, monkeypatch)
    doubted(careful, first=55, aligned=60, by_words=60, wide=60)
    outcome = careful.track()
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.method is PoseMethod.MOTION_MODEL
    assert outcome.estimate.n_inliers == 55


@pytest.mark.parametrize("correlation", [0.0, 0.59])
def test_images_that_do_not_agree_are_no_guide(
    careful: Scene, monkeypatch: pytest.MonkeyPatch, correlation: float
) -> None:
    apart(careful, monkeypatch)
    careful.core.aligned.append(turned(correlation))
    careful.core.inliers.extend([50, 40, 50, 90])
    outcome = careful.track()
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.method is PoseMethod.KEYFRAMES_AROUND


def test_a_pose_that_explains_little_is_refused(
    careful: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    apart(careful, monkeypatch)
    doubted(careful, first=29, aligned=20, by_words=20, wide=20)
    outcome = careful.track()
    assert outcome.state is TrackingState.LOST
    assert outcome.estimate.reason is Reason.WEAK_EVIDENCE
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.verdict is Verdict.REFUSED
    assert careful.last.T_cw is None


def test_a_second_way_to_it_makes_it_weak_and_believed(careful: Scene) -> None:
    """All ways end at the same pose."""
    doubted(careful, first=29, aligned=29, by_words=29, wide=29)
    outcome = careful.track()
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.verdict is Verdict.WEAK
    assert outcome.estimate.evidence.confirmed


def test_a_weak_frame_is_no_keyframe_before_the_third_that_is_confirmed(careful: Scene) -> None:
    careful.core.n_reference = 1000
    keyframes = []
    for _ in range(3):
        doubted(careful, first=29, aligned=29, by_words=29, wide=29)
        keyframes.append(careful.track().is_keyframe)
    assert keyframes == [False, False, True]
    assert careful.core.n_inserted == 1


def test_without_a_second_way_it_never_is(careful: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    careful.core.n_reference = 1000
    careful.core.n_visible = 2000  # much is in view that is not found
    apart(careful, monkeypatch)
    for _ in range(5):
        doubted(careful, first=49, aligned=40, by_words=40, wide=40)
        outcome = careful.track()
        assert outcome.state is TrackingState.OK
        assert outcome.estimate.evidence is not None
        assert outcome.estimate.evidence.verdict is Verdict.WEAK
        assert not outcome.is_keyframe
    assert careful.core.n_inserted == 0


def test_inliers_in_one_corner_of_the_image_are_weak(careful: Scene) -> None:
    careful.core.n_reference = 1000
    careful.core.n_cells = 4
    outcome = careful.track()
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.verdict is Verdict.WEAK
    assert not outcome.is_keyframe
    careful.core.n_cells = 5
    assert careful.track().is_keyframe


def test_matches_that_fit_much_worse_than_usual_are_weak_and_told_as_uncertain(
    careful: Scene,
) -> None:
    careful.core.n_reference = 1000
    usual = careful.track().estimate
    careful.core.match_error = 1.2
    outcome = careful.track()
    estimate = outcome.estimate
    assert usual.evidence is not None
    assert estimate.evidence is not None
    assert usual.covariance is not None
    assert estimate.covariance is not None
    assert estimate.evidence.error_to_usual == pytest.approx(2)
    assert estimate.evidence.verdict is Verdict.WEAK
    assert not outcome.is_keyframe
    # 100 inliers in 30 cells count as 30 observations, twice as wrong as usual.
    larger = estimate.covariance[0, 0] / usual.covariance[0, 0]
    assert larger == pytest.approx(2**2 * estimate.n_inliers / 30)
    careful.core.match_error = 0.6
    again = careful.track()
    assert again.is_keyframe
    assert again.estimate.covariance is not None
    assert again.estimate.covariance[0, 0] == pytest.approx(usual.covariance[0, 0])


def test_where_errors_vary_from_image_to_image_a_larger_one_is_not_sudden(careful: Scene) -> None:
    # Images that are far apart fit one time well and one time badly.
    for error in (0.8, 0.5, 0.9, 0.5, 0.9, 0.45, 0.9, 0.45, 0.9, 0.5):
        careful.core.match_error = error
        careful.track()
    careful.core.match_error = 1.1
    evidence = careful.track().estimate.evidence
    assert evidence is not None
    assert evidence.error_to_usual > EvidenceThresholds().weak_error
    assert evidence.verdict is Verdict.STRONG
    careful.core.match_error = 4.0
    evidence = careful.track().estimate.evidence
    assert evidence is not None
    assert evidence.verdict is Verdict.WEAK


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
    few = EvidenceThresholds().few_inliers
    # What is stated of the keypoints' noise goes by the number, here in proportion.
    by_number = (1 + (few / counted) ** 4) / (1 + (few / 100) ** 4)
    assert larger == pytest.approx(n_inliers / 100 * by_number)


def test_where_nothing_is_usual_yet_a_pose_is_less_certain(careful: Scene) -> None:
    usual = careful.track().estimate
    careful.tracking.reset()
    careful.run(1)  # the first frame of a map
    first = careful.track().estimate
    careful.run(EvidenceThresholds().changes_seen + 1)
    later = careful.track().estimate
    assert usual.covariance is not None
    assert first.covariance is not None
    assert later.covariance is not None
    np.testing.assert_allclose(first.covariance, 2 * usual.covariance)
    np.testing.assert_allclose(later.covariance, usual.covariance)


@pytest.mark.parametrize(("displacement", "share"), [(40.0, 18.2 / 40), (5.0, 1.0)])
def test_a_blurred_image_is_of_any_moment_while_the_shutter_was_open(
    careful: Scene, monkeypatch: pytest.MonkeyPatch, displacement: float, share: float
) -> None:
    careful.core.displacement = displacement
    monkeypatch.setattr(MotionModel, "way", lambda self, frame: pose(0.4))
    sharp = careful.track().estimate
    careful.core.fine_detail_of_images = 0.7  # smeared by 9.6 pixels
    blurred = careful.track().estimate
    assert sharp.covariance is not None
    assert blurred.covariance is not None
    larger = blurred.covariance[4, 4] / sharp.covariance[4, 4]
    along = blurred.covariance[3, 3] - larger * sharp.covariance[3, 3]
    assert along == pytest.approx((share * 0.4) ** 2 / 12)


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


def test_keypoints_on_a_smear_are_wrong_together(careful: Scene) -> None:
    usual = careful.track().estimate
    careful.core.fine_detail_of_images = 0.7
    blurred = careful.track().estimate
    careful.core.fine_detail_of_images = 1.4
    sharp = careful.track().estimate
    assert usual.covariance is not None
    assert blurred.covariance is not None
    assert sharp.covariance is not None
    assert usual.evidence is not None
    assert blurred.evidence is not None
    limits = EvidenceThresholds()
    assert blurred.evidence.smear == pytest.approx(limits.smear * (2**2 - 1))
    assert usual.evidence.smear == 0
    # 100 inliers in 30 cells, each with a variance of 2.
    variance = blurred.evidence.smear**2 / 12 / 2
    larger = blurred.covariance[0, 0] / usual.covariance[0, 0]
    assert larger == pytest.approx(1 + 100 / 30 * variance)
    assert blurred.evidence.verdict is Verdict.STRONG
    assert sharp.covariance[0, 0] == pytest.approx(usual.covariance[0, 0])


@pytest.mark.parametrize(("turn", "factor"), [(0.02, 1 + (10 / 15) ** 2), (0.5, 1 + 2**2)])
def test_a_turn_that_nobody_expected_makes_a_pose_less_certain(
    careful: Scene, monkeypatch: pytest.MonkeyPatch, turn: float, factor: float
) -> None:
    # Radians; the scene's focal length is 500 pixels.
    usual = careful.track().estimate
    monkeypatch.setattr(judgement, "_changes", lambda frame, motion: (np.degrees(turn), 0.0))
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


def test_a_lasting_lack_of_detail_is_the_scene(careful: Scene) -> None:
    careful.core.fine_detail_of_images = 1.2
    lengths = []
    for _ in range(80):
        evidence = careful.track().estimate.evidence
        assert evidence is not None
        lengths.append(evidence.smear)
    assert lengths[0] > 0
    assert lengths == sorted(lengths, reverse=True)
    assert lengths[-1] == 0


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


def test_an_error_that_stays_becomes_the_usual_one(careful: Scene) -> None:
    careful.core.match_error = 1.2
    verdicts = []
    for _ in range(50):
        evidence = careful.track().estimate.evidence
        assert evidence is not None
        verdicts.append(evidence.verdict)
    n_weak = verdicts.index(Verdict.STRONG)
    assert verdicts == [Verdict.WEAK] * n_weak + [Verdict.STRONG] * (50 - n_weak)
    assert n_weak > 5


def test_a_turn_that_nobody_expected_is_looked_at_again(
    careful: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = careful.core.optimize_pose

    def turns(frame: FakeFrame) -> SimpleNamespace:
        estimate = original(frame)
        frame.T_cw = type(pose(0))([0, np.sin(0.02), 0, np.cos(0.02)], [0, 0, 0])
        return estimate

    monkeypatch.setattr(careful.core, "optimize_pose", turns)
    outcome = careful.track()
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.turn_change == pytest.approx(np.degrees(0.04))
    assert "align" in careful.core.calls


def test_a_frame_whose_first_estimate_fails_is_searched_further(careful: Scene) -> None:
    careful.core.motion.extend([0, 0])
    careful.core.words.append(0)
    careful.core.aligned.append(turned())
    outcome = careful.track()
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.method is PoseMethod.ALIGNED_IMAGES


def test_what_is_usual_is_forgotten_with_the_place(careful: Scene) -> None:
    careful.core.motion.extend([0] * 4)
    careful.core.words.extend([0] * 4)
    assert careful.track().state is TrackingState.LOST
    careful.core.motion.clear()
    careful.core.words.clear()
    careful.core.inliers.extend([50, 52])
    outcome = careful.track()
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.inliers_to_usual == 1


def test_how_well_matches_fit_is_known_in_another_place_too(careful: Scene) -> None:
    careful.core.n_reference = 1000
    usual = careful.track().estimate.evidence
    careful.core.motion.extend([0] * 4)
    careful.core.words.extend([0] * 4)
    assert careful.track().state is TrackingState.LOST
    careful.core.motion.clear()
    careful.core.words.clear()
    careful.core.match_error = 4.2
    found = careful.track().estimate.evidence
    assert usual is not None
    assert found is not None
    assert usual.match_error == pytest.approx(0.6)
    assert found.error_to_usual == pytest.approx(7)
    assert found.verdict is Verdict.WEAK
