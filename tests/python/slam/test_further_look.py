# SPDX-License-Identifier: BSD-3-Clause
"""A pose is held against what lies further around, and against the map from nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import PoseEstimate
from orbslam2py.slam.thresholds import EvidenceThresholds, TrackingThresholds
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.vocabulary import load_vocabulary
from support.tracking_scene import FakeCore, FakeFrame, Scene, pose

pytestmark = pytest.mark.watchdog(120)

N = 12
LIMITS = TrackingThresholds()


class Walk:
    """A few frames of a corridor, tracked in stereo, and a search in the map that they made."""

    def __init__(self) -> None:
        sequence = SyntheticSequence(
            SyntheticOptions(world="corridor", sensor="stereo", size=(320, 240), frames=N)
        )
        self.system = System(sequence.settings, "stereo", deterministic=True)
        for i in range(N):
            images = sequence.load(i)
            self.system.track_stereo(images.image, images.right, i / 20)
        self.last = self.system.pipeline.tracking.motion.last
        self.map = self.system.pipeline.back_end.map
        self.search = PoseSearch(
            self.map, load_vocabulary(), Sensor.STEREO, 20, None, TrackingThresholds()
        )

    def version(self) -> core.TrackedFrame:
        """The last frame as it was tracked."""
        version = core.TrackedFrame(self.last.features)
        version.copy_associations(self.last, np.ones(len(self.last.features), bool))
        version.T_cw = self.last.T_cw
        version.share_anchor(self.last)
        return version

    def refined(self) -> RefinedPose:
        return self.search.in_local_map(self.version(), PoseEstimate())

    def turned(self, radians: float, n_inliers: int, *, metres: float = 1e-3) -> RefinedPose:
        """A pose beside the right one that so many points fit, told with so many metres."""
        refined = self.refined()
        version = core.TrackedFrame(self.last.features)
        turn = core.Pose.exp([0, radians, 0, 0, 0, 0])
        assert self.last.T_cw is not None
        version.T_cw = turn @ self.last.T_cw
        version.share_anchor(self.last)
        estimate = PoseEstimate(n_inliers=n_inliers, covariance=metres**2 / 3 * np.eye(6))
        return replace(refined, frame=version, estimate=estimate)

    def degrees_off(self, frame: core.TrackedFrame) -> float:
        assert frame.T_cw is not None and self.last.T_cw is not None
        return float(np.degrees(frame.T_cw.difference(self.last.T_cw)[0]))


@pytest.fixture(scope="module")
def walk() -> Iterator[Walk]:
    walk = Walk()
    yield walk
    walk.system.shutdown()


def test_what_lies_beyond_the_windows_is_found_and_moves_the_pose(walk: Walk) -> None:
    beside = walk.turned(0.03, n_inliers=40)
    found = walk.search.look_further(beside)
    assert found is not beside
    assert found.estimate.found
    assert found.estimate.n_inliers > 100
    assert found.estimate.n_inliers <= found.n_predicted
    assert walk.degrees_off(beside.frame) > 1.5
    assert walk.degrees_off(found.frame) < 0.1
    assert found.frame.n_associated() == found.estimate.n_matches


def test_the_first_pose_stays_as_it_was(walk: Walk) -> None:
    beside = walk.turned(0.03, n_inliers=40)
    assert beside.frame.T_cw is not None
    T_cw = beside.frame.T_cw.matrix
    walk.search.look_further(beside)
    np.testing.assert_array_equal(beside.frame.T_cw.matrix, T_cw)
    assert beside.frame.n_associated() == 0


def test_a_pose_that_fits_is_kept(walk: Walk) -> None:
    refined = walk.refined()
    assert walk.search.look_further(refined) is refined


def test_a_pose_elsewhere_needs_few_more_inliers_and_the_same_one_many(walk: Walk) -> None:
    n = walk.search.look_further(walk.turned(0.03, n_inliers=40)).estimate.n_inliers
    # A pose that is told with a metre lies at the same place.
    for metres, gain in ((1e-3, LIMITS.better_look), (1.0, LIMITS.much_better_look)):
        clear = walk.turned(0.03, n_inliers=int(n / gain) - 1, metres=metres)
        assert walk.search.look_further(clear) is not clear
        unclear = walk.turned(0.03, n_inliers=int(n / gain) + 1, metres=metres)
        assert walk.search.look_further(unclear) is unclear


def test_nothing_further_around_changes_nothing(walk: Walk) -> None:
    away = walk.turned(1.5, n_inliers=40)
    assert walk.search.look_further(away) is away


def test_without_a_local_map_there_is_nothing_to_look_for(walk: Walk) -> None:
    refined = replace(walk.refined(), local_map=None)
    assert walk.search.look_further(refined) is refined


def test_more_that_is_not_enough_is_no_pose(walk: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walk.search, "limits", replace(LIMITS, local_map_inliers=10_000))
    beside = walk.turned(0.03, n_inliers=40)
    assert walk.search.look_further(beside) is beside


# ---- from nothing --------------------------------------------------------------------------------
@pytest.mark.parametrize("in_doubt", [False, True])
def test_a_pose_matched_from_nothing_does_not_hang_on_where_it_began(
    walk: Walk, in_doubt: bool
) -> None:
    ends = []
    for radians in (-0.01, -0.005, 0.005, 0.01):
        beside = walk.turned(radians, n_inliers=60)
        found = walk.search.look_afresh(beside, in_doubt=in_doubt)
        assert found is not beside
        assert found.n_predicted == len(found.visible) >= found.estimate.n_inliers > 60
        assert walk.degrees_off(beside.frame) > 0.25, "what was given stays as it was"
        ends.append(walk.degrees_off(found.frame))
    assert max(ends) < 0.1
    assert max(ends) - min(ends) < 0.02


def test_a_pose_that_lies_at_the_same_place_is_kept_unless_it_was_in_doubt(walk: Walk) -> None:
    vague = walk.turned(0.005, n_inliers=60, metres=1.0)
    assert walk.search.look_afresh(vague, in_doubt=False) is vague
    assert walk.search.look_afresh(vague, in_doubt=True) is not vague


def test_fewer_inliers_are_enough_where_a_pose_was_in_doubt(walk: Walk) -> None:
    n = walk.search.look_afresh(walk.turned(0.01, n_inliers=60), in_doubt=True).estimate.n_inliers
    limits = ((False, LIMITS.afresh_share), (True, LIMITS.afresh_share_in_doubt))
    for in_doubt, share in limits:
        enough = walk.turned(0.01, n_inliers=int(n / share) - 1)
        assert walk.search.look_afresh(enough, in_doubt=in_doubt) is not enough
        too_few = walk.turned(0.01, n_inliers=int(n / share) + 2)
        assert walk.search.look_afresh(too_few, in_doubt=in_doubt) is too_few


def test_nothing_to_match_from_nothing_changes_nothing(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    away = walk.turned(1.5, n_inliers=40)
    beyond_the_map = replace(walk.turned(0.01, n_inliers=60), local_map=None)
    for refined in (away, beyond_the_map):
        for in_doubt in (False, True):
            assert walk.search.look_afresh(refined, in_doubt=in_doubt) is refined
    monkeypatch.setattr(walk.search, "limits", replace(LIMITS, local_map_inliers=10_000))
    beside = walk.turned(0.01, n_inliers=60)
    assert walk.search.look_afresh(beside, in_doubt=True) is beside, "not enough for a pose"


# ---- when ----------------------------------------------------------------------------------------
def test_one_frame_in_five_is_looked_at_further(scene: Scene) -> None:
    scene.run(12)
    assert scene.search.looked_further == [5, 10]


def test_a_frame_less_certain_than_usual_is_looked_at_further(scene: Scene, core: FakeCore) -> None:
    scene.run(7)
    core.inliers.extend([100, 200])  # the variance of the fake grows with them
    scene.run(2)
    assert scene.search.looked_further == [5, 7]


def test_a_frame_that_is_not_found_is_not(scene: Scene, core: FakeCore) -> None:
    scene.run(10)
    core.inliers.extend([100, 2])
    scene.track()
    assert scene.search.looked_further == [5]


def test_poses_are_matched_from_nothing_in_a_map_that_stays_as_it_is(scene: Scene) -> None:
    scene.run(3)
    assert scene.search.looked_afresh == []
    scene.localize = True
    scene.run(3)
    assert scene.search.looked_afresh == [(3, False), (4, False), (5, False)]


@pytest.mark.parametrize(("metres", "confirmed"), [(0.0, True), (1000.0, False)])
def test_what_is_matched_from_nothing_is_weighed_anew(
    core: FakeCore, monkeypatch: pytest.MonkeyPatch, metres: float, confirmed: bool
) -> None:
    """It was confirmed by a second way only if it is still where both had led."""
    scene = Scene(Sensor.STEREO, core, evidence=EvidenceThresholds())
    scene.run(12)
    scene.localize = True
    scene.run(3)

    ends: list[float] = []

    def from_nothing(refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        assert in_doubt
        assert refined.frame.T_cw is not None
        version: Any = FakeFrame(refined.frame.id)
        version.share_anchor(refined.frame)
        version.T_cw = pose(metres) @ refined.frame.T_cw
        ends.append(float(version.T_cw.matrix[0, 3]))
        return replace(refined, frame=version, estimate=replace(refined.estimate, n_inliers=77))

    monkeypatch.setattr(scene.search, "look_afresh", from_nothing)
    # What turns with the images leads to the place that is in doubt as well.
    core.aligned.append(SimpleNamespace(quaternion_xyzw=np.array([0.0, 0, 0, 1]), correlation=0.9))
    for n_inliers in (45, 46):
        core.inliers.extend([50, n_inliers])
    outcome = scene.track()
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert outcome.estimate.n_inliers == 77
    assert evidence.inliers_to_usual == pytest.approx(0.77)
    assert (evidence.doubted, evidence.confirmed) == (True, confirmed)
    assert scene.last.T_cw is not None
    assert ends == [float(scene.last.T_cw.matrix[0, 3])]
