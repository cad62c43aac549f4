# SPDX-License-Identifier: BSD-3-Clause
"""What a pose should show and does not is looked for further around, and another pose may win."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import PoseEstimate
from orbslam2py.slam.thresholds import TrackingThresholds
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.vocabulary import load_vocabulary
from support.tracking_scene import FakeCore, Scene

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
