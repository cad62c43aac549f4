# SPDX-License-Identifier: BSD-3-Clause
"""Lens models by the names that programs give them, and what to do about those not supported."""

from __future__ import annotations

from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor
from orbslam2py.settings.fisheye import PINHOLE, fisheye_model, plain_name
from orbslam2py.settings.foreign import new_line

__all__ = ["PINHOLE", "UNIFIED", "lens_of", "require_supported"]

#: The unified model with alpha alone: the extended one with beta 1.
UNIFIED = "ucm"

_UNSUPPORTED = {
    "scaramuzza": "an omnidirectional camera (polynomial model of Scaramuzza)",
    "thin prism": "a fisheye camera (equidistant with a thin prism)",
    "equirectangular": "a panorama (equirectangular)",
    "polynomial": "a fisheye camera (a polynomial of the angle)",
    "division": "a camera with the division model of distortion",
}

#: Names without signs between words, in lower case.
_NAMES = {
    PINHOLE: (
        "pinhole radtan radialtangential plumbbob rationalpolynomial none opencv fullopencv "
        "simplepinhole simpleradial radial perspective brownconrady pinholeradtan "
        "pinholeradtan8 pinholefull distortionnone distortionbrownconrady"
    ),
    # COLMAP's, whose coefficients are the first ones of Kannala-Brandt.
    "kannala_brandt": "radialfisheye simpleradialfisheye simplefisheye",
    UNIFIED: "ucm unified",
    "scaramuzza": "scaramuzza ocam ocamcalib",
    "thin prism": "thinprismfisheye radtanthinprismfisheye fisheye624",
    "equirectangular": "equirectangular panorama spherical",
    "polynomial": "radialpoly polynomial distortionftheta ftheta",
    "division": "division simpledivision radialdivision",
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
        `PINHOLE`, a fisheye model of `orbslam2py.settings.fisheye.LENS_PARAMETERS`, `UNIFIED`, or a
        lens that `require_supported` refuses.

    Raises
    ------
    SettingsError
        If the lens is unknown.
    """
    lens = fisheye_model(name) or _LENSES.get(plain_name(name))
    if lens is None:
        raise SettingsError(
            f"{where}: {what} {name} is not known; undistort the images with the program that "
            f"wrote the file, and make settings of the numbers of the undistorted images:\n"
            f"    {new_line(Sensor.MONOCULAR)}"
        )
    return lens


def require_supported(where: str, lens: str) -> None:
    """Raise `SettingsError` unless a lens is supported; it says what to do instead.

    Parameters
    ----------
    where
        The file, and the camera in it, for the message.
    lens
        As `lens_of` returns it.
    """
    if lens in _UNSUPPORTED:
        raise SettingsError(
            f"{where} is {_UNSUPPORTED[lens]}, which is not supported; {_remedy(lens)}"
        )


def _remedy(lens: str) -> str:
    if lens == "equirectangular":
        line = f"make settings of the new camera matrix:\n    {new_line(Sensor.MONOCULAR)}"
        return f"cut a pinhole view out of the panorama, and {line}"
    return (
        "calibrate the camera with a supported fisheye model: orbslam2py calibrate chooses one "
        "(Kalibr: pinhole-equi, ds-none, eucm-none, omni-radtan or pinhole-fov)"
    )
