# SPDX-License-Identifier: BSD-3-Clause
"""Settings files that are read."""

from __future__ import annotations

import copy
import math
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, Settings
from support.settings_files import DEPTH, MATRIX, MONO, write


# ---- reading -------------------------------------------------------------------------------------
def test_smallest_file(tmp_path: Path) -> None:
    settings = Settings.load(write(tmp_path / "a.yaml", MONO), Sensor.MONOCULAR)
    assert settings.camera == CameraSettings(517.3, 516.4, 318.6, 255.3)
    assert settings.camera.fps == 30.0
    assert not settings.camera.rgb
    assert settings.orb == OrbSettings()
    assert settings.depth is None
    assert settings.baseline == 0.0
    assert settings.close_depth == math.inf


def test_derived_quantities(tmp_path: Path) -> None:
    values = {**MONO, **DEPTH, "Camera.fps": "29.97", "DepthMapFactor": "5000"}
    settings = Settings.load(write(tmp_path / "a.yaml", values), Sensor.RGBD)
    assert settings.baseline == pytest.approx(40 / 517.3)
    assert settings.close_depth == pytest.approx(40 * 40 / 517.3)
    assert settings.max_keyframe_interval == 29
    assert settings.depth_factor == 5000


def test_rates_below_one_still_allow_a_frame(tmp_path: Path) -> None:
    """The original's largest spacing of keyframes becomes 0 (OD-5)."""
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.fps": "0.5"})
    assert Settings.load(path, Sensor.MONOCULAR).max_keyframe_interval == 1


def test_rate_of_zero_is_unknown(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.fps": "0"})
    assert Settings.load(path, Sensor.MONOCULAR).camera.fps == 30.0


def test_spellings_that_opencv_reads(tmp_path: Path) -> None:
    text = "%YAML:1.0\r\n---\n" + "".join(f"{k}:{v}   # why not\n" for k, v in MONO.items())
    path = tmp_path / "a.yaml"
    path.write_text(text + "Viewer.PointSize:2\nCamera.RGB: 1.0\n")
    settings = Settings.load(path, Sensor.MONOCULAR)
    assert settings.camera.fx == 517.3
    assert settings.camera.rgb is True
    assert settings.viewer.point_size == 2


def test_matrices(tmp_path: Path) -> None:
    text = MATRIX + MATRIX.replace("LEFT", "RIGHT")
    settings = Settings.load(write(tmp_path / "a.yaml", {**MONO, **DEPTH}, text), Sensor.STEREO)
    assert settings.rectification is not None
    left = settings.rectification.left
    np.testing.assert_array_equal(left.K[1], [0, 457.296, 248.375])
    assert left.D.shape == (5,)
    assert left.P.shape == (3, 4)
    assert (left.width, left.height) == (752, 480)
    for same in (left, copy.deepcopy(left), pickle.loads(pickle.dumps(left))):
        np.testing.assert_array_equal(same.K, left.K)
        with pytest.raises(ValueError, match="read-only"):
            same.K[0, 0] = 1


def test_what_other_sensors_need_is_not_looked_at(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.bf": "-1", "ThDepth": "x"}, MATRIX)
    assert Settings.load(path, Sensor.MONOCULAR).rectification is None


def test_keys_of_orb_slam3_are_read_past(tmp_path: Path) -> None:
    extra = 'File.version: "1.0"\nCamera.type: "PinHole"\nIMU.NoiseGyro: 1e-3\nStereo.b: 0.1\n'
    assert Settings.load(write(tmp_path / "a.yaml", MONO, extra), Sensor.MONOCULAR)


def test_opencv_reads_the_spelling_without_a_blank_alike(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", MONO, "Viewer.PointSize:2\n")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    ours = Settings.load(path, Sensor.MONOCULAR).viewer.point_size
    assert ours == storage.getNode("Viewer.PointSize").real() == 2


def test_scalars_are_those_of_opencv(tmp_path: Path) -> None:
    values = {**MONO, **DEPTH, "Camera.k1": "-1.5e-05", "Camera.k2": "+0.25", "Camera.p1": "7"}
    path = write(tmp_path / "a.yaml", values, MATRIX + MATRIX.replace("LEFT", "RIGHT"))
    ours = Settings.load(path, Sensor.STEREO)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "bf"):
        assert getattr(ours.camera, name) == storage.getNode(f"Camera.{name}").real()
    assert ours.rectification is not None
    for name in "DKRP":
        # Not `mat`: that of OpenCV 4.11 makes nonsense of whole numbers.
        data = storage.getNode(f"RIGHT.{name}").getNode("data")
        expected = [data.at(i).real() for i in range(data.size())]
        np.testing.assert_array_equal(np.ravel(getattr(ours.rectification.right, name)), expected)


# ---- real files ----------------------------------------------------------------------------------
@pytest.mark.shared
def test_file_of_a_real_sequence(shared_data: Path) -> None:
    path = shared_data / "sequences" / "7scenes_redkitchen_head250" / "settings.yaml"
    settings = Settings.load(path, Sensor.RGBD)
    assert settings.camera.fx == 525.0
    assert settings.depth_factor == 1000.0
    assert settings.camera.rgb
