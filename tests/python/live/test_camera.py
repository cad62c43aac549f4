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
from orbslam2py.datasets import MaskedCamera, open_input
from orbslam2py.live import LiveCamera, capture, open_source, stream
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


def camera_of(made: FakeCapture, **options: object) -> LiveCamera:
    return LiveCamera(0, settings="tum1", open_capture=lambda _: made, **options)  # type: ignore[arg-type]


def wait_for(condition: object) -> None:
    deadline = time.monotonic() + 10
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < deadline
        time.sleep(0.002)


def test_newest_image_wins_and_the_others_are_counted() -> None:
    made = FakeCapture()
    with camera_of(made) as camera:
        assert camera.take(0.0) is None
        for _ in range(5):
            made.allowed.release()
        wait_for(lambda: camera.n_dropped == 4)
        frame = camera.take(5.0)
        assert frame is not None
        rgb = camera.settings.camera.rgb
        assert number_of(frame.images.image[..., ::-1] if rgb else frame.images.image) == 5
        assert camera.take(0.0) is None
        made.allowed.release()
        second = camera.take(5.0)
        assert second is not None
        assert second.timestamp > frame.timestamp
        assert float(second.text) == second.timestamp
        assert abs(second.timestamp - time.time()) < 60
        assert camera.n_dropped == 4
    assert made.released


def test_a_camera_that_was_unplugged_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(capture, "_PAUSE", 0.001)
    monkeypatch.setattr(stream, "_RETRY", 0.01)
    monkeypatch.setattr(stream, "_WAIT_SLICE", 0.002)
    made = FakeCapture()
    with camera_of(made) as camera:
        seen = []
        made.allowed.release()
        for frame in camera:
            seen.append(frame)
            made.broken = len(seen) == 2
            if len(seen) == 2:
                # Nothing comes, it is opened again, and then there are images again.
                wait_for(lambda: camera.counts()["restarts"] == 2)
                made.broken = False
            made.allowed.release()
            if len(seen) == 5:
                break
    assert [f.timestamp for f in seen] == sorted(f.timestamp for f in seen)
    assert camera.doubts[0] == "camera 0 sends no more images; was it unplugged?; waiting for it"
    assert "camera 0 is back after" in camera.doubts[-1]


def test_patience_with_a_camera_that_stays_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "SILENCE", 0.05)
    monkeypatch.setattr(stream, "_RETRY", 0.01)
    with (
        camera_of(FakeCapture(), patience=0.2) as camera,
        pytest.raises(DatasetError, match="camera 0 was lost and did not come back"),
    ):
        for _ in camera:
            pass
    assert "camera 0 has sent no image for" in camera.doubts[0]


def test_exception_in_the_capture_thread_arrives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "_RETRY", 0.01)
    made = FakeCapture()

    def fail() -> tuple[bool, object]:
        raise OSError("cable")

    made.read = fail  # type: ignore[method-assign]
    with camera_of(made) as camera:
        wait_for(lambda: camera.doubts)
    assert camera.doubts[0] == "camera 0 failed: cable; waiting for it"


def test_camera_is_asked_for_size_and_rate() -> None:
    made = FakeCapture()
    settings = with_size("euroc")
    camera = LiveCamera(0, settings=settings, fps=15, open_capture=lambda _: made)
    with camera:
        pass
    assert made.properties == {
        cv2.CAP_PROP_FRAME_WIDTH: 752,
        cv2.CAP_PROP_FRAME_HEIGHT: 480,
        cv2.CAP_PROP_FPS: 15,
    }
    assert camera.settings.camera.fps == 15


def test_camera_that_cannot_be_opened(monkeypatch: pytest.MonkeyPatch) -> None:
    camera = camera_of(FakeCapture(opened=False))
    monkeypatch.setattr(capture, "existing_cameras", lambda: [0, 2])
    with pytest.raises(DatasetError, match=r"camera 0 cannot be opened; it may be in use.*: 0, 2"):
        camera.open()
    monkeypatch.setattr(capture, "existing_cameras", list)
    with pytest.raises(DatasetError, match="this machine has none"):
        camera.open()
    with pytest.raises(StateError, match="open camera 0 first"):
        camera.take(0.0)
    with pytest.raises(SettingsError, match="orbslam2py calibrate"):
        LiveCamera(0)


def test_sources_that_are_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for source, message in {
        "v4l:front": "v4l:front names no camera; give its number or its file",
        "v4l:97": r"v4l:97 cannot be opened; .*(this machine has none|cameras of this machine)",
        "v4l:/dev/video97": "v4l:/dev/video97 cannot be opened",
        "rtsp:///path": "names no host; give rtsp://HOST/PATH",
        "kinect:": "'kinect:' is no kind of live source; there are: realsense:, oak:, v4l:0",
    }.items():
        with pytest.raises(DatasetError, match=message):
            open_source(source, MONO, settings="tum1")
    with pytest.raises(DatasetError, match="v4l:97 has no IMU; leave out --imu"):
        open_source("v4l:97", MONO, settings="tum1", imu=True)
    with pytest.raises(DatasetError, match="--topics is for a bag, which v4l: is not"):
        open_source("v4l:97", MONO, settings="tum1", topics="left=/a")
    with pytest.raises(DatasetError, match=r"v4l:97 has no stereo images.*take --split"):
        open_source("v4l:97", "stereo", settings="euroc")
    with pytest.raises(SettingsError, match="no settings for v4l:97"):
        open_source("v4l:97")
    (tmp_path / "v4l:0").mkdir()  # a file of that name goes first
    cv2.imwrite(str(tmp_path / "v4l:0" / "a.png"), coloured(1))
    assert open_source("v4l:0", MONO, settings="tum1").layout == "images"


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
    made = FakeCapture()
    with MaskedCamera(camera_of(made), path) as camera:
        assert camera.take(0.0) is None
        made.allowed.release()
        frame = camera.take(5.0)
        assert frame is not None
        np.testing.assert_array_equal(frame.images.mask, mask_image())
        assert (camera.layout, camera.name, camera.n_dropped) == ("camera", "camera0", 0)
    with pytest.raises(DatasetError, match="a camera takes a single mask"):
        MaskedCamera(camera_of(FakeCapture()), tmp_path)
