# SPDX-License-Identifier: BSD-3-Clause
"""What a pose must have for it to be believed, with the verbs of the core replaced."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from orbslam2py import Reason, Sensor, TrackingState
from orbslam2py.slam.config import AcceptanceConfig
from orbslam2py.slam.records import PoseMethod, Verdict
from support.tracking_scene import FakeCore, Scene, every_way_ends_elsewhere


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
    scene = Scene(Sensor.STEREO, core, evidence=AcceptanceConfig())
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
