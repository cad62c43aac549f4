# SPDX-License-Identifier: BSD-3-Clause
"""A RealSense camera without hardware: the software device of the SDK, fed by a test."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

rs: Any = pytest.importorskip(
    "pyrealsense2",
    reason="pip install orbslam2py[realsense], and libusb-1.0-0 of the system",
    exc_type=ImportError,
)

#: Stamps of the first images, milliseconds on a clock of the hardware.
BEGIN = 5000.0
SERIAL = "031422250347"


class SoftwareRealSense:
    """Infrared pair, depth, colour, gyro and accelerometer of one size and rate.

    Parameters
    ----------
    K
        Focal lengths and principal point of all cameras, pixels.
    size
        Width and height, pixels.
    fps
        Images per second.
    baseline
        Distance of the infrared cameras, metres.
    T_colour_depth
        Translation from the depth camera (the left infrared one) to the colour camera, metres.
    """

    def __init__(
        self,
        K: tuple[float, float, float, float],
        size: tuple[int, int],
        fps: int = 30,
        baseline: float = 0.05,
        T_colour_depth: tuple[float, float, float] = (0.0, 0.0, 0.0),
        T_ci: tuple[float, float, float] = (0.01, 0.02, 0.03),
    ) -> None:
        self._K, self._size, self.fps = K, size, fps
        self.device = rs.software_device()
        self.device.register_info(rs.camera_info.serial_number, SERIAL)
        self.device.register_info(rs.camera_info.name, "Software RealSense")
        self.stereo = self.device.add_sensor("Stereo Module")
        self.colour = self.device.add_sensor("RGB Camera")
        self.motion = self.device.add_sensor("Motion Module")
        self.profiles = {
            "left": self._video(self.stereo, rs.stream.infrared, 1, 0, rs.format.y8, 1),
            "right": self._video(self.stereo, rs.stream.infrared, 2, 1, rs.format.y8, 1),
            "depth": self._video(self.stereo, rs.stream.depth, 0, 2, rs.format.z16, 2),
            "image": self._video(self.colour, rs.stream.color, 0, 3, rs.format.bgr8, 3),
            "gyro": self._motion(rs.stream.gyro, 4, 200),
            "accel": self._motion(rs.stream.accel, 5, 100),
        }
        self.stereo.add_read_only_option(rs.option.depth_units, 0.001)
        on_or_off = rs.option_range()
        on_or_off.min, on_or_off.max, on_or_off.step, on_or_off.default = 0, 1, 1, 1
        self.stereo.add_option(rs.option.emitter_enabled, on_or_off, True)
        self.stereo.set_option(rs.option.emitter_enabled, 1)
        left = self.profiles["left"]
        left.register_extrinsics_to(self.profiles["right"], _shift((-baseline, 0.0, 0.0)))
        left.register_extrinsics_to(self.profiles["depth"], _shift((0.0, 0.0, 0.0)))
        depth = self.profiles["depth"]
        depth.register_extrinsics_to(self.profiles["image"], _shift(T_colour_depth))
        for name in ("left", "image"):
            self.profiles["gyro"].register_extrinsics_to(self.profiles[name], _shift(T_ci))
        self._n = 0

    def find(self) -> Any:
        """What the SDK gives for a camera that is plugged in."""
        return self.device

    def _video(self, sensor: Any, kind: Any, index: int, uid: int, form: Any, bpp: int) -> Any:
        fx, fy, cx, cy = self._K
        intrinsics = rs.intrinsics()
        intrinsics.width, intrinsics.height = self._size
        intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = fx, fy, cx, cy
        intrinsics.model, intrinsics.coeffs = rs.distortion.brown_conrady, [0.0] * 5
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid, stream.fmt = kind, index, uid, form
        stream.width, stream.height, stream.fps, stream.bpp = *self._size, self.fps, bpp
        stream.intrinsics = intrinsics
        return sensor.add_video_stream(stream)

    def _motion(self, kind: Any, uid: int, fps: int) -> Any:
        stream = rs.motion_stream()
        stream.type, stream.index, stream.uid, stream.fps = kind, 0, uid, fps
        stream.fmt, stream.intrinsics = rs.format.motion_xyz32f, rs.motion_device_intrinsic()
        return self.motion.add_motion_stream(stream)

    def send_image(self, name: str, pixels: np.ndarray, milliseconds: float) -> None:
        """Deliver an image of one stream, as the camera would."""
        pixels = np.ascontiguousarray(pixels)
        frame = rs.software_video_frame()
        frame.bpp = pixels.itemsize * (pixels.shape[2] if pixels.ndim == 3 else 1)
        frame.pixels, frame.stride = pixels, pixels.shape[1] * frame.bpp
        frame.timestamp = BEGIN + milliseconds
        frame.domain = rs.timestamp_domain.hardware_clock
        self._n += 1
        frame.frame_number = round(milliseconds * self.fps / 1e3)
        frame.profile = self.profiles[name].as_video_stream_profile()
        if name == "depth":
            frame.depth_units = 0.001
        (self.colour if name == "image" else self.stereo).on_video_frame(frame)

    def send_motion(self, name: str, value: np.ndarray, milliseconds: float) -> None:
        """Deliver a sample of gyro or accelerometer."""
        frame = rs.software_motion_frame()
        data = rs.vector()
        data.x, data.y, data.z = map(float, value)
        frame.data = data
        frame.timestamp = BEGIN + milliseconds
        frame.domain = rs.timestamp_domain.hardware_clock
        frame.frame_number = round(milliseconds)
        frame.profile = self.profiles[name].as_motion_stream_profile()
        self.motion.on_motion_frame(frame)


def _shift(translation: tuple[float, float, float]) -> Any:
    extrinsics = rs.extrinsics()
    extrinsics.rotation = [1.0, 0, 0, 0, 1, 0, 0, 0, 1]
    extrinsics.translation = list(translation)
    return extrinsics


def paced(n: int, seconds: float, send: Callable[[int], None]) -> None:
    """Send frames one after the other, each at its time."""
    begin = time.monotonic()
    for k in range(n):
        time.sleep(max(0.0, begin + k * seconds - time.monotonic()))
        send(k)
