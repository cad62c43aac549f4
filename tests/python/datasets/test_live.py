# SPDX-License-Identifier: BSD-3-Clause
"""Cameras: what they deliver, and when they fail."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, SettingsError, StateError
from orbslam2py.datasets import LiveCamera, MaskedCamera, live, open_input
from support.numbered_images import MONO, coloured, mask_image, number_of, with_size


class FakeCapture:
    """Delivers numbered images when it is told to."""

    def __init__(self, opened: bool = True) -> None:
        self.opened = opened
        self.allowed = threading.Semaphore(0)
        self.properties: dict[int, float] = {}
        self.n_read = 0
        self.broken = False
        self.released = False

    def isOpened(self) -> bool:
        return self.opened

    def set(self, prop: int, value: float, /) -> bool:
        self.properties[prop] = value
        return True

    def read(self) -> tuple[bool, object]:
        if not self.allowed.acquire(timeout=0.002 if self.broken else 0.3):
            return False, None
        self.n_read += 1
        return True, coloured(self.n_read)

    def release(self) -> None:
        self.released = True


def camera_of(capture: FakeCapture, **options: object) -> LiveCamera:
    return LiveCamera(0, settings="tum1", open_capture=lambda _: capture, **options)  # type: ignore[arg-type]


def wait_for(condition: object) -> None:
    deadline = time.monotonic() + 10
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_newest_image_wins_and_the_others_are_counted() -> None:
    capture = FakeCapture()
    with camera_of(capture) as camera:
        assert camera.take(0.0) is None
        for _ in range(5):
            capture.allowed.release()
        wait_for(lambda: camera.n_dropped == 4)
        frame = camera.take(5.0)
        assert frame is not None
        rgb = camera.settings.camera.rgb
        assert number_of(frame.images.image[..., ::-1] if rgb else frame.images.image) == 5
        assert camera.take(0.0) is None
        capture.allowed.release()
        second = camera.take(5.0)
        assert second is not None
        assert second.timestamp > frame.timestamp
        assert float(second.text) == second.timestamp
        assert abs(second.timestamp - time.time()) < 60
        assert camera.n_dropped == 4
    assert capture.released


def test_camera_is_iterated_until_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_WAIT_SLICE", 0.002)
    capture = FakeCapture()
    with camera_of(capture) as camera:
        seen = []
        capture.allowed.release()
        with pytest.raises(DatasetError, match="camera 0 sends no more images"):
            for frame in camera:
                seen.append(frame)
                if len(seen) < 3:
                    capture.allowed.release()
                capture.broken = len(seen) == 3
        assert len(seen) == 3


def test_camera_that_stays_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "_PATIENCE", 0.05)
    with (
        camera_of(FakeCapture()) as camera,
        pytest.raises(DatasetError, match="camera 0 has sent no image for"),
    ):
        for _ in camera:
            pass


def test_exception_in_the_capture_thread_arrives() -> None:
    capture = FakeCapture()

    def fail() -> tuple[bool, object]:
        raise OSError("cable")

    capture.read = fail  # type: ignore[method-assign]
    with (
        camera_of(capture) as camera,
        pytest.raises(DatasetError, match="camera 0 failed: cable"),
    ):
        wait_for(lambda: camera.take(0.1) is not None)


def test_camera_is_asked_for_size_and_rate() -> None:
    capture = FakeCapture()
    settings = with_size("euroc")
    camera = LiveCamera(0, settings=settings, fps=15, open_capture=lambda _: capture)
    camera.open()
    assert capture.properties == {
        cv2.CAP_PROP_FRAME_WIDTH: 752,
        cv2.CAP_PROP_FRAME_HEIGHT: 480,
        cv2.CAP_PROP_FPS: 15,
    }
    assert camera.settings.camera.fps == 15


def test_camera_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = camera_of(FakeCapture(opened=False))
    monkeypatch.setattr(live, "existing_cameras", lambda: [0, 2])
    with pytest.raises(DatasetError, match=r"camera 0 cannot be opened; it may be in use.*: 0, 2"):
        camera.open()
    monkeypatch.setattr(live, "existing_cameras", list)
    with pytest.raises(DatasetError, match="this machine has none"):
        camera.open()
    with pytest.raises(StateError, match="open the camera first"):
        camera.take(0.0)
    with pytest.raises(SettingsError, match="orbslam2py calibrate"):
        LiveCamera(0)


def test_number_that_is_no_file_is_a_camera(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DatasetError, match="camera 97 cannot be opened"):
        open_input("97", MONO, settings="tum1")
    with pytest.raises(DatasetError, match="--times does not go with a camera"):
        open_input(97, MONO, settings="tum1", times="t.txt")
    (tmp_path / "97").mkdir()
    cv2.imwrite(str(tmp_path / "97" / "a.png"), coloured(1))
    assert open_input("97", MONO, settings="tum1").layout == "images"


def test_camera_with_a_mask(tmp_path: Path) -> None:
    path = tmp_path / "mask.png"
    cv2.imwrite(str(path), mask_image())
    capture = FakeCapture()
    with MaskedCamera(camera_of(capture), path) as camera:
        assert camera.take(0.0) is None
        capture.allowed.release()
        frame = camera.take(5.0)
        assert frame is not None
        np.testing.assert_array_equal(frame.images.mask, mask_image())
        assert (camera.layout, camera.name, camera.n_dropped) == ("camera", "camera0", 0)
    with pytest.raises(DatasetError, match="a camera takes a single mask"):
        MaskedCamera(camera_of(FakeCapture()), tmp_path)
