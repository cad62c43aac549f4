# SPDX-License-Identifier: BSD-3-Clause
"""Lens models by the names that programs give them, and what to do about those not supported."""

from __future__ import annotations

import re
from dataclasses import dataclass

from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor
from orbslam2py.settings.foreign import new_line

PINHOLE = "pinhole"


@dataclass(frozen=True)
class _Lens:
    """A lens that is not supported: what it is, and whether OpenCV undistorts its images."""

    noun: str
    in_opencv: bool = False


_FISHEYE = {
    "equidistant": _Lens("a fisheye camera (equidistant, also called Kannala-Brandt)", True),
    "double sphere": _Lens("a fisheye camera (double sphere model)"),
    "eucm": _Lens("a fisheye camera (extended unified model, EUCM)"),
    "omni": _Lens("an omnidirectional camera (unified model of Mei)"),
    "fov": _Lens("a fisheye camera (field-of-view model)"),
    "scaramuzza": _Lens("an omnidirectional camera (polynomial model of Scaramuzza)"),
    "thin prism": _Lens("a fisheye camera (equidistant with a thin prism)"),
    "equirectangular": _Lens("a panorama (equirectangular)"),
    "polynomial": _Lens("a fisheye camera (a polynomial of the angle)"),
}

#: Names without signs between words, in lower case.
_NAMES = {
    PINHOLE: (
        "pinhole radtan radialtangential plumbbob rationalpolynomial none opencv fullopencv "
        "simplepinhole simpleradial radial perspective brownconrady pinholeradtan "
        "pinholeradtan8 pinholefull distortionnone distortionbrownconrady"
    ),
    "equidistant": (
        "equidistant equi fisheye opencvfisheye kannalabrandt kannalabrandt4 kannalabrandt8 kb kb4 "
        "kb8 radialfisheye simpleradialfisheye fisheye624 distortionkannalabrandt4"
    ),
    "double sphere": "ds doublesphere",
    "eucm": "eucm",
    "omni": "omni mei ucm unified omnidirectional",
    "fov": "fov atan distortionftheta ftheta",
    "scaramuzza": "scaramuzza ocam ocamcalib",
    "thin prism": "thinprismfisheye radtanthinprismfisheye",
    "equirectangular": "equirectangular panorama spherical",
    "polynomial": "radialpoly polynomial",
}
_LENSES = {name: lens for lens, names in _NAMES.items() for name in names.split()}


def lens_of(where: str, what: str, name: object) -> str:
    """Find the lens that a program means.

    Parameters
    ----------
    where, what
        The file, and the place in it, for the message.
    name
        The name that the program gives the model.

    Returns
    -------
    str
        `PINHOLE`, or a lens that `require_pinhole` refuses.

    Raises
    ------
    SettingsError
        If nobody knows such a lens.
    """
    lens = _LENSES.get(re.sub(r"[^a-z0-9]", "", str(name).lower()))
    if lens is None:
        raise SettingsError(
            f"{where}: {what} {name} is not known; undistort the images with the program that "
            f"wrote the file, and make settings of the numbers of the undistorted images:\n"
            f"    {new_line(Sensor.MONOCULAR)}"
        )
    return lens


def require_pinhole(where: str, lens: str, sensor: Sensor) -> None:
    """Raise `SettingsError` unless a lens is supported; it says what to do instead.

    Parameters
    ----------
    where
        The file, and the camera in it, for the message.
    lens
        As `lens_of` returns it.
    sensor
        What settings are wanted for.
    """
    if lens == PINHOLE:
        return
    kind = _FISHEYE[lens]
    raise SettingsError(
        f"{where} is {kind.noun}, and only pinhole cameras are supported; {_remedy(lens, sensor)}"
    )


def _remedy(lens: str, sensor: Sensor) -> str:
    line = f"make settings of the new camera matrix:\n    {new_line(sensor)}"
    if _FISHEYE[lens].in_opencv:
        calls = "undistort the images with OpenCV (cv2.fisheye.undistortImage with K and D of"
        if sensor is Sensor.STEREO:
            calls = (
                "undistort and rectify the images with OpenCV (cv2.fisheye.stereoRectify and "
                "cv2.fisheye.initUndistortRectifyMap with K and D of"
            )
        return f"{calls} this file), and {line}"
    if lens == "equirectangular":
        return f"cut a pinhole view out of the panorama, and {line}"
    return (
        "calibrate the camera with the equidistant model (Kalibr: pinhole-equi), for which OpenCV "
        "undistorts the images (cv2.fisheye.undistortImage), or, if it sees less than about 110 "
        "degrees, as a pinhole camera with orbslam2py calibrate"
    )
