# SPDX-License-Identifier: BSD-3-Clause
"""Losses of a camera in a synthetic world: a covered lens, blur, a jump away and back."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import pytest
from benchmarks.accuracy.mapped_world import MappedWorld

from orbslam2py import Sensor, TrackingRecord, TrackingState
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.datasets import Images
from orbslam2py.slam.config import RelocalizationConfig
from orbslam2py.slam.relocalization import (
    Relocalization,
    Relocalizer,
    candidates,
    pnp_verification,
    relocalizer,
)
from orbslam2py.slam.state import LastKnownPose, LostSearch
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(120)

SIZE = (320, 240)
N_MAPPED = 50


@lru_cache
def sequence() -> SyntheticSequence:
    options = SyntheticOptions(world="corridor", sensor=Sensor.RGBD, size=SIZE, noise=2)
    return SyntheticSequence(options)


@pytest.fixture
def world() -> MappedWorld:
    """A corridor whose first frames were mapped; the camera goes on."""
    return MappedWorld(sequence(), range(N_MAPPED))


def with_image(images: Images, image: np.ndarray) -> Images:
    return Images(image, images.right, images.depth)


def smeared(images: Images, length: int = 41) -> Images:
    """As by a fast turn while the shutter was open."""
    return with_image(images, cv2.blur(images.image, (length, 1)))


def go_on(world: MappedWorld, n_frames: int) -> list[TrackingRecord]:
    """The frames after the mapped ones, as many as were not seen passed meanwhile."""
    first = world._n_shown
    return [world.show(world.sequence.load(first + k)) for k in range(n_frames)]


def off(world: MappedWorld, record: TrackingRecord, index: int) -> float:
    return world.error(record, world.sequence.T_wc(index)).translation_m


def test_a_covered_lens(world: MappedWorld) -> None:
    """The camera goes on behind a hand, and is found where its motion led it."""
    n_keyframes = world.system.n_keyframes
    for _ in range(6):
        assert world.show(world.black()).state is TrackingState.LOST
    records = go_on(world, 6)
    found = records[0]
    assert (found.state, found.unconfirmed, found.is_keyframe) == (TrackingState.OK, True, False)
    assert off(world, found, N_MAPPED + 6) < 0.03
    assert not any(record.unconfirmed for record in records[1:])
    assert all(record.state is TrackingState.OK for record in records)
    assert world.system.n_keyframes >= n_keyframes
    lost = world.system.trajectory().lost
    assert lost[-12:-6].all()
    assert not lost[-6:].any()
    assert world.system.check_map() == []


def test_a_dark_frame_becomes_a_keyframe(world: MappedWorld) -> None:
    """As when the camera looks at a window: the exposure falls for a second."""
    records = []
    for k in range(20):
        images = world.sequence.load(N_MAPPED + k)
        records.append(world.show(with_image(images, cv2.convertScaleAbs(images.image, alpha=0.3))))
    assert all(record.state is TrackingState.OK for record in records)
    assert any(record.is_keyframe for record in records[:8])


def test_a_jump_away_and_back(world: MappedWorld) -> None:
    options = SyntheticOptions(world="room", sensor=Sensor.RGBD, size=SIZE, noise=2, seed=7)
    elsewhere = SyntheticSequence(options)
    n_keyframes = world.system.n_keyframes
    away = [world.show(elsewhere.load(10 * k)) for k in range(12)]
    assert all(record.state is TrackingState.LOST for record in away)
    assert world.system.n_keyframes == n_keyframes
    back = [world.show(world.sequence.load(20 + k)) for k in range(5)]
    assert [record.state for record in back[1:]] == [TrackingState.OK] * 4
    assert off(world, back[-1], 24) < 0.03


def test_a_glimpse_is_not_believed(world: MappedWorld) -> None:
    """Found in one frame, and then there is nothing: the search goes on from the old place."""
    tracking = world.system.pipeline.tracking
    believed, reference = tracking.motion.last.id, tracking.reference_keyframe
    world.lose()
    glimpse = world.show(world.sequence.load(5))
    assert glimpse.unconfirmed
    assert tracking.motion.last.id == glimpse.frame_id
    world.lose()
    assert world.system.trajectory().lost[-3:].all(), "its pose is taken back"
    assert (tracking.motion.last.id, tracking.reference_keyframe) == (believed, reference)
    assert world.show(world.sequence.load(N_MAPPED)).state is TrackingState.OK


def test_who_asks_before_the_next_frame_gets_the_pose(world: MappedWorld) -> None:
    world.lose()
    found = world.show(world.sequence.load(N_MAPPED))
    assert found.unconfirmed
    path = world.system.trajectory()
    assert not path.lost[-1]
    assert len(path) == world._n_shown


def test_the_same_losses_give_the_same_bytes() -> None:
    paths = []
    for _ in range(2):
        world = MappedWorld(sequence(), range(N_MAPPED))
        world.lose(3)
        world.show(smeared(world.sequence.load(N_MAPPED + 3)))
        records = go_on(world, 6)
        assert records[-1].T_cw is not None
        paths.append(records[-1].T_cw.tobytes())
    assert paths[0] == paths[1]


# ---- the verb ------------------------------------------------------------------------------------
def described(world: MappedWorld, index: int) -> core.TrackedFrame:
    shown = world.sequence.load(index)
    assert shown.depth is not None
    frame = world.system.pipeline.front_end.rgbd(
        shown.image, shown.depth, index, 100.0, StageTimer()
    )
    core.describe(frame, world.system.vocabulary)
    return core.TrackedFrame(frame)


def new_relocalizer(
    world: MappedWorld, limits: RelocalizationConfig | None = None, *, words: bool = True
) -> Relocalizer:
    back_end = world.system.pipeline.back_end
    index = back_end.keyframe_index if words else core.KeyFrameIndex()
    return Relocalizer(
        back_end.map, index, 0, fix_scale=True, config=limits or RelocalizationConfig()
    )


class Search:
    """Searches lost frames one after the other, from a place of loss or from none."""

    def __init__(
        self,
        world: MappedWorld,
        limits: RelocalizationConfig | None = None,
        *,
        words: bool = True,
        lost_here: bool = True,
        with_velocity: bool = False,
    ) -> None:
        self._relocalizer = new_relocalizer(world, limits, words=words)
        tracking = world.system.pipeline.tracking
        motion, reference = tracking.motion, tracking.reference_keyframe
        velocity = motion.velocity if with_velocity else None
        place = LastKnownPose(motion.last, velocity, reference) if lost_here else None
        self._lost = LostSearch(place)

    def __call__(self, frame: core.TrackedFrame) -> Relocalization:
        found, self._lost = self._relocalizer.relocalize(frame, self._lost)
        return found


def test_near_the_place_of_loss_no_word_is_needed(world: MappedWorld) -> None:
    nowhere = Search(world, words=False, lost_here=False)
    assert nowhere(described(world, N_MAPPED + 5)) == Relocalization()
    frame = described(world, N_MAPPED + 5)
    assert Search(world, words=False, with_velocity=True)(frame).n_inliers >= 50
    assert frame.T_cw is not None


@pytest.mark.parametrize(("frames_since", "found"), [(10, True), (11, False)])
def test_where_its_motion_led_fewer_inliers_are_enough(
    world: MappedWorld, frames_since: int, found: bool
) -> None:
    limits = RelocalizationConfig(enough=10**6)
    last = world.system.pipeline.tracking.motion.last.id
    again = Search(world, limits)(described(world, last + frames_since))
    assert (again.n_inliers >= 30) == found


def test_the_window_grows_with_every_failure(
    world: MappedWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the path, where the first window does not reach."""
    monkeypatch.setattr(relocalizer, "_WIDENING", 10.0)
    monkeypatch.setattr(relocalizer, "_WIDEST", 40.0)
    monkeypatch.setattr(candidates, "_NEAR_CANDIDATES", 0)
    limits = RelocalizationConfig(guess_window=0.5)
    search = Search(world, limits, words=False)
    tries = [search(described(world, N_MAPPED + 6)).n_inliers for _ in range(6)]
    assert tries[0] == 0
    assert tries[-1] >= 50


def test_poses_that_are_verified_are_counted(
    world: MappedWorld, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert Search(world, lost_here=False)(described(world, 30)).n_inliers >= 50
    monkeypatch.setattr(pnp_verification, "_VERIFIED_POSES", 0)
    assert Search(world, lost_here=False)(described(world, 30)).n_inliers == 0
