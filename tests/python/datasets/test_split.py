# SPDX-License-Identifier: BSD-3-Clause
"""Videos and cameras that show both views side by side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from orbslam2py import DatasetError, Sensor
from orbslam2py.datasets import LiveCamera, open_input
from orbslam2py.settings import builtin_settings, settings_for_camera

H, W = 96, 128  # of a half
CAMERA = replace(builtin_settings("kitti04-12", Sensor.STEREO).camera, width=W, height=H)
STEREO = settings_for_camera(CAMERA, Sensor.STEREO)
MONO = settings_for_camera(replace(CAMERA, bf=0.0), Sensor.MONOCULAR)


def both(k: int) -> npt.NDArray[np.uint8]:
    image = np.full((H, 2 * W, 3), 40 + 8 * k, np.uint8)
    image[:, W:] += 100
    return image


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "stereo.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 25, (2 * W, H))
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write videos")
    for k in range(5):
        writer.write(both(k))
    writer.release()
    return path


def test_the_halves_of_a_video(video: Path) -> None:
    sequence = open_input(video, "stereo", settings=STEREO, split=True)
    for k in range(5):
        images = sequence.load(k)  # type: ignore[union-attr]
        assert images.right is not None
        assert images.image.shape == images.right.shape == (H, W, 3)
        assert images.image[:, : W - 16].mean() == pytest.approx(40 + 8 * k, abs=4)
        assert images.right[:, 16:].mean() == pytest.approx(140 + 8 * k, abs=4)


def test_the_left_half_alone(video: Path) -> None:
    images = open_input(video, "mono", settings=MONO, split=True).load(0)  # type: ignore[union-attr]
    assert images.right is None
    assert images.image.shape == (H, W, 3)


def test_a_video_twice_as_wide_is_refused(video: Path) -> None:
    with pytest.raises(DatasetError, match=r"256 x 96 pixels, twice as wide .* take --split"):
        open_input(video, settings=MONO)


def test_stereo_of_a_video_needs_split(video: Path) -> None:
    with pytest.raises(DatasetError, match=r"has no stereo images; .* side by side, take --split"):
        open_input(video, "stereo", settings=STEREO)


class Camera:
    """A camera that shows both views; keeps what it was asked for."""

    def __init__(self) -> None:
        self.asked: dict[int, float] = {}

    def isOpened(self) -> bool:
        return True

    def set(self, prop: int, value: float, /) -> bool:
        self.asked[prop] = value
        return True

    def read(self) -> tuple[bool, npt.NDArray[np.uint8]]:
        return True, both(2)

    def release(self) -> None:
        pass


def test_the_halves_of_a_camera() -> None:
    made = Camera()
    with LiveCamera(0, settings=STEREO, open_capture=lambda _: made, split=True) as camera:
        assert camera.sensor is Sensor.STEREO
        frame = camera.take(5.0)
    assert made.asked[cv2.CAP_PROP_FRAME_WIDTH] == 2 * W
    assert frame is not None
    assert frame.images.right is not None
    assert (frame.images.image == 56).all()
    assert (frame.images.right == 156).all()


def test_a_camera_twice_as_wide_is_refused() -> None:
    with (
        LiveCamera(0, settings=MONO, open_capture=lambda _: Camera()) as camera,
        pytest.raises(DatasetError, match="take --split"),
    ):
        camera.take(5.0)
