# SPDX-License-Identifier: BSD-3-Clause
"""Frames before and right after the start of a single camera's map: no pose is wrong."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import System, open_sequence
from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._timing import StageTimer
from orbslam2py.evaluation import match_poses
from orbslam2py.slam import pipeline
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.frame_recorder import FrameRecorder
from orbslam2py.slam.initialization import MonocularInitializer
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import rotation_angles
from support.moved_frames import MovedByAMetre

pytestmark = pytest.mark.watchdog(120)


def turns(T_wc: FloatArray) -> FloatArray:
    """Degrees from each pose to the next."""
    R = T_wc[:, :3, :3]
    return np.degrees(rotation_angles(np.swapaxes(R[:-1], 1, 2) @ R[1:]))


@pytest.mark.shared
def test_a_frame_that_lies_beyond_the_map_is_left_out(shared_data: Path) -> None:
    """A drone takes off: tracked backwards to there, frames were believed 18 degrees off."""
    sequence = open_sequence(shared_data / "sequences" / "drone_semicircle", "mono")
    with System(sequence.settings, "mono", deterministic=True) as system:
        for i in range(40):
            system.track_monocular(sequence.load(i).image, float(sequence.timestamps[i]))
        path = system.trajectory()
    assert len(path) >= 30
    truth = sequence.ground_truth()
    assert truth is not None
    known = path.select(~path.lost)
    seen, true = match_poses(known, truth)
    assert len(seen) == len(known)
    errors = turns(known.T_wc) - turns(truth.T_wc[true])
    # One seed in three has a frame that is off by 1.2 degrees; the truth is that of markers.
    assert np.abs(errors[np.diff(known.indices) == 1]).max() < 2.0


class Corridor:
    """A walk along a corridor, and the recorded path after each image."""

    def __init__(self, n: int) -> None:
        self.sequence = SyntheticSequence(
            SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1, frames=n)
        )
        self.n_keyframes: list[int] = []
        self.n_young: list[int] = []
        with System(self.sequence.settings, "mono", deterministic=True) as system:
            recorder = system.pipeline.recorder
            for i in range(n):
                system.track_monocular(self.sequence.load(i).image, i / 20)
                self.n_keyframes.append(system.n_keyframes)
                self.n_young.append(recorder.n_young)
            self.path = system.trajectory()


def test_the_frames_of_the_start_are_looked_at_once_the_map_has_settled() -> None:
    walk = Corridor(60)
    settled = pipeline._SETTLED_MAP
    begun = int(np.argmax(np.array(walk.n_young) > 0))
    looked = next(i for i, n in enumerate(walk.n_keyframes) if n > settled) + 1
    assert walk.n_young[looked - 1] == looked  # from the very first frame on
    assert walk.n_young[looked:] == [0] * (60 - looked)
    assert begun < looked - 5
    assert list(walk.path.indices) == list(range(60))
    assert not walk.path.lost.any()


def test_poses_that_are_estimated_again_replace_the_first_ones() -> None:
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=3)
    )
    moved = MovedByAMetre()
    with System(sequence.settings, "rgbd", deterministic=True) as system:
        for i in range(3):
            images = sequence.load(i)
            system.track_rgbd(images.image, images.depth, i / 20)
        slam_map = system.pipeline.back_end.map
        frames = []
        for i in range(3):
            images = sequence.load(i)
            frame = core.TrackedFrame(
                system.pipeline.front_end.rgbd(
                    images.image, images.depth, i, i / 20, StageTimer(), None
                )
            )
            frame.T_cw = core.Pose(np.array([0.0, 0, 0, 1]), np.array([0, 0, float(i)]))
            core.anchor_frame(slam_map, frame, 0)
            frames.append(frame)
        recorder = FrameRecorder(slam_map, moved)
        recorder.begin(frames[:2])
        recorder.record(frames[2], lost=True)
        assert recorder.n_young == 3
        before = recorder.trajectories()[0]
        recorder.reestimate_first_frames()
        after = recorder.trajectories()[0]
        assert recorder.n_young == 0
        recorder.settle()
        finished = recorder.trajectories()[0]
    assert moved.seen[:3] == [0, 1, 2]
    # Once more when the map is finished, from where they were found.
    assert moved.seen[3:] == [0, 1]
    assert moved.finished == [False] * 3 + [True] * 2
    assert list(after.lost) == list(finished.lost) == [False, False, True]
    assert after.positions[:, 2] == pytest.approx(before.positions[:, 2] + 1.0)
    assert finished.positions[:2, 2] == pytest.approx(before.positions[:2, 2] + 2.0)


# ---- views between the two that begin a map ------------------------------------------------------
def begun(sequence: SyntheticSequence) -> System:
    """A system that has just begun its map."""
    system = System(sequence.settings, "mono", deterministic=True)
    for i in range(len(sequence)):
        if system.track_monocular(sequence.load(i).image, i / 20).T_cw is not None:
            return system
    raise AssertionError("no map began")


@pytest.fixture(scope="module")
def room() -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="room", sensor="mono", size=(320, 240), frames=30, pace=2)
    )


@pytest.mark.parametrize("all_of_them", [False, True])
def test_kept_views_that_see_the_points_otherwise_become_keyframes(
    all_of_them: bool, room: SyntheticSequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[int, float]] = []
    added: list[int] = []
    original = MonocularInitializer._adds

    def adds(start: MonocularInitializer, frame: core.TrackedFrame, n_points: int) -> bool:
        asked.append((frame.id, frame.n_associated() / n_points))
        kept = any(view.frame.id == frame.id for view in start._kept.views)
        assert original(start, frame, n_points) == (kept and asked[-1][1] < 0.9)
        if original(start, frame, n_points) or all_of_them:
            added.append(frame.id)
        return added[-1:] == [frame.id]

    monkeypatch.setattr(MonocularInitializer, "_adds", adds)
    with begun(room) as system:
        slam_map = system.pipeline.back_end.map
        frames = {slam_map.keyframe_frame(k).id for k in slam_map.keyframe_ids()}
        first, second = min(frames), system.pipeline.tracking.motion.last.id
        assert asked, "there are frames between the two"
        assert all(first < frame < second for frame, _ in asked)
        # Those that add nothing to the others are culled at once.
        assert frames <= {first, second, *added}
        if all_of_them:
            assert frames & set(added)
        assert core.check_invariants(slam_map, require_words=True) == []
        initializer = system.pipeline.tracking._initializer
        assert initializer.n_between() == len(frames & set(added))
        monkeypatch.setattr(initializer, "_begun_map", slam_map.active_map - 1)
        assert initializer.n_between() == 0, "another map is active"


def test_views_between_do_not_make_a_young_map_a_firm_one(
    room: SyntheticSequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(MonocularInitializer, "_adds", lambda *_: True)
    with begun(room) as system:
        tracking = system.pipeline.tracking
        limits = replace(TrackingConfig(), small_map=2)
        monkeypatch.setattr(tracking._search, "limits", limits)
        assert system.n_keyframes > limits.small_map
        assert tracking._is_small


def test_the_speed_is_known_from_the_first_frame_on(room: SyntheticSequence) -> None:
    with begun(room) as system:
        motion = system.pipeline.tracking.motion
        path = system.trajectory()
        assert motion.velocity is not None
        # Mapping, which comes after it, moves the map a little.
        T_cl = np.linalg.inv(path.T_wc[-1]) @ path.T_wc[-2]
        np.testing.assert_allclose(motion.velocity.step.matrix, T_cl, atol=0.02)
