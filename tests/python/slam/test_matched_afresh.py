# SPDX-License-Identifier: BSD-3-Clause
"""In a fixed map a pose is estimated again without the matches of the frame before."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, System, TrackingState
from orbslam2py import _core as core
from orbslam2py.slam.config import AcceptanceConfig, TrackingConfig
from orbslam2py.slam.pose_search import LocalMapSearch, PoseSearch, RefinedPose
from orbslam2py.slam.records import PoseEstimate, TrackingResult
from orbslam2py.slam.state import State
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.vocabulary import load_vocabulary
from support.tracking_scene import FakeCore, FakeFrame, Scene, pose

pytestmark = pytest.mark.watchdog(120)

N = 12
LIMITS = TrackingConfig()


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
        self.search = PoseSearch(self.map, load_vocabulary(), Sensor.STEREO, None, TrackingConfig())

    def version(self) -> core.TrackedFrame:
        """The last frame as it was tracked."""
        version = core.TrackedFrame(self.last.features)
        version.copy_associations(self.last, np.ones(len(self.last.features), bool))
        version.T_cw = self.last.T_cw
        version.share_anchor(self.last)
        return version

    def refined(self) -> RefinedPose:
        return self.search.local_map_search.refine(self.version(), PoseEstimate(), State())

    def rematch(self, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        return self.search.local_map_search.rematch(refined, in_doubt=in_doubt)

    def turned(self, radians: float, n_inliers: int, *, metres: float = 1e-3) -> RefinedPose:
        """A pose beside the right one that so many points fit, told with so many metres."""
        refined = self.refined()
        version = self.last.pose_alone()
        turn = core.Pose.exp([0, radians, 0, 0, 0, 0])
        assert version.T_cw is not None
        version.T_cw = turn @ version.T_cw
        estimate = PoseEstimate(n_inliers=n_inliers, covariance=metres**2 / 3 * np.eye(6))
        return replace(refined, frame=version, estimate=estimate)

    def held(self, radians: float, n: int, *, metres: float = 1e-3) -> RefinedPose:
        """The same, held by so many points of the map."""
        beside = self.turned(radians, n, metres=metres)
        inliers = np.flatnonzero((self.last.map_points >= 0) & ~self.last.outlier)
        kept = np.zeros(len(self.last.features), bool)
        kept[inliers[:n]] = True
        T_cw = beside.frame.T_cw
        beside.frame.copy_associations(self.last, kept)
        beside.frame.T_cw = T_cw
        assert beside.frame.n_map_inliers() == n
        return beside

    def degrees_off(self, frame: core.TrackedFrame) -> float:
        assert frame.T_cw is not None and self.last.T_cw is not None
        return float(np.degrees(frame.T_cw.difference(self.last.T_cw)[0]))


@pytest.fixture(scope="module")
def walk() -> Iterator[Walk]:
    walk = Walk()
    yield walk
    walk.system.shutdown()


# ---- spread --------------------------------------------------------------------------------------
def test_the_spread_of_inliers_is_that_of_one_frame_with_and_without_its_outliers(
    walk: Walk,
) -> None:
    def figures(refined: RefinedPose) -> tuple[float, ...]:
        cells, octaves, _, covariance = refined.evidence
        return cells, octaves, *covariance.ravel()

    refined = walk.refined()
    assert refined.frame.outlier.any()
    before, with_outliers = figures(refined), refined.evidence[2]
    refined.frame.discard_outliers()
    assert figures(replace(refined)) == before
    assert replace(refined).evidence[2] < with_outliers
    fewer = walk.held(0.0, 40)
    assert figures(replace(refined, frame=fewer.frame)) != before
    refined.frame.clear_associations()
    assert figures(refined) == before, "asked for once"


# ---- from nothing --------------------------------------------------------------------------------
@pytest.mark.parametrize("in_doubt", [False, True])
def test_a_pose_matched_from_nothing_does_not_hang_on_where_it_began(
    walk: Walk, in_doubt: bool
) -> None:
    ends = []
    for radians in (-0.02, -0.005, 0.005, 0.02):
        beside = walk.held(radians, 60)
        found = walk.rematch(beside, in_doubt=in_doubt)
        assert found is not beside
        assert found.n_predicted == len(found.visible) > beside.n_predicted - 300
        assert found.n_predicted >= found.estimate.n_inliers > 60
        assert walk.degrees_off(beside.frame) > 0.25, "what was given stays as it was"
        assert beside.frame.n_associated() == 60
        ends.append(walk.degrees_off(found.frame))
    assert max(ends) < 0.1
    assert max(ends) - min(ends) < 0.02


def test_a_pose_that_lies_at_the_same_place_is_kept_unless_it_was_in_doubt(walk: Walk) -> None:
    vague = walk.held(0.005, 60, metres=1.0)
    assert walk.rematch(vague, in_doubt=False) is vague
    assert walk.rematch(vague, in_doubt=True) is not vague


@pytest.mark.parametrize("in_doubt", [False, True])
def test_a_pose_from_nothing_needs_its_share_of_inliers(
    walk: Walk, in_doubt: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = walk.held(0.01, 60)
    n = walk.rematch(beside, in_doubt=in_doubt).estimate.n_inliers
    name = "afresh_share_in_doubt" if in_doubt else "afresh_share"
    for share, is_taken in ((n / 60, True), ((n + 0.5) / 60, False)):
        monkeypatch.setattr(
            walk.search.local_map_search, "_limits", replace(LIMITS, **{name: share})
        )
        assert (walk.rematch(beside, in_doubt=in_doubt) is not beside) == is_taken
    assert LIMITS.afresh_share_in_doubt < LIMITS.afresh_share <= 1


def test_what_the_frame_before_measured_holds_a_pose_unless_it_was_in_doubt(walk: Walk) -> None:
    """Its points are not of the map, and matching from nothing does not find them."""
    beside = walk.held(0.01, 60)
    beside = replace(beside, estimate=replace(beside.estimate, n_inliers=61))
    assert walk.rematch(beside, in_doubt=False) is beside
    assert walk.rematch(beside, in_doubt=True) is not beside


def test_nothing_to_match_from_nothing_changes_nothing(walk: Walk) -> None:
    away = walk.held(1.5, 40)
    beyond_the_map = replace(walk.held(0.01, 60), local_map=None)
    for refined in (away, beyond_the_map):
        for in_doubt in (False, True):
            assert walk.rematch(refined, in_doubt=in_doubt) is refined
    beside = walk.held(0.01, 60)
    n_found = walk.rematch(beside, in_doubt=True).estimate.n_inliers
    limits = replace(LIMITS, local_map_inliers=n_found + 1)
    stricter = LocalMapSearch(walk.map, Sensor.STEREO, limits)
    refined = stricter.rematch(beside, in_doubt=True)
    assert refined is beside, "not enough for a pose"


# ---- when ----------------------------------------------------------------------------------------
def test_poses_are_matched_from_nothing_in_a_map_that_stays_as_it_is(scene: Scene) -> None:
    scene.run(3)
    assert scene.local_map_search.looked_afresh == []
    scene.localize = True
    scene.run(3)
    assert scene.local_map_search.looked_afresh == [(3, False), (4, False), (5, False)]


class FromNothing:
    """What is matched from nothing in frames that were in doubt, so far from where they were."""

    def __init__(self, scene: Scene, metres: float, n_inliers: int) -> None:
        self._metres, self._n_inliers = metres, n_inliers
        self.ends: list[float] = []
        scene.search.local_map_search.rematch = self  # type: ignore[method-assign]

    def __call__(self, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        if not in_doubt:
            return refined
        assert refined.frame.T_cw is not None
        version: Any = FakeFrame(refined.frame.id)
        version.share_anchor(refined.frame)
        version.T_cw = pose(self._metres) @ refined.frame.T_cw
        self.ends.append(float(version.T_cw.matrix[0, 3]))
        estimate = replace(refined.estimate, n_inliers=self._n_inliers)
        return replace(refined, frame=version, estimate=estimate)


def in_doubt(
    core: FakeCore, metres: float, n_inliers: int, *, confirmed: bool
) -> tuple[TrackingResult, FakeFrame, list[float]]:
    """A frame in a fixed map whose inliers fall; another way leads there as well, or none does."""
    scene = Scene(Sensor.STEREO, core, evidence=AcceptanceConfig())
    scene.run(12)
    scene.localize = True
    scene.run(3)
    from_nothing = FromNothing(scene, metres, n_inliers)
    core.inliers.extend([50, 45])
    if confirmed:
        # What turns with the images.
        no_turn = SimpleNamespace(quaternion_xyzw=np.array([0.0, 0, 0, 1]), correlation=0.9)
        core.aligned.append(no_turn)
        core.inliers.extend([50, 46])
    else:
        core.words.extend([0, 0])
        core.motion.extend([50, 0, 0])
    return scene.track(), scene.last, from_nothing.ends


@pytest.mark.parametrize(
    ("metres", "another_way", "confirmed"),
    [(0.0, True, True), (1000.0, True, False), (0.0, False, False)],
)
def test_what_is_matched_from_nothing_is_weighed_anew(
    core: FakeCore, metres: float, another_way: bool, confirmed: bool
) -> None:
    """It was confirmed by a second way only if it is still where both had led."""
    outcome, frame, ends = in_doubt(core, metres, 77, confirmed=another_way)
    evidence = outcome.estimate.evidence
    assert evidence is not None
    assert outcome.estimate.n_inliers == 77
    assert evidence.inliers_to_usual == pytest.approx(0.77)
    assert (evidence.doubted, evidence.confirmed) == (True, confirmed)
    assert frame.T_cw is not None
    assert ends == [float(frame.T_cw.matrix[0, 3])]


def test_a_pose_stays_that_from_nothing_would_be_refused(core: FakeCore) -> None:
    outcome, frame, ends = in_doubt(core, 1000.0, 12, confirmed=True)
    assert outcome.state is TrackingState.OK
    assert outcome.estimate.n_inliers == 45
    assert outcome.estimate.evidence is not None
    assert outcome.estimate.evidence.confirmed
    assert frame.T_cw is not None
    assert ends != [float(frame.T_cw.matrix[0, 3])]
