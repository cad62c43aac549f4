# SPDX-License-Identifier: BSD-3-Clause
"""Numbers of a camera in files of other programs: the checks that all formats share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings, Sensor
from orbslam2py.settings.camera_model import CameraModel
from orbslam2py.settings.fisheye import PINHOLE
from orbslam2py.settings.foreign import filled_line
from orbslam2py.settings.groups import DISTORTION_FIELDS
from orbslam2py.settings.keys import focal_problems

#: OpenCV's model with 12 coefficients.
THIN_PRISM = "thin_prism"


def camera_settings(
    K: NDArray[np.float64],
    distortion: NDArray[np.float64],
    size: tuple[int, int] | None,
    *,
    fps: float,
    rgb: bool = False,
    model: str = PINHOLE,
    lens: tuple[float, ...] = (),
) -> CameraSettings:
    """Camera settings of a matrix (3, 3) [pixels], up to 12 coefficients, width and height.

    `model` and `lens` are as in `orbslam2py.CameraSettings`.
    """
    width, height = size or (None, None)
    if distortion.size > len(DISTORTION_FIELDS):
        model, lens, distortion = THIN_PRISM, tuple(distortion.tolist()), np.zeros(0)
    return CameraSettings(
        fx=K[0, 0],
        fy=K[1, 1],
        cx=K[0, 2],
        cy=K[1, 2],
        **dict(zip(DISTORTION_FIELDS, distortion.tolist(), strict=False)),
        width=width,
        height=height,
        fps=fps,
        rgb=rgb,
        model=model,
        lens=lens,
    )


def settings_of_model(camera: CameraModel, *, fps: float, rgb: bool = False) -> CameraSettings:
    """Camera settings of a camera model; `fps` and `rgb` are as in `orbslam2py.CameraSettings`."""
    fx, fy, cx, cy, *lens = camera.parameters
    width, height = camera.image_size
    perspective = camera.name in ("pinhole", "radtan4", "radtan5", "rational")
    return CameraSettings(
        fx=fx,
        fy=fy,
        cx=cx,
        cy=cy,
        **(dict(zip(DISTORTION_FIELDS, lens, strict=False)) if perspective else {}),
        width=width,
        height=height,
        fps=fps,
        rgb=rgb,
        model=PINHOLE if perspective else camera.name,
        lens=() if perspective else tuple(lens),
    )


def checked_numbers(path: object, where: str, value: object, count: tuple[int, ...]) -> FloatArray:
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
        If these are not finite numbers, or their number is wrong.
    """
    try:
        found = np.asarray(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError, OverflowError):
        found = np.zeros(0)
        count = count or (1,)
    if (count and found.size not in count) or not np.isfinite(found).all():
        wanted = " or ".join(map(str, count))
        noun = "number" if count == (1,) else "numbers"
        raise SettingsError(
            f"{path}: {where} must hold {wanted} finite {noun}, found {repr(value)[:200]}"
        )
    return found


def checked_camera_matrix(
    path: object, K: NDArray[Any], where: str = "the camera matrix"
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
        raise SettingsError(
            f"{path}: a camera with skew ({K[0, 1]:g}) is not supported; calibrate it without"
        )
    return K


def opencv_coefficients(
    path: object, coefficients: object, K: FloatArray, size: tuple[int, int] | None
) -> FloatArray:
    """Bring coefficients in OpenCV's order to as few as there must be; float64 (5,), (8,) or (12,).

    Parameters
    ----------
    path
        The file, and the camera in it, for the message.
    coefficients
        0, 4, 5, 8, 12 or 14 numbers.
    K, size
        Camera matrix (3, 3) and size [pixels], for the message.

    Raises
    ------
    SettingsError
        If there is another number of them, or those beyond the twelfth are not zero.
    """
    given = checked_numbers(path, "the distortion", coefficients, ())
    if given.size not in (0, 4, 5, 8, 12, 14):
        raise SettingsError(
            f"{path}: {number_of(given.size, 'distortion coefficient')}; give k1, k2, p1, p2 and "
            "perhaps k3, or k3, k4, k5, k6, as OpenCV has them (0 for those there are not)"
        )
    if np.any(given[12:]):
        raise SettingsError(
            f"{path}: distortion with {given.size} coefficients (a tilted sensor) is "
            "not supported, only the first 12; undistort the images with OpenCV (cv2.undistort "
            "with K and D of this file), and make settings of the undistorted images:\n"
            f"    {filled_line(K, size, Sensor.MONOCULAR)}"
        )
    if np.any(given[8:]):
        return given[:12]
    all_of_them = np.zeros(8)
    all_of_them[: min(given.size, 8)] = given[:8]
    return all_of_them if np.any(all_of_them[5:]) else all_of_them[:5]


def kannala_brandt_numbers(path: object, where: str, value: object) -> tuple[float, ...]:
    """Take k1, k2, k3, k4 of an equidistant (Kannala-Brandt) lens.

    Some programs write more numbers, which are 0.

    Raises
    ------
    SettingsError
        If there are fewer than four numbers, or one after them is not 0.
    """
    given = checked_numbers(path, where, value, ())
    if given.size < 4 or np.any(given[4:]):
        raise SettingsError(
            f"{path}: {where} must hold the 4 numbers k1, k2, k3, k4 of a fisheye lens "
            f"(equidistant, Kannala-Brandt), found {repr(value)[:200]}; give these, or name the "
            "right lens"
        )
    return tuple(given[:4].tolist())


def pinhole_matrix(path: object, where: str, values: object) -> FloatArray:
    """Make the camera matrix (3, 3) of fx, fy, cx, cy.

    Raises
    ------
    SettingsError
        If these are other than four numbers, or a focal length is not above 0.
    """
    fx, fy, cx, cy = checked_numbers(path, where, values, (4,))
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return checked_camera_matrix(path, K, where)


def checked_pose(path: object, where: str, value: object) -> FloatArray:
    """Make a rigid transform (4, 4) of 16 numbers.

    Raises
    ------
    SettingsError
        If it is none.
    """
    T = checked_numbers(path, where, value, (16,)).reshape(4, 4)
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0:
        raise SettingsError(
            f"{path}: {where} is no 4 x 4 rigid transform; give a rotation (no mirror, no scale) "
            "and the translation beside it"
        )
    return T


def pose_of_parts(path: object, where: str, R: object, t: object) -> FloatArray:
    """Make a rigid transform (4, 4) of a rotation, 9 numbers, and a translation, 3 numbers.

    Raises
    ------
    SettingsError
        If they are none.
    """
    T = np.eye(4)
    T[:3, :3] = checked_numbers(path, f"the rotation of {where}", R, (9,)).reshape(3, 3)
    T[:3, 3] = checked_numbers(path, f"the translation of {where}", t, (3,))
    return checked_pose(path, where, T)


def checked_size(path: object, size: object, where: str = "the image size") -> tuple[int, int]:
    """Check width and height of an image [pixels].

    Raises
    ------
    SettingsError
        If they are no whole numbers above 0.
    """
    width, height = checked_numbers(path, where, size, (2,)).tolist()
    if not (width.is_integer() and height.is_integer() and min(width, height) >= 1):
        raise SettingsError(
            f"{path}: an image size of {width:g} x {height:g} makes no sense; give whole numbers "
            "of pixels, 1 or more"
        )
    return int(width), int(height)
