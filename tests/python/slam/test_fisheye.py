# SPDX-License-Identifier: BSD-3-Clause
"""The whole system through lenses that no pinhole stands for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.maps import load_map
from orbslam2py.settings import CameraSettings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.lenses import DISTORTED, FISHEYE, VERY_WIDE


def tracked(
    lens: CameraSettings, sensor: str, frames: int
) -> tuple[orb.System, SyntheticSequence, list[orb.TrackingRecord]]:
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=frames, lens=lens)
    sequence = SyntheticSequence(options)
    slam = orb.System(sequence.settings, sensor, deterministic=True)
    records = []
    for i in range(len(sequence)):
        images = sequence.load(i)
        arrays = (images.image,) if images.depth is None else (images.image, images.depth)
        records.append(slam.track(arrays, float(sequence.timestamps[i])))
    return slam, sequence, records


def error_of(slam: orb.System, sequence: SyntheticSequence) -> float:
    alignment = "se3" if sequence.sensor.has_depth else "sim3"
    result = evaluate_trajectory(slam.trajectory(), sequence.ground_truth(), alignment)
    assert result.ate is not None
    return result.ate.rmse


@pytest.mark.parametrize("lens", [FISHEYE, VERY_WIDE, DISTORTED], ids=["150", "200", "distorted"])
def test_rgbd_path_through_a_lens(lens: CameraSettings, tmp_path: Path) -> None:
    slam, sequence, records = tracked(lens, "rgbd", 24)
    assert all(record.T_cw is not None for record in records)
    path = tmp_path / "room.orbmap"
    slam.save_map(path)
    contents = slam.map_contents()
    slam.shutdown()
    assert error_of(slam, sequence) < 0.01
    loaded = load_map(path)
    assert contents.first_difference(loaded.contents) is None
    model = loaded.contents.cameras.camera_model(0)
    assert model == (lens.camera_model(lens.width or 0, lens.height or 0) if lens.lens else None)
    with orb.System(sequence.settings, "rgbd", load_map=path, deterministic=True) as again:
        assert contents.first_difference(again.map_contents()) is None
        images = sequence.load(5)
        record = again.track((images.image, images.depth), 100.0)
    assert record.T_cw is not None, "relocalized in the loaded map"


def test_one_camera_sees_points_behind_itself() -> None:
    slam, sequence, records = tracked(VERY_WIDE, "mono", 40)
    lost = [record.frame_id for record in records[10:] if record.T_cw is None]
    contents = slam.map_contents()
    slam.shutdown()
    assert not lost
    T_cw = contents.keyframes.T_cw[-1]
    points = contents.points.positions @ T_cw[:3, :3].T + T_cw[:3, 3]
    assert np.count_nonzero(points[:, 2] < 0) > 10
    assert error_of(slam, sequence) < 0.01
