# SPDX-License-Identifier: BSD-3-Clause
"""Settings from CameraInfo messages (REP 104, image_pipeline's conventions)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    Sensor,
    Settings,
    StereoRectification,
    settings_for_camera,
)

_MODELS = ("plumb_bob", "rational_polynomial", "radtan", "")
_ADVICE = "give the calibration with --settings"


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """What a CameraInfo tells.

    Attributes
    ----------
    what
        Name of the topic, and of the bag, for messages.
    K, D, R, P
        Raw camera matrix (3, 3) [pixels], raw distortion, rotation (3, 3) from raw to rectified
        coordinates, and rectified projection (3, 4).
    model
        Name of the distortion model.
    size
        Width and height of the images in pixels.
    """

    what: str
    K: FloatArray
    D: FloatArray
    R: FloatArray
    P: FloatArray
    model: str
    size: tuple[int, int]

    @classmethod
    def of(cls, message: Any, what: str) -> CameraInfo | None:
        """Read a message of ROS 1 or ROS 2; None if the camera was not calibrated."""
        K, D, R, P = (
            np.asarray(getattr(message, name, getattr(message, name.lower(), [])), np.float64)
            for name in "KDRP"
        )
        if K.size != 9 or P.size != 12 or not np.isfinite(K).all() or K[0] <= 0:
            return None
        rotation = R.reshape(3, 3) if R.size == 9 and R.any() else np.eye(3)
        size = (int(message.width), int(message.height))
        model = str(message.distortion_model)
        return cls(what, K.reshape(3, 3), D, rotation, P.reshape(3, 4), model, size)

    @property
    def is_undistorted(self) -> bool:
        """Whether raw images are rectified ones as they are."""
        same_K = not self.P[0, 0] or np.allclose(self.P[:, :3], self.K, rtol=0, atol=1e-6)
        return not self.D.any() and np.allclose(self.R, np.eye(3), rtol=0, atol=1e-9) and same_K

    @property
    def rectified_K(self) -> FloatArray:
        """Camera matrix of rectified images (3, 3); the raw one if there is no projection."""
        return self.P[:, :3] if self.P[0, 0] > 0 else self.K

    def distortion(self) -> FloatArray:
        """Return k1, k2, p1, p2, k3.

        Raises
        ------
        DatasetError
            If the model has other coefficients.
        """
        if self.model not in _MODELS:
            raise DatasetError(
                f"{self.what}: the distortion model {self.model} is not supported; record "
                f"rectified images (image_proc), or {_ADVICE} of undistorted ones"
            )
        if self.D[5:].any():
            raise DatasetError(
                f"{self.what}: distortion with {self.D.size} coefficients is not supported for "
                f"one camera; record rectified images (image_proc), or {_ADVICE} of such"
            )
        five = np.zeros(5)
        five[: min(5, self.D.size)] = self.D[:5]
        return five


def settings_of_camera(
    info: CameraInfo, sensor: Sensor, fps: float, *, rectified: bool, depth_factor: float | None
) -> Settings:
    """Make settings for one camera, with or without depth.

    Parameters
    ----------
    info
        Its calibration.
    sensor
        Monocular or RGB-D.
    fps
        Images per second.
    rectified
        Whether the images are rectified ones.
    depth_factor
        RGB-D: units of the depth images per metre.

    Raises
    ------
    DatasetError
        If the calibration cannot be used.
    """
    K = info.rectified_K if rectified else info.K
    k1, k2, p1, p2, k3 = (np.zeros(5) if rectified else info.distortion()).tolist()
    lens = {"k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3}
    try:
        camera = CameraSettings(**_pinhole(K, info.size), **lens, fps=fps, rgb=True)
        return settings_for_camera(camera, sensor, depth_factor=depth_factor)
    except SettingsError as error:
        raise DatasetError(f"{info.what}: {error}") from error


def settings_of_pair(
    left: CameraInfo, right: CameraInfo, fps: float, *, rectified: bool
) -> Settings:
    """Make settings for a pair: of its images as they are, or with the rectification of both.

    Parameters
    ----------
    left, right
        Calibration of the cameras.
    fps
        Images per second.
    rectified
        Whether the images are rectified ones.

    Raises
    ------
    DatasetError
        If the two do not tell where the cameras are to each other.
    """
    bf = float(left.P[0, 3] - right.P[0, 3])
    if not bf:
        raise DatasetError(
            f"{left.what} and {right.what} do not tell the distance of the two cameras (both P "
            f"have the same last column): each was calibrated alone; calibrate them as a pair, or "
            f"{_ADVICE}"
        )
    if bf < 0:
        raise DatasetError(
            f"by {right.what} that camera stands to the left of the other one; exchange the two "
            "with --topics left=...,right=..."
        )
    if np.abs(left.rectified_K - right.rectified_K).max() > 1e-3:
        raise DatasetError(
            f"{left.what} and {right.what} are no rectified pair: their P differ in more than the "
            f"last column; calibrate them as a pair, or {_ADVICE}"
        )
    rectification = None
    if not rectified and not (left.is_undistorted and right.is_undistorted):
        rectification = StereoRectification(left=_rectification(left), right=_rectification(right))
    try:
        camera = CameraSettings(**_pinhole(left.rectified_K, left.size), fps=fps, bf=bf, rgb=True)
        settings = settings_for_camera(camera, Sensor.STEREO)
        return Settings(
            sensor=Sensor.STEREO,
            camera=settings.camera,
            orb=settings.orb,
            depth=settings.depth,
            rectification=rectification,
        )
    except SettingsError as error:
        raise DatasetError(f"{left.what}: {error}") from error


def _pinhole(K: FloatArray, size: tuple[int, int]) -> dict[str, Any]:
    return {
        "fx": float(K[0, 0]),
        "fy": float(K[1, 1]),
        "cx": float(K[0, 2]),
        "cy": float(K[1, 2]),
        "width": size[0],
        "height": size[1],
    }


def _rectification(info: CameraInfo) -> CameraRectification:
    if info.model not in _MODELS:
        info.distortion()  # says that the model is not supported
    D = info.D if info.D.size in (4, 5, 8) else info.distortion()
    width, height = info.size
    try:
        return CameraRectification(K=info.K, D=D, R=info.R, P=info.P, width=width, height=height)
    except SettingsError as error:
        raise DatasetError(f"{info.what}: {error}") from error
