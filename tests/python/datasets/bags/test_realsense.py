# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of the RealSense Viewer and SDK: calibration, places, times and units."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import BagSequence
from orbslam2py.settings import Sensor
from support import bags, realsense

SIZE = (96, 72)
GREY = [np.full(SIZE[::-1], 60 + i, np.uint8) for i in range(4)]
OTHERS = [image + 100 for image in GREY]
DEPTH = [np.full(SIZE[::-1], 1000 + i, np.uint16) for i in range(4)]
STAMPS = [realsense.CAMERA_START + i * bags.STEP for i in range(4)]


def pose(
    shift: tuple[float, float, float], turn: tuple[float, float, float] = (0, 0, 0)
) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array(turn, np.float64))[0]
    T[:3, 3] = shift
    return T


#: The right camera sees what is in the left one's middle 100 mm to its left.
RIGHT = pose((-0.1, 0, 0))


def sdk_pair(path: Path, **right: object) -> Path:
    left = realsense.sdk_stream("Infrared_1", GREY, 60, T_stream_reference=np.eye(4))
    given = {"T_stream_reference": RIGHT, "delay": 2_083_123, **right}
    made = realsense.sdk_stream("Infrared_2", OTHERS, 60, **given)  # type: ignore[arg-type]
    return realsense.write_sdk(path / "ir", [*left, *made])


def viewer_pair(path: Path, **right: object) -> Path:
    left = realsense.viewer_stream("Infrared_1", GREY, 60, T_stream_reference=np.eye(4))
    given = {"T_stream_reference": RIGHT, **right}
    made = realsense.viewer_stream("Infrared_2", OTHERS, 60, **given)  # type: ignore[arg-type]
    return bags.write(path / "ir", "rosbag1", [*left, *made])


@pytest.mark.parametrize("raw", [False, True])
def test_pair_of_the_sdk(tmp_path: Path, raw: bool, caplog: pytest.LogCaptureFixture) -> None:
    left = realsense.sdk_stream("Infrared_1", GREY, 60, T_stream_reference=np.eye(4), raw=raw)
    right = realsense.sdk_stream(
        "Infrared_2", OTHERS, 60, T_stream_reference=RIGHT, delay=2_083_123, raw=raw
    )
    sequence = BagSequence(realsense.write_sdk(tmp_path / "ir", [*left, *right]))
    assert sequence.sensor is Sensor.STEREO
    camera = sequence.settings.camera
    assert (camera.fx, camera.cx, camera.width) == (60, 47.5, 96)
    assert camera.bf == pytest.approx(60 * 0.1)
    assert sequence.settings.rectification is None
    assert [sequence.timestamp_text(i) for i in range(4)] == [
        f"{stamp // 10**9}.{stamp % 10**9:09d}" for stamp in STAMPS
    ]
    images = sequence.load(2)
    assert images.right is not None
    assert (images.image[0, 0], images.right[0, 0]) == (62, 162)
    assert "apart" not in caplog.text  # the stamps of the camera are equal
    assert "arrival" not in caplog.text


def test_pair_of_the_viewer(tmp_path: Path) -> None:
    sequence = BagSequence(viewer_pair(tmp_path))
    assert sequence.sensor is Sensor.STEREO
    assert sequence.settings.camera.bf == pytest.approx(60 * 0.1)
    assert sequence.timestamp_text(1) == "1700000000.173456789"


def test_cameras_that_do_not_look_the_same_way_are_rectified(tmp_path: Path) -> None:
    """The transform says how: OpenCV's rectification of the same numbers."""
    T = pose((-0.1, 0.004, 0.002), (0.02, -0.03, 0.01))
    settings = BagSequence(viewer_pair(tmp_path, T_stream_reference=T)).settings
    K = realsense.camera_matrix(60, SIZE)
    R1, R2, _, P2, *_ = cv2.stereoRectify(
        *(K, np.zeros(5), K, np.zeros(5), SIZE, T[:3, :3], T[:3, 3:]),
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=0,
    )
    assert settings.rectification is not None
    assert np.allclose(settings.rectification.left.R, R1, atol=1e-6)
    assert np.allclose(settings.rectification.right.R, R2, atol=1e-6)
    assert settings.camera.bf == pytest.approx(-P2[0, 3], rel=1e-6)
    assert settings.camera.bf / settings.camera.fx == pytest.approx(np.linalg.norm(T[:3, 3]))


@pytest.mark.parametrize(
    ("right", "message"),
    [
        ({"T_stream_reference": None}, "no transform in the bag does"),
        ({"T_stream_reference": np.full((4, 4), np.nan)}, "no transform in the bag does"),
        ({"T_stream_reference": pose((0.1, 0, 0))}, "stands to the left of the other one; exch"),
        ({"T_stream_reference": pose((0, -0.1, 0.01))}, r"are not side by side.*0\.100"),
        ({"T_stream_reference": np.eye(4)}, "do not contain the distance of the two cameras"),
        ({"reference": 7}, "no transform in the bag does"),  # a reference of its own
        ({"info": False}, r"no CameraInfo for /device_0/sensor_0/Infrared_2.*right_info=\.\.\."),
        ({"model": "F-Theta"}, "distortion model f-theta is not supported"),
        ({"model": "Modified Brown Conrady", "D": (0.1, 0, 0, 0, 0)}, "modified_brown_conrady is"),
    ],
)
def test_pairs_that_cannot_be_used(tmp_path: Path, right: dict[str, object], message: str) -> None:
    sequence = BagSequence(viewer_pair(tmp_path, **right))
    with pytest.raises(orb.DatasetError, match=message):
        _ = sequence.settings


@pytest.mark.parametrize(
    "text", ["rotation=1,0,0;translation=a", "", "rotation=1,2,3,4,5,6,7,8,9;translation=1,2,3"]
)
def test_transforms_that_are_none(
    tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture
) -> None:
    left = realsense.sdk_stream("Infrared_1", GREY, 60, T_stream_reference=np.eye(4))
    right = realsense.sdk_stream("Infrared_2", OTHERS, 60)
    wrong = bags.text(f"{realsense.stream('Infrared_2')}/tf/ref_1", 0, text)
    sequence = BagSequence(realsense.write_sdk(tmp_path / "ir", [*left, *right, wrong]))
    with pytest.raises(orb.DatasetError, match="no transform in the bag does"):
        _ = sequence.settings
    assert "is no rotation and shift, left out" in caplog.text


@pytest.mark.parametrize(
    ("right", "message"),
    [
        ({"clock": None}, "Infrared_2/image/data/compressed has no times of the camera beside it"),
        ({"clock": "System Time"}, r"different clocks \(Global Time, System Time\)"),
        ({"without_time": [0, 1, 3]}, "has no times of the camera beside it"),
    ],
)
def test_times_of_arrival(
    tmp_path: Path, right: dict[str, object], message: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Both streams are taken by the same clock, or by none."""
    sequence = BagSequence(sdk_pair(tmp_path, **right))
    assert len(sequence) == 4
    assert sequence.timestamps[0] == 0
    assert re.search(message, caplog.text)
    assert "the times of arrival are taken" in caplog.text


def test_an_image_without_its_time_is_left_out(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    sequence = BagSequence(sdk_pair(tmp_path, without_time=[1]))
    assert [sequence.load(i).image[0, 0] for i in range(len(sequence))] == [60, 62, 63]
    assert "1 image of /device_0/sensor_0/Infrared_2/image/data/compressed without" in caplog.text


@pytest.mark.parametrize(("units", "factor"), [(0.001, 1000), (0.0001, 10000), (0.00025, 4000)])
def test_units_of_depth(tmp_path: Path, units: float, factor: float) -> None:
    made = [
        *realsense.sdk_stream("Depth_0", DEPTH, 60, units=units, T_stream_reference=np.eye(4)),
        *realsense.sdk_stream("Color_0", GREY, 60, T_stream_reference=np.eye(4)),
    ]
    sequence = BagSequence(realsense.write_sdk(tmp_path / "rgbd", made))
    assert sequence.sensor is Sensor.RGBD
    assert sequence.settings.depth is not None
    assert sequence.settings.depth.raw_per_metre == factor


def test_units_of_depth_of_the_viewer(tmp_path: Path) -> None:
    name = "/device_0/sensor_0/option/Depth Units/value"
    made = [
        *realsense.viewer_stream("Depth_0", DEPTH, 60, T_stream_reference=np.eye(4)),
        *realsense.viewer_stream("Color_0", GREY, 60, T_stream_reference=np.eye(4)),
        bags.Made(name, bags.FLOAT, bags.START, (0.00025,)),
    ]
    settings = BagSequence(bags.write(tmp_path / "rgbd", "rosbag1", made)).settings
    assert settings.depth is not None
    assert settings.depth.raw_per_metre == 4000


def test_yuyv(tmp_path: Path) -> None:
    """The SDK writes this encoding in capitals: brightness is every other byte."""
    packed = np.full((72, 96, 2), 128, np.uint8)
    packed[:, :, 0] = 90
    topic = "/device_0/sensor_1/Color_0/image/data"
    made = bags.raw_image(topic, bags.START, packed.reshape(72, 192), "YUYV", frame="0")
    height, _, *rest = made.fields
    bag = bags.write(tmp_path / "c", "rosbag1", [replace(made, fields=(height, 96, *rest))])
    image = BagSequence(bag, settings="tum1").load(0).image
    assert image.shape == (72, 96, 3)
    assert np.ptp(image) == 0
    assert image[0, 0, 0] == round((90 - 16) * 255 / 219)


@pytest.mark.parametrize("layout", ["viewer", "sdk"])
def test_inverse_distortion(tmp_path: Path, layout: str) -> None:
    """The SDK's "Inverse Brown Conrady" leads from distorted points to undistorted ones."""
    D = (-0.05, 0.06, 0.001, -0.002, -0.02)
    if layout == "sdk":
        made = realsense.sdk_stream("Color_0", GREY, 60, inverse_D=D)
        bag = realsense.write_sdk(tmp_path / "c", made)
    else:
        made = realsense.viewer_stream("Color_0", GREY, 60, model="Inverse Brown Conrady", D=D)
        bag = bags.write(tmp_path / "c", "rosbag1", made)
    camera = BagSequence(bag, "mono").settings.camera
    x, y = (np.array([1.0, 70.0, 90.0]) - 47.5) / 60, (np.array([3.0, 20.0, 70.0]) - 35.5) / 60
    r2 = x * x + y * y
    f = 1 + D[0] * r2 + D[1] * r2**2 + D[4] * r2**3
    undistorted = np.stack(
        [
            x * f + 2 * D[2] * x * y + D[3] * (r2 + 2 * x * x),
            y * f + 2 * D[3] * x * y + D[2] * (r2 + 2 * y * y),
            np.ones(3),
        ],
        axis=1,
    )
    assert np.allclose(
        camera.project(undistorted), np.stack([x, y], 1) * 60 + (47.5, 35.5), atol=0.02
    )
    assert not np.allclose(camera.distortion, D, atol=0.01)
