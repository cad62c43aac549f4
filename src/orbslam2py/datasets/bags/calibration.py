# SPDX-License-Identifier: BSD-3-Clause
"""Settings from CameraInfo messages (REP 104, image_pipeline's conventions)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.rectification import rectification_of_pair
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    Sensor,
    Settings,
    StereoRectification,
    settings_for_camera,
)
from orbslam2py.settings.defaults import USUAL_CLOSE_FACTOR
from orbslam2py.settings.pair_cameras import cameras_of_pair
from orbslam2py.settings.projection import distorted

_FISHEYES = ("equidistant", "fisheye", "kannala_brandt", "kannala_brandt4")
_MODELS = ("plumb_bob", "rational_polynomial", "radtan", "brown_conrady", "")
#: Models of the RealSense SDK that are none if all coefficients are 0, as a rule.
_NONE_IF_ZERO = ("none", "modified_brown_conrady")
_INVERSE = "inverse_brown_conrady"
#: Transforms of a rectified pair are off by no more than this (part of the distance, or radians).
_AS_RECTIFIED = 2e-4
#: Points per row and per column of the image at which it is sampled.
_SAMPLES = 25
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_ADVICE = "give the calibration with --settings"


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """The contents of a CameraInfo.

    Attributes
    ----------
    what
        Names of the topic and of the bag, for messages.
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
    def of(cls, message: Any, what: str, *, inverse: bool = False) -> CameraInfo | None:
        """Read a CameraInfo of ROS 1 or ROS 2; None if the camera was not calibrated.

        Parameters
        ----------
        message, what
            The message, and its name for error messages.
        inverse
            Whether its distortion maps distorted points to undistorted ones, against its
            description.
        """
        K, D, R, P = (
            np.asarray(getattr(message, name, getattr(message, name.lower(), [])), np.float64)
            for name in "KDRP"
        )
        if K.size != 9 or P.size != 12 or not np.isfinite(K).all() or K[0] <= 0:
            return None
        rotation = R.reshape(3, 3) if R.size == 9 and R.any() else np.eye(3)
        size = (int(message.width), int(message.height))
        model = str(message.distortion_model).lower().replace(" ", "_")
        K = K.reshape(3, 3)
        if not D.any() and model in _NONE_IF_ZERO:
            model = ""
        elif inverse or model == _INVERSE:
            D, model = inverted_distortion(K, D, size), "plumb_bob"
        return cls(what, K, D, rotation, P.reshape(3, 4), model, size)

    @property
    def is_undistorted(self) -> bool:
        """Whether raw images are already rectified."""
        same_K = not self.P[0, 0] or np.allclose(self.P[:, :3], self.K, rtol=0, atol=1e-6)
        return not self.D.any() and np.allclose(self.R, np.eye(3), rtol=0, atol=1e-9) and same_K

    @property
    def rectified_K(self) -> FloatArray:
        """Camera matrix of rectified images (3, 3); the raw one if there is no projection."""
        return self.P[:, :3] if self.P[0, 0] > 0 else self.K

    @property
    def is_fisheye(self) -> bool:
        """Whether the lens of the raw images is equidistant (Kannala-Brandt)."""
        return self.model in _FISHEYES

    @property
    def is_thin_prism(self) -> bool:
        """Whether D has s1 to s4 of OpenCV's thin prism model and no tilt of the sensor."""
        return bool(self.model in _MODELS and self.D[8:12].any() and not self.D[12:].any())

    def fisheye_lens(self) -> tuple[float, ...]:
        """Return k1, k2, k3, k4 of an equidistant lens.

        Raises
        ------
        DatasetError
            If there are fewer numbers, or further numbers that are not 0.
        """
        if self.D.size < 4 or self.D[4:].any():
            raise DatasetError(
                f"{self.what}: the distortion model {self.model} needs the 4 numbers k1, k2, k3, "
                f"k4, and D has {self.D.size}; {_ADVICE}"
            )
        return tuple(self.D[:4].tolist())

    def distortion(self) -> FloatArray:
        """Return k1, k2, p1, p2, k3, k4, k5, k6.

        Raises
        ------
        DatasetError
            If the model has other coefficients.
        """
        if self.is_fisheye:
            raise DatasetError(
                f"{self.what}: the distortion model {self.model} is not supported for "
                "depth of another camera, nor for a pair without a transform; use one camera "
                "(--sensor mono), record rectified images (image_proc), or "
                f"{_ADVICE} of undistorted ones"
            )
        if self.model not in _MODELS:
            raise DatasetError(
                f"{self.what}: the distortion model {self.model} is not supported; record "
                f"rectified images (image_proc), or {_ADVICE} of undistorted ones"
            )
        if self.D[8:].any():
            raise DatasetError(
                f"{self.what}: distortion with {self.D.size} coefficients is not supported, at "
                f"most 8 are; record rectified images (image_proc), or {_ADVICE} of such"
            )
        eight = np.zeros(8)
        eight[: min(8, self.D.size)] = self.D[:8]
        return eight


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
        Whether the images are rectified.
    depth_factor
        RGB-D: units of the depth images per metre.

    Raises
    ------
    DatasetError
        If the calibration cannot be used.
    """
    K = info.rectified_K if rectified else info.K
    lens: dict[str, Any] = {}
    if not rectified and info.is_fisheye:
        lens = {"model": "kannala_brandt", "lens": info.fisheye_lens()}
    elif not rectified and info.is_thin_prism:
        lens = {"model": "thin_prism", "lens": tuple(info.D[:12].tolist())}
    elif not rectified:
        lens = dict(zip(_COEFFICIENTS, info.distortion().tolist(), strict=True))
    try:
        camera = CameraSettings(**_pinhole(K, info.size), **lens, fps=fps, rgb=True)
        return settings_for_camera(camera, sensor, depth_factor=depth_factor)
    except SettingsError as error:
        raise DatasetError(f"{info.what}: {error}") from error


def settings_of_pair(
    left: CameraInfo,
    right: CameraInfo,
    fps: float,
    *,
    rectified: bool,
    T_right_left: FloatArray | None = None,
) -> Settings:
    """Make settings for a pair: of rectified images, or with the rectification of raw ones.

    Parameters
    ----------
    left, right
        Calibration of the cameras.
    fps
        Images per second.
    rectified
        Whether the images are rectified.
    T_right_left
        Transform (4, 4) from left to right camera coordinates [m], for calibrations without a
        baseline.

    Raises
    ------
    DatasetError
        If the relative pose of the two cameras is not known.
    """
    bf = float(left.P[0, 3] - right.P[0, 3])
    if not bf:
        return _settings_by_transform(left, right, fps, T_right_left, rectified=rectified)
    if bf < 0:
        raise _exchanged(right.what)
    if not rectified and (left.is_fisheye or right.is_fisheye):
        # P and R give the same as a transform.
        T = np.eye(4)
        T[:3, :3] = right.R.T @ left.R
        T[:3, 3] = right.R.T @ (-bf / left.rectified_K[0, 0], 0.0, 0.0)
        return _fisheye_settings(left, right, fps, T)
    if np.abs(left.rectified_K - right.rectified_K).max() > 1e-3:
        raise DatasetError(
            f"{left.what} and {right.what} are no rectified pair: their P differ in more than the "
            f"last column; calibrate them as a pair, or {_ADVICE}"
        )
    rectification = None
    if not rectified and not (left.is_undistorted and right.is_undistorted):
        rectification = StereoRectification(left=_rectification(left), right=_rectification(right))
    return _settings(left, left.rectified_K, fps, bf, rectification)


def _settings_by_transform(
    left: CameraInfo,
    right: CameraInfo,
    fps: float,
    T_right_left: FloatArray | None,
    *,
    rectified: bool,
) -> Settings:
    """Make settings for two cameras that were calibrated separately, by their relative pose."""
    T = np.eye(4) if T_right_left is None else T_right_left.copy()
    if rectified:  # images of one camera may have been turned when they were rectified
        T[:3, 3] = right.R @ T[:3, 3]
        T[:3, :3] = right.R @ T[:3, :3] @ left.R.T
    at = -T[:3, :3].T @ T[:3, 3]  # the right camera in the coordinates of the left one
    distance = float(np.linalg.norm(at))
    if distance < 1e-6:
        raise DatasetError(
            f"{left.what} and {right.what} do not contain the distance of the two cameras (both P "
            "have the same last column), and no transform in the bag does; record it with "
            f"/tf_static, calibrate the cameras as a pair, or {_ADVICE}"
        )
    names = f"{left.what} and {right.what}"
    if abs(at[0]) < np.linalg.norm(at[1:]):
        raise DatasetError(
            f"{names}: by the transform between them the cameras are not side by side (the "
            f"right one is at {_metres(at)} from the left one), as a pair must; use one of them "
            "(--sensor mono)"
        )
    if at[0] < 0:
        raise _exchanged("the transform between the two cameras", f"that of {right.what}")
    if not rectified and (left.is_fisheye or right.is_fisheye):
        return _fisheye_settings(left, right, fps, T)
    K = (left.rectified_K, right.rectified_K) if rectified else (left.K, right.K)
    D = [np.zeros(8) if rectified else info.distortion() for info in (left, right)]
    same_K = np.abs(K[0] - K[1]).max() <= 1e-3
    parallel = np.allclose(T[:3, :3], np.eye(3), rtol=0, atol=_AS_RECTIFIED)
    level = np.linalg.norm(at[1:]) <= _AS_RECTIFIED * distance
    if same_K and parallel and level and not np.any(D):
        return _settings(left, K[0], fps, float(K[0][0, 0]) * distance, None)
    if left.size != right.size:
        raise DatasetError(f"{names} are for images of different sizes; {_ADVICE}")
    try:
        found = rectification_of_pair(K, (D[0], D[1]), T, left.size)
    except SettingsError as error:
        raise DatasetError(f"{names}: {error}") from error
    P = found.right.P
    return _settings(left, P[:, :3], fps, -float(P[0, 3]), found)


def _fisheye_settings(
    left: CameraInfo, right: CameraInfo, fps: float, T_right_left: FloatArray
) -> Settings:
    """Make settings for a raw pair of which one camera at least is a fisheye."""
    if left.size != right.size:
        names = f"{left.what} and {right.what}"
        raise DatasetError(f"{names} are for images of different sizes; {_ADVICE}")
    first, second = (
        settings_of_camera(one, Sensor.MONOCULAR, fps, rectified=False, depth_factor=None).camera
        for one in (left, right)
    )
    try:
        pair = cameras_of_pair(first, second, T_right_left, left.size, "the transform in the bag")
        usual = settings_for_camera(first, Sensor.MONOCULAR)
        close = DepthSettings(close_factor=USUAL_CLOSE_FACTOR)
        return Settings(sensor=Sensor.STEREO, **pair.fields, orb=usual.orb, depth=close)
    except SettingsError as error:
        raise DatasetError(f"{left.what} and {right.what}: {error}") from error


def _exchanged(by: str, which: str = "that camera") -> DatasetError:
    return DatasetError(
        f"by {by} {which} stands to the left of the other one; exchange the two with "
        "--topics left=...,right=..."
    )


def _metres(at: FloatArray) -> str:
    return ", ".join(f"{number:.3f}" for number in at) + " m"


def _settings(
    left: CameraInfo,
    K: FloatArray,
    fps: float,
    bf: float,
    rectification: StereoRectification | None,
) -> Settings:
    try:
        camera = CameraSettings(**_pinhole(K, left.size), fps=fps, bf=bf, rgb=True)
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


def inverted_distortion(K: FloatArray, D: FloatArray, size: tuple[int, int]) -> FloatArray:
    """Find k1, k2, p1, p2, k3 that lead to distorted points, for numbers that lead away from them.

    The numbers of the RealSense SDK's "Inverse Brown Conrady" map distorted points to undistorted
    ones. The model in the other direction is linear in its coefficients.
    """
    u, v = np.meshgrid(*(np.linspace(0, n - 1, _SAMPLES) for n in size))
    seen_x, seen_y = (u.ravel() - K[0, 2]) / K[0, 0], (v.ravel() - K[1, 2]) / K[1, 1]
    x, y = distorted(np.stack([seen_x, seen_y], axis=1), D[:5]).T
    r2, xy = x * x + y * y, 2 * x * y
    columns_x = (x * r2, x * r2**2, xy, r2 + 2 * x * x, x * r2**3)
    columns_y = (y * r2, y * r2**2, r2 + 2 * y * y, xy, y * r2**3)
    A = np.hstack([columns_x, columns_y]).T
    found, *_ = np.linalg.lstsq(A, np.hstack([seen_x - x, seen_y - y]), rcond=None)
    return np.asarray(found, np.float64)


def _rectification(info: CameraInfo) -> CameraRectification:
    D = info.D if info.model in _MODELS and info.D.size in (4, 5, 8) else info.distortion()
    width, height = info.size
    try:
        return CameraRectification(K=info.K, D=D, R=info.R, P=info.P, width=width, height=height)
    except SettingsError as error:
        raise DatasetError(f"{info.what}: {error}") from error
