# SPDX-License-Identifier: BSD-3-Clause
"""Frames that came early, or all of them, are matched with the finished map once more."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.slam import frame_recorder
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.effort import Effort
from orbslam2py.slam.frame_recorder import FrameRecorder
from orbslam2py.slam.frame_reestimation import FrameReestimation
from orbslam2py.slam.pose_search import LocalMapSearch, PoseSearch, RefinedPose
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.vocabulary import load_vocabulary
from support.moved_frames import MovedByAMetre

pytestmark = pytest.mark.watchdog(120)

N = 12
ASIDE = core.Pose(np.array([0.0, np.sin(0.02), 0, np.cos(0.02)]), np.array([0.12, 0.03, 0]))


class Walk:
    """A few frames of a corridor, tracked with depth, and the map that they made."""

    def __init__(self) -> None:
        sequence = SyntheticSequence(
            SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=N)
        )
        self.frames: list[core.TrackedFrame] = []
        # Matched by corners: aligned frames are left alone once their images are gone.
        by_corners = {"alignment.rgbd": False}
        self.system = System(sequence.settings, "rgbd", deterministic=True, config=by_corners)
        for i in range(N):
            images = sequence.load(i)
            self.system.track_rgbd(images.image, images.depth, i / 20)
            self.frames.append(self.system.pipeline.tracking.motion.last)
        self.map = self.system.pipeline.back_end.map
        self.reestimation = FrameReestimation(
            self.map,
            PoseSearch(self.map, load_vocabulary(), Sensor.RGBD, None, TrackingConfig()),
        )

    def no_keyframe(self) -> core.TrackedFrame:
        """The last frame that is none."""
        keyframes = {self.map.keyframe_frame(k).id for k in self.map.keyframe_ids()}
        return next(frame for frame in reversed(self.frames) if frame.id not in keyframes)

    def put_aside(self, frame: core.TrackedFrame) -> core.TrackedFrame:
        """A version of the frame with a pose that is wrong, and its points."""
        version = core.TrackedFrame(frame.features)
        version.copy_associations(frame, np.ones(len(frame.features), bool))
        assert frame.T_cw is not None
        version.T_cw = ASIDE @ frame.T_cw
        core.anchor_frame(self.map, version, frame.reference_keyframe)
        return version


@pytest.fixture(scope="module")
def walk() -> Iterator[Walk]:
    walk = Walk()
    yield walk
    walk.system.shutdown()


def way(first: core.TrackedFrame, second: core.TrackedFrame) -> float:
    """Metres from one to the other."""
    assert first.T_cw is not None and second.T_cw is not None
    return float(np.linalg.norm((first.T_cw @ second.T_cw.inverse()).matrix[:3, 3]))


def test_a_frame_is_found_where_it_was(walk: Walk) -> None:
    frame = walk.no_keyframe()
    aside = walk.put_aside(frame)
    assert way(aside, frame) > 0.1
    found = walk.reestimation(aside)
    assert way(found, frame) < 0.01
    assert way(aside, frame) > 0.1, "what was tracked stays as it is"
    again = walk.reestimation(aside)
    assert again.T_cw is not None and found.T_cw is not None
    np.testing.assert_array_equal(again.T_cw.matrix, found.T_cw.matrix)


def test_a_frame_that_sees_nothing_of_the_map_keeps_its_pose(walk: Walk) -> None:
    frame = walk.no_keyframe()
    blind = core.TrackedFrame(frame.features)
    assert frame.T_cw is not None
    behind = core.Pose(np.array([0.0, 1, 0, 0]), np.zeros(3))
    blind.T_cw = behind @ frame.T_cw
    core.anchor_frame(walk.map, blind, frame.reference_keyframe)
    found = walk.reestimation(blind)
    assert way(found, blind) < 1e-9


def test_a_keyframe_keeps_its_pose(walk: Walk) -> None:
    first = walk.frames[0]
    assert way(walk.reestimation(first), first) < 1e-9


def test_a_pose_that_was_taken_back_is_not_looked_for(walk: Walk) -> None:
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved, every_frame=True)
    recorder.record(walk.frames[0], lost=False)
    recorder.doubt(walk.frames[1])
    recorder.record(walk.frames[1], lost=False)
    recorder.record(walk.frames[2], lost=True)
    recorder.settle()
    assert moved.seen == [0]
    assert list(recorder.trajectory().lost) == [False, True, True]


def test_every_frame_is_looked_at_where_that_is_asked_for(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame_recorder, "_MOST_WAITING", 3)
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved, every_frame=True)
    for frame in walk.frames:
        recorder.record(frame, lost=frame.id == 5, fixed_map=frame.id == 6)
    # Of too many the oldest does not wait for the end.
    every = [number for number in range(N) if number not in (5, 6)]
    assert moved.seen == every[:-3]
    recorder.settle()
    assert moved.seen == every
    assert list(recorder.trajectory().indices) == list(range(N))
    recorder.settle()
    assert len(moved.seen) == N - 2, "once"


@pytest.mark.parametrize("effort", list(Effort))
def test_thorough_looks_at_every_frame(effort: Effort, monkeypatch: pytest.MonkeyPatch) -> None:
    looked: list[int] = []
    original = FrameReestimation.__call__

    def note(
        self: FrameReestimation, frame: core.TrackedFrame, **options: bool
    ) -> core.TrackedFrame:
        looked.append(frame.id)
        return original(self, frame, **options)

    monkeypatch.setattr(FrameReestimation, "__call__", note)
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=6)
    )
    with System(sequence.settings, "rgbd", deterministic=True, effort=effort) as system:
        for i in range(6):
            images = sequence.load(i)
            system.track_rgbd(images.image, images.depth, i / 20)
        assert looked == []
    assert looked == (list(range(6)) if effort is Effort.THOROUGH else [])


# ---- frames of young maps ------------------------------------------------------------------------
def young(walk: Walk, frames: list[core.TrackedFrame]) -> FrameRecorder:
    """A recorder whose map has begun with the first of these frames, and settled with the last."""
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved)
    recorder.begin(frames[:1])
    for frame in frames[1:]:
        recorder.record(frame, lost=False)
    recorder.reestimate_first_frames()
    moved.seen.clear()
    return recorder


def seen_at_the_end(recorder: FrameRecorder) -> list[int]:
    recorder.settle()
    moved = recorder._second_look
    assert isinstance(moved, MovedByAMetre)
    return moved.seen


def test_frames_of_a_young_map_are_looked_at_again_the_youngest_of_many(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorder = young(walk, walk.frames[:5])
    recorder.record(walk.frames[5], lost=False)
    assert seen_at_the_end(recorder) == [0, 1, 2, 3, 4]
    monkeypatch.setattr(frame_recorder, "_MOST_WITH_KEYPOINTS", 3)
    assert seen_at_the_end(young(walk, walk.frames[:8])) == [5, 6, 7]


def test_frames_that_were_localised_while_a_map_was_young_stay(walk: Walk) -> None:
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved)
    recorder.begin(walk.frames[:1])
    recorder.record(walk.frames[1], lost=False, fixed_map=True)
    recorder.record(walk.frames[2], lost=True)
    recorder.reestimate_first_frames()
    moved.seen.clear()
    recorder.settle()
    assert moved.seen == [0]


def test_looks_at_old_frames_leave_those_of_a_young_map_alone(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They may be of another map, and came before."""
    monkeypatch.setattr(frame_recorder, "_MOST_WAITING", 3)
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved, every_frame=True)
    for frame in walk.frames[:4]:
        recorder.record(frame, lost=False)
    assert moved.seen == [0]
    recorder.begin(walk.frames[4:5])
    for frame in walk.frames[5:8]:
        recorder.record(frame, lost=False)
    assert len(moved.seen) > 2
    assert recorder.n_young == 4
    recorder.settle()
    assert recorder.n_young == 4


def test_a_map_that_ends_is_finished_others_are_not(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = MovedByAMetre()
    recorder = FrameRecorder(walk.map, moved, every_frame=True)
    recorder.record(walk.frames[9], lost=False)
    recorder.end_map(walk.map.active_map + 1)
    assert moved.seen == []
    recorder.end_map(walk.map.active_map)
    assert moved.seen == [9]
    recorder.settle()
    assert moved.seen == [9], "once"


def test_only_the_last_look_is_matched_from_nothing(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[tuple[int, bool]] = []

    def note(_: LocalMapSearch, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        looked.append((refined.frame.id, in_doubt))
        return refined

    monkeypatch.setattr(LocalMapSearch, "rematch", note)
    frame = walk.no_keyframe()
    walk.reestimation(frame, finished=False)
    assert looked == []
    walk.reestimation(frame)
    assert looked == [(frame.id, False)]


def test_an_aligned_frame_without_images_is_left_alone(
    walk: Walk, monkeypatch: pytest.MonkeyPatch
) -> None:
    looked: list[int] = []

    def note(_: LocalMapSearch, refined: RefinedPose, *, in_doubt: bool) -> RefinedPose:
        looked.append(refined.frame.id)
        return refined

    class Aligned:
        def any(self) -> bool:
            return True

    monkeypatch.setattr(LocalMapSearch, "rematch", note)
    frame = walk.no_keyframe()
    monkeypatch.setattr(type(frame), "aligned", Aligned())
    walk.reestimation(frame)
    assert looked == []
