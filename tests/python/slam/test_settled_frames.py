# SPDX-License-Identifier: BSD-3-Clause
"""Frames are estimated once more in the finished map, and found precisely in a loaded one."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from orbslam2py import System, TrackingRecord, TrackingState, Trajectory
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(120)


def sequence_of(
    sensor: str, world: Literal["corridor", "room"] = "corridor", pace: float = 1.0
) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(
            world=world, sensor=sensor, frames=90, size=(320, 240), noise=1.5, pace=pace
        )
    )


def track(system: System, sequence: SyntheticSequence, indices: range) -> list[TrackingRecord]:
    return [system.track(sequence.load(i), float(sequence.timestamps[i])) for i in indices]


def error_of(path: Trajectory, sequence: SyntheticSequence) -> float:
    alignment = Alignment.SE3 if sequence.sensor.has_depth else Alignment.SIM3
    figures = evaluate_trajectory(path.select(~path.lost), sequence.ground_truth(), alignment)
    assert figures.ate is not None
    return figures.ate.rmse


@pytest.mark.parametrize("sensor", ["rgbd", "stereo", "mono"])
def test_frames_follow_their_points_when_the_system_ends(sensor: str) -> None:
    sequence = sequence_of(sensor, "room")
    with System(sequence.settings, sensor, deterministic=True) as system:
        track(system, sequence, range(len(sequence)))
        before = system.trajectory()
        keyframes = system.keyframe_trajectory()
    after = system.trajectory()
    moved = np.linalg.norm(after.T_wc[:, :3, 3] - before.T_wc[:, :3, 3], axis=1)
    is_keyframe = np.isin(after.timestamps, keyframes.timestamps)
    assert np.count_nonzero(moved[~is_keyframe]) > 0
    assert np.all(moved[is_keyframe] == 0)
    assert moved.max() < 0.05
    np.testing.assert_array_equal(after.lost, before.lost)
    assert error_of(after, sequence) < 1.02 * error_of(before, sequence)
    # Nothing waits any more: a second look changes nothing.
    system.shutdown()
    assert system.trajectory().T_wc.tobytes() == after.T_wc.tobytes()


def test_looking_on_changes_nothing() -> None:
    sequence = sequence_of("rgbd")
    paths = []
    for looks in (False, True):
        with System(sequence.settings, "rgbd", deterministic=True) as system:
            for i in range(40):
                track(system, sequence, range(i, i + 1))
                if looks:
                    system.trajectory()
        paths.append(system.trajectory())
    assert paths[0].T_wc.tobytes() == paths[1].T_wc.tobytes()


def test_in_a_map_that_stays_poses_are_those_that_were_told(tmp_path: Path) -> None:
    sequence = sequence_of("rgbd")
    with System(sequence.settings, "rgbd", deterministic=True) as system:
        track(system, sequence, range(60))
    system.save_map(tmp_path / "map.orbmap")
    with System(load_map=tmp_path / "map.orbmap", deterministic=True) as again:
        again.localization_mode = True
        records = track(again, sequence, range(60))
        before = again.trajectory()
    after = again.trajectory()
    assert after.T_wc.tobytes() == before.T_wc.tobytes()
    told = {record.timestamp: record.T_wc for record in records if record.T_wc is not None}
    found = after.select(~after.lost)
    assert len(found) >= 58
    # Relative to the first keyframe both.
    root = system.keyframe_trajectory().T_wc[0]
    for timestamp, T_wc in zip(found.timestamps, found.T_wc, strict=True):
        np.testing.assert_allclose(T_wc, np.linalg.inv(root) @ told[timestamp], atol=1e-9)


def test_a_camera_found_in_a_loaded_map_is_found_precisely(tmp_path: Path) -> None:
    sequence = sequence_of("mono", pace=3.0)
    half = 30
    with System(sequence.settings, "mono", deterministic=True) as system:
        track(system, sequence, range(half))
    system.save_map(tmp_path / "half.orbmap")
    with System(load_map=tmp_path / "half.orbmap", deterministic=True) as rest:
        records = track(rest, sequence, range(half, 50))
    assert all(record.state is TrackingState.OK for record in records)
    errors = [r.evidence.match_error for r in records if r.evidence is not None]
    # Wide windows find the camera; what the pose ends with is as good as that of later frames.
    assert errors[0] < 1.3 * np.median(errors)
    # The map of the rest begins with the frame that was found, or with the one that confirmed it.
    slam_map = rest.pipeline.back_end.map
    youngest = system.pipeline.back_end.map.keyframe_ids()[-1]
    made = [slam_map.keyframe_frame(int(k)).id for k in slam_map.keyframe_ids() if k > youngest]
    assert made[0] <= 1
