# SPDX-License-Identifier: BSD-3-Clause
"""Settings files of ORB-SLAM3 and stella_vslam: read with the right numbers."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.settings import CameraSettings, OrbSettings, Sensor, Settings
from orbslam2py.settings.check import read_choice
from support import other_settings as texts
from support.settings_files import DEPTH, MATRIX, MONO, write

DISTORTION = [-0.28, 0.07, 0.0002, 0.0001]


def load(folder: Path, text: str, sensor: Sensor = Sensor.MONOCULAR) -> Settings:
    (folder / "a.yaml").write_text(text)
    return Settings.load(folder / "a.yaml", sensor)


def test_one_camera_of_orb_slam3(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    settings = load(tmp_path, texts.MONO_V1)
    camera = settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (460.5, 459.5, 321.5, 238.5)
    assert camera.distortion.tolist() == DISTORTION
    assert (camera.width, camera.height, camera.fps, camera.rgb) == (640, 480, 20.0, True)
    assert settings.orb == OrbSettings(1200)
    (warning,) = caplog.messages
    assert warning.endswith("do not describe the camera: System.*, Viewer.imageViewScale")


def test_rational_distortion_of_orb_slam3(tmp_path: Path) -> None:
    more = "Camera1.k3: 0.01\nCamera1.k4: 0.3\nCamera1.k5: -0.02\nCamera1.k6: 0.004\n"
    camera = load(tmp_path, texts.MONO_V1 + more).camera
    assert camera.distortion.tolist() == [*DISTORTION, 0.01, 0.3, -0.02, 0.004]


def test_depth_camera_of_orb_slam3(tmp_path: Path) -> None:
    settings = load(tmp_path, texts.RGBD_V1, Sensor.RGBD)
    assert settings.camera.distortion.tolist() == DISTORTION
    assert settings.baseline == pytest.approx(0.075)
    assert settings.camera.bf == 0.075 * 460.5
    assert settings.close_depth == pytest.approx(3.0)
    assert settings.depth_factor == 5000.0


def test_rectified_pair_of_orb_slam3(tmp_path: Path) -> None:
    settings = load(tmp_path, texts.RECTIFIED_V1, Sensor.STEREO)
    assert settings.camera.bf == pytest.approx(0.11 * 460.5)
    assert settings.rectification is None
    assert not settings.camera.is_distorted


def test_raw_pair_of_orb_slam3(tmp_path: Path) -> None:
    """A point in space is drawn into one row of the rectified pair, at the right disparity."""
    settings = load(tmp_path, texts.PAIR_V1, Sensor.STEREO)
    pair, camera = settings.rectification, settings.camera
    assert pair is not None
    assert not camera.is_distorted
    assert settings.baseline == pytest.approx(np.linalg.norm(texts.T_C1_C2[:3, 3]))
    assert pair.left.D.tolist() == DISTORTION
    assert pair.right.D.tolist() == [-0.27, 0.06, -0.0001, 0.0003]
    np.testing.assert_array_equal(pair.right.K, [[458, 0, 318], [0, 457, 241], [0, 0, 1]])
    in_left = np.array([[0.3, -0.2, 4.0], [-0.5, 0.4, 2.5]])
    T_c2_c1 = np.linalg.inv(texts.T_C1_C2)
    in_right = in_left @ T_c2_c1[:3, :3].T + T_c2_c1[:3, 3]
    seen = []
    for raw, points in ((pair.left, in_left), (pair.right, in_right)):
        image = cv2.projectPoints(points, np.zeros(3), np.zeros(3), raw.K, raw.D)[0]
        seen.append(cv2.undistortPoints(image, raw.K, raw.D, R=raw.R, P=raw.P)[:, 0])
    np.testing.assert_allclose(seen[0][:, 1], seen[1][:, 1], atol=0.01)
    depth = (in_left @ pair.left.R.T)[:, 2]
    np.testing.assert_allclose(seen[0][:, 0] - seen[1][:, 0], camera.bf / depth, atol=0.01)
    # The left camera alone is the raw one.
    assert load(tmp_path, texts.PAIR_V1).camera.distortion.tolist() == DISTORTION


def test_half_renamed_files_keep_their_distortion(tmp_path: Path) -> None:
    text = texts.MONO_V1
    for name in ("fx", "fy", "cx", "cy"):
        text = text.replace(f"Camera1.{name}", f"Camera.{name}")
    assert load(tmp_path, text) == load(tmp_path, texts.MONO_V1)


def test_keys_of_older_versions_and_forks(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    extra = (
        'Camera.type: "PinHole"\nCamera.bFishEye: 0\nCamera.imageScale: 1.0\nInsertKFsWhenLost: 0\n'
        "Viewer.on: 1\nPointCloudMapping.Resolution: 0.01\nLoopClosing.minimumKeyFrames: 10\n"
        "sensor_processor/type: structured_light\nloopClosing: 1\nthFarPoints: 5\n"
        "Camera.newWidth: 640\nCamera.width: 640\n"
    )
    path = write(tmp_path / "a.yaml", {**MONO, **DEPTH}, extra)
    settings = Settings.load(path, Sensor.RGBD)
    assert settings.camera == CameraSettings(517.3, 516.4, 318.6, 255.3, width=640, bf=40.0)
    (warning,) = caplog.messages
    assert "InsertKFsWhenLost, Viewer.on, PointCloudMapping.*, LoopClosing.*" in warning
    assert "sensor_processor/type, loopClosing and 1 more" in warning


def test_a_fourth_coefficient_of_0_beside_tangential_ones_is_no_fisheye(tmp_path: Path) -> None:
    more = {"Camera.k1": "0.1", "Camera.p1": "0", "Camera.p2": "0", "Camera.k4": "0.0"}
    path = write(tmp_path / "a.yaml", {**MONO, **more})
    assert Settings.load(path, Sensor.MONOCULAR).camera.distortion.tolist() == [0.1, 0, 0, 0]


def test_a_rectification_is_not_used_for_one_camera(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    pair = MATRIX + MATRIX.replace("LEFT", "RIGHT")
    Settings.load(write(tmp_path / "a.yaml", MONO, pair), Sensor.MONOCULAR)
    assert "it must have the numbers of LEFT.K and LEFT.D" in caplog.text


def test_stella_vslam(tmp_path: Path) -> None:
    settings = load(tmp_path, texts.STELLA)
    assert settings.camera == CameraSettings(
        *(460.5, 459.5, 321.5, 238.5, -0.28, 0.07, 0.0002, 0.0001, 0.01),
        width=640,
        height=480,
        fps=20.0,
        rgb=True,
    )
    assert settings.orb == OrbSettings(1000, 1.3, 7, 21, 8)
    camera = texts.STELLA.partition("Camera:\n")[2].partition("\n\n")[0]
    flat = camera.replace("  ", "Camera.")
    flat += "\nFeature.max_num_keypoints: 1500\nFeature.scale_factor: 1.3\n"
    assert load(tmp_path, flat).camera == settings.camera
    assert load(tmp_path, flat).orb == OrbSettings(1500, 1.3)


def test_depth_camera_of_stella_vslam(tmp_path: Path) -> None:
    settings = load(tmp_path, texts.STELLA_RGBD, Sensor.RGBD)
    assert settings.camera.bf == 34.5
    assert settings.depth is not None
    assert (settings.depth.close_factor, settings.depth_factor) == (40.0, 5000.0)


def test_raw_pair_of_stella_vslam(tmp_path: Path) -> None:
    settings = load(tmp_path, texts.STELLA_STEREO, Sensor.STEREO)
    pair = settings.rectification
    assert pair is not None
    np.testing.assert_array_equal(pair.right.K, [[458, 0, 318], [0, 457, 241], [0, 0, 1]])
    np.testing.assert_array_equal(pair.right.R, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    assert pair.left.D.tolist() == [*DISTORTION, 0.0]
    assert pair.right.P[0].tolist() == [460.5, 0, 321.5, -50.0]
    assert settings.camera.bf == 50.0
    assert settings.doubts() == []
    # The left camera alone is the raw one, not the rectified one.
    assert load(tmp_path, texts.STELLA_STEREO).camera.distortion.tolist() == DISTORTION


@pytest.mark.parametrize(
    ("text", "sensor"),
    [
        (texts.MONO_V1, "mono"),
        (texts.RGBD_V1, "rgbd"),
        (texts.PAIR_V1, "stereo"),
        (texts.STELLA, "mono"),
        (texts.STELLA_RGBD, "rgbd"),
        (texts.STELLA_STEREO, "stereo"),
    ],
)
def test_they_can_be_written_as_ours(tmp_path: Path, text: str, sensor: str) -> None:
    settings = load(tmp_path, text, Sensor(sensor))
    assert Settings.from_yaml(settings.to_yaml(), sensor) == settings
    assert read_choice(tmp_path / "a.yaml").usable_sensors()[0] is Sensor(sensor)
