# SPDX-License-Identifier: BSD-3-Clause
"""Settings from the factory calibration of an OAK camera."""

from __future__ import annotations

import os
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

# Its warnings go to the standard output, where those of programs are that read ours.
os.environ.setdefault("DEPTHAI_LEVEL", "error")
import depthai as dai

from orbslam2py.datasets.bags.calibration import (
    CameraInfo,
    settings_of_camera,
    settings_of_pair,
)
from orbslam2py.errors import DatasetError
from orbslam2py.settings import ImuSettings, Sensor, Settings, imu_noise

__all__ = ["COLOUR", "DEPTH_PER_METRE", "LEFT", "RIGHT", "dai", "imu_settings_of", "settings_of"]

#: Where the cameras of an OAK-D are.
COLOUR, LEFT, RIGHT = (
    dai.CameraBoardSocket.CAM_A,
    dai.CameraBoardSocket.CAM_B,
    dai.CameraBoardSocket.CAM_C,
)
#: Units of depth images per metre.
DEPTH_PER_METRE = 1000.0
#: The chip of most OAK-D cameras, whose noise is taken.
_CHIP = "bmi270"
_ADVICE = "give --settings with a file; 'orbslam2py calibrate' makes one of a chessboard"


def settings_of(
    calibration: Any, name: str, kind: Sensor, size: tuple[int, int], fps: float
) -> Settings:
    """Make settings for a sensor.

    Parameters
    ----------
    calibration
        ``depthai.CalibrationHandler`` of the camera.
    name
        Name of the camera for messages.
    kind
        Stereo: the raw pair; RGB-D: colour without distortion, with depth; mono: raw left images.
    size
        Width and height of the images, pixels.
    fps
        Frames per second.

    Raises
    ------
    DatasetError
        If the camera was not calibrated, or its lens is not supported.
    """
    try:
        if kind is Sensor.STEREO:
            pair = [_info(calibration, name, socket, size) for socket in (LEFT, RIGHT)]
            T = np.array(calibration.getCameraExtrinsics(LEFT, RIGHT, False, dai.LengthUnit.METER))
            settings = settings_of_pair(pair[0], pair[1], fps, rectified=False, T_right_left=T)
        elif kind is Sensor.RGBD:
            colour = _info(calibration, name, COLOUR, size, is_undistorted=True)
            settings = settings_of_camera(
                colour, kind, fps, rectified=False, depth_factor=DEPTH_PER_METRE
            )
        else:
            left = _info(calibration, name, LEFT, size)
            settings = settings_of_camera(left, kind, fps, rectified=False, depth_factor=None)
    except RuntimeError as error:  # error of the library if the memory of the camera is empty
        raise DatasetError(f"{name} has no calibration ({error}); {_ADVICE}") from error
    return replace(settings, camera=replace(settings.camera, rgb=False))


def imu_settings_of(calibration: Any, kind: Sensor, rate: float) -> ImuSettings | None:
    """Return where the IMU is, with the usual noise; None if the camera does not give it."""
    socket = COLOUR if kind is Sensor.RGBD else LEFT
    try:
        T = calibration.getImuToCameraExtrinsics(socket, False, dai.LengthUnit.METER)
    except RuntimeError:
        return None
    noise = imu_noise(_CHIP)
    return ImuSettings(
        noise.gyro_noise,
        noise.accel_noise,
        noise.gyro_walk,
        noise.accel_walk,
        T_ci=np.array(T, np.float64),
        rate=rate,
    )


def _info(
    calibration: Any,
    name: str,
    socket: Any,
    size: tuple[int, int],
    *,
    is_undistorted: bool = False,
) -> CameraInfo:
    """Read the calibration of a camera for a size; undistorted images have no lens."""
    what = f"{name} ({socket.name})"
    model = calibration.getDistortionModel(socket)
    models = {
        dai.CameraModel.Perspective: "rational_polynomial",
        dai.CameraModel.Fisheye: "fisheye",
    }
    lens = [] if is_undistorted else list(calibration.getDistortionCoefficients(socket))
    message = SimpleNamespace(
        k=np.ravel(calibration.getCameraIntrinsics(socket, *size)),
        d=lens,
        r=[],
        p=np.zeros(12),
        width=size[0],
        height=size[1],
        distortion_model="" if is_undistorted else models.get(model, model.name),
    )
    info = CameraInfo.of(message, what)
    if info is None:
        raise DatasetError(f"{what} has no calibration; {_ADVICE}")
    return info
