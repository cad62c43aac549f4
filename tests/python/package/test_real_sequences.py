# SPDX-License-Identifier: BSD-3-Clause
"""The loaders on real sequences, as far as they are there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, open_sequence
from orbslam2py.datasets import Layout
from orbslam2py.settings import builtin_settings
from orbslam2py.trajectory import read_tum

pytestmark = pytest.mark.shared

CASES = [
    ("7scenes_redkitchen_head250", Layout.TUM, Sensor.RGBD, 250, (480, 640, 3)),
    ("7scenes_redkitchen_head250", Layout.TUM, Sensor.MONOCULAR, 250, (480, 640, 3)),
    ("kitti_03_left_head120", Layout.KITTI, Sensor.MONOCULAR, 120, (375, 1242)),
    ("kitti_06_head51_stereo", Layout.KITTI, Sensor.STEREO, 51, (370, 1226)),
    ("kitti_06_head51_stereo", Layout.KITTI, Sensor.MONOCULAR, 51, (370, 1226)),
    ("euroc_V1_01_still8", Layout.EUROC, Sensor.STEREO, 8, (480, 752)),
    ("euroc_V1_01_keyframes", Layout.EUROC, Sensor.STEREO, 100, (480, 752)),
    ("euroc_V1_01_keyframes", Layout.EUROC, Sensor.MONOCULAR, 100, (480, 752)),
]


@pytest.mark.parametrize(("name", "layout", "sensor", "n_frames", "shape"), CASES)
def test_opens_without_settings(
    shared_data: Path,
    name: str,
    layout: Layout,
    sensor: Sensor,
    n_frames: int,
    shape: tuple[int, ...],
) -> None:
    sequence = open_sequence(shared_data / "sequences" / name, sensor)
    assert sequence.layout is layout
    assert len(sequence) == n_frames
    for index in (0, n_frames - 1):
        images = sequence.load(index)
        assert images.image.shape == shape
        assert (images.right is not None) == (sensor is Sensor.STEREO)
        assert (images.depth is not None) == (sensor is Sensor.RGBD)
        if images.right is not None:
            assert images.right.shape == shape
    assert sequence.settings.sensor is sensor
    truth = sequence.ground_truth()
    assert truth is not None
    assert np.all(np.diff(truth.timestamps) > 0)


def test_own_association_equals_the_shipped_one(shared_data: Path, tmp_path: Path) -> None:
    folder = shared_data / "sequences" / "7scenes_redkitchen_head250"
    for name in ("rgb.txt", "depth.txt", "rgb", "depth"):
        (tmp_path / name).symlink_to(folder / name)
    ours, shipped = open_sequence(tmp_path, settings="tum1"), open_sequence(folder)
    assert len(ours) == len(shipped)
    np.testing.assert_array_equal(ours.timestamps, shipped.timestamps)
    np.testing.assert_array_equal(ours.load(7).depth, shipped.load(7).depth)


def test_calibrated_and_builtin_kitti_agree(shared_data: Path) -> None:
    own = open_sequence(shared_data / "sequences" / "kitti_06_head51_stereo").settings
    builtin = builtin_settings("kitti06", Sensor.STEREO)
    assert own.camera.matrix == pytest.approx(builtin.camera.matrix)
    assert own.camera.bf == builtin.camera.bf
    assert own.max_keyframe_interval == 10


def test_calibrated_and_builtin_euroc_nearly_agree(shared_data: Path) -> None:
    folder = shared_data / "sequences" / "euroc_V1_01_still8"
    sequence = open_sequence(folder)
    camera = sequence.settings.camera
    assert (camera.fx, camera.cx, camera.cy, camera.bf) == pytest.approx(
        (436.24, 364.44, 256.95, 48.02), abs=5e-3
    )
    assert sequence.settings.baseline == pytest.approx(
        builtin_settings("euroc", Sensor.STEREO).baseline, rel=1e-4
    )
    # The same place in the room lies on the same row of both images, with either calibration.
    for settings in (None, "euroc"):
        images = open_sequence(folder, settings=settings).load(0)
        assert images.right is not None
        assert abs(_row_offset(images.image, images.right)) <= 1


def test_euroc_ground_truth_is_the_one_of_cam0(shared_data: Path) -> None:
    folder = shared_data / "sequences" / "euroc_V1_01_keyframes"
    truth = open_sequence(folder, Sensor.MONOCULAR).ground_truth()
    expected = read_tum(folder / "groundtruth_cam0_tum.txt")
    assert truth is not None
    np.testing.assert_allclose(truth.T_wc, expected.T_wc, atol=1e-5)
    np.testing.assert_allclose(truth.timestamps, expected.timestamps, atol=1e-6)


def test_plain_images_are_no_sequence(shared_data: Path) -> None:
    with pytest.raises(DatasetError, match="no known sequence"):
        open_sequence(shared_data / "sequences" / "rtabmap_samples_loop")


def _row_offset(left: np.ndarray, right: np.ndarray) -> int:
    """Rows by which the right image must be shifted to look most alike, whatever the column."""
    profiles = [
        np.abs(np.diff(pixels.astype(float), axis=0)).mean(axis=1)[20:-20]
        for pixels in (left, right)
    ]
    shifts = range(-5, 6)
    scores = [np.corrcoef(profiles[0], np.roll(profiles[1], shift))[0, 1] for shift in shifts]
    return shifts[int(np.argmax(scores))]
