# SPDX-License-Identifier: BSD-3-Clause
"""The camera that calibration files of other programs are read into, and checks they share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings, Sensor, Settings, settings_for_camera
from orbslam2py.settings.keys import focal_problems


@dataclass(frozen=True, eq=False)
class CameraModel:
    """A pinhole camera with OpenCV's distortion.

    Attributes
    ----------
    K
        Camera matrix (3, 3), pixels.
    distortion
        k1, k2, p1, p2, k3, (5,).
    size
        Width and height [pixels]; None if the file does not tell.
    """

    K: FloatArray
    distortion: FloatArray
    size: tuple[int, int] | None

    def settings(self, fps: float) -> Settings:
        """Make settings for this camera alone."""
        camera = camera_settings(self.K, self.distortion, self.size, fps=fps)
        return settings_for_camera(camera, Sensor.MONOCULAR)


def camera_settings(
    K: NDArray[np.float64],
    distortion: NDArray[np.float64],
    size: tuple[int, int] | None,
    *,
    fps: float,
    rgb: bool = False,
) -> CameraSettings:
    """Camera settings of a matrix (3, 3) [pixels], five coefficients, and width and height."""
    k1, k2, p1, p2, k3 = distortion.tolist()
    width, height = size or (None, None)
    return CameraSettings(
        fx=K[0, 0],
        fy=K[1, 1],
        cx=K[0, 2],
        cy=K[1, 2],
        k1=k1,
        k2=k2,
        p1=p1,
        p2=p2,
        k3=k3,
        width=width,
        height=height,
        fps=fps,
        rgb=rgb,
    )


def checked_numbers(path: Path, where: str, value: object, count: tuple[int, ...]) -> FloatArray:
    """Make float64 (n,) finite numbers of a value in a file.

    Parameters
    ----------
    path, where
        The file and the place in it, for the message.
    value
        A number, or numbers nested in any way.
    count
        Lengths allowed; any if empty.

    Raises
    ------
    SettingsError
        If these are other than finite numbers, or not so many.
    """
    try:
        found = np.asarray(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        found = np.zeros(0)
        count = count or (1,)
    if (count and found.size not in count) or not np.isfinite(found).all():
        wanted = " or ".join(map(str, count))
        raise SettingsError(f"{path}: {where} must hold {wanted} finite numbers, found {value!r}")
    return found


def require_supported(path: Path, what: str, name: object, supported: tuple[str, ...]) -> None:
    """Raise `SettingsError` unless a model is one of those supported."""
    if name not in supported:
        raise SettingsError(
            f"{path}: {what} {name} is not supported; supported: {', '.join(supported)}. Calibrate "
            "anew with one of these, or undistort the images first"
        )


def checked_camera_matrix(
    path: Path, K: NDArray[Any], where: str = "the camera matrix"
) -> FloatArray:
    """Check a camera matrix (3, 3) [pixels].

    Parameters
    ----------
    path, where
        The file and the place in it, for the message.
    K
        The matrix.

    Raises
    ------
    SettingsError
        If there is skew, or a focal length is not above 0.
    """
    K = checked_numbers(path, where, K, (9,)).reshape(3, 3)
    for problem in focal_problems(where, K):
        raise SettingsError(f"{path}: {problem}")
    if abs(K[0, 1]) > 1e-6 * K[0, 0]:
        raise SettingsError(f"{path}: a camera with skew ({K[0, 1]:g}) is not supported")
    return K


def five_coefficients(path: Path, coefficients: NDArray[Any]) -> FloatArray:
    """Bring 0, 4, 5 or more coefficients to k1, k2, p1, p2, k3; float64 (5,).

    Raises
    ------
    SettingsError
        If there is another number of them, or further ones are not zero.
    """
    given = checked_numbers(path, "the distortion", coefficients, ())
    if given.size not in (0, 4, 5, 8, 12, 14):
        raise SettingsError(
            f"{path}: {given.size} distortion coefficients; there must be k1, k2, p1, p2 and "
            "perhaps k3"
        )
    if np.any(given[5:]):
        raise SettingsError(
            f"{path}: distortion with {given.size} coefficients (rational, thin prism or tilted "
            "model) is not supported; supported: k1, k2, p1, p2, k3"
        )
    five = np.zeros(5)
    five[: min(given.size, 5)] = given[:5]
    return five


def checked_size(path: Path, size: list[Any]) -> tuple[int, int]:
    """Check width and height of an image [pixels].

    Raises
    ------
    SettingsError
        If they are no whole numbers above 0.
    """
    width, height = (float(value) for value in size)
    if not (width.is_integer() and height.is_integer() and min(width, height) >= 1):
        raise SettingsError(f"{path}: an image size of {width:g} x {height:g} makes no sense")
    return int(width), int(height)
