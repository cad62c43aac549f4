# SPDX-License-Identifier: BSD-3-Clause
"""Which lens a settings file is for, as the files of ORB-SLAM3 and stella_vslam tell it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from orbslam2py.errors import SettingsError
from orbslam2py.settings.foreign import new_line
from orbslam2py.settings.opencv_yaml import Entry, Problem, parse_number
from orbslam2py.settings.sensor import Sensor

#: Keys that name the model of the lens, and flags that tell a fisheye.
_MODEL_KEYS = (
    "Camera.type",
    "Camera1.type",
    "Camera2.type",
    "Camera.model",
    "StereoRectifier.model",
)
_FISHEYE_FLAG = "Camera.bFishEye"
LENS_KEYS = (*_MODEL_KEYS, _FISHEYE_FLAG)

_PINHOLES = ("pinhole", "rectified", "perspective")
_FISHEYES = (
    "kannalabrandt8",
    "kannalabrandt",
    "kannala_brandt",
    "fisheye",
    "equidistant",
    "kb8",
    "kb4",
)
_OTHER_LENSES = {
    "equirectangular": "images of all directions (equirectangular)",
    "radial_division": "a lens with the division model of distortion",
}


def refuse_other_lenses(entries: Mapping[str, Entry], path: Path, sensor: Sensor) -> None:
    """Raise `SettingsError` with what to do if the file is not for a pinhole camera.

    Parameters
    ----------
    entries
        The entries of the file, nested ones by their path.
    path, sensor
        Of the file, and what it is read for: for the message.
    """
    for key in _MODEL_KEYS:
        entry = entries.get(key)
        if entry is None:
            continue
        model = str(entry.value).lower()
        if model in _FISHEYES:
            _refuse_fisheye(entry, f"{key} {entry.value}", path, sensor)
        if model not in _PINHOLES:
            what = _OTHER_LENSES.get(model, f"a lens of the model {entry.value}")
            text = (
                f"{key} is {entry.value}: the file is for {what}, and orbslam2py tracks images of "
                "a pinhole camera; allowed: PinHole, Rectified, perspective. Make pinhole images "
                "of them first (undistorted, or cut out), and settings of these:\n"
                f"    {new_line(sensor)}"
            )
            raise SettingsError(Problem(entry.line, text).located(path))
    flag = entries.get(_FISHEYE_FLAG)
    if flag is not None and _value(flag) != 0:
        _refuse_fisheye(flag, f"{_FISHEYE_FLAG} {flag.value}", path, sensor)
    for camera in ("Camera", "Camera1", "Camera2"):
        if _has_four_radial(entries, camera):
            entry = entries[f"{camera}.k4"]
            why = f"{camera}.k4 without k5 and k6"
            _refuse_fisheye(entry, why, path, sensor)


def _has_four_radial(entries: Mapping[str, Entry], camera: str) -> bool:
    """Whether the fourth coefficient is not one of the rational model's six."""
    k4 = entries.get(f"{camera}.k4")
    if k4 is None or any(f"{camera}.{name}" in entries for name in ("k5", "k6")):
        return False
    tangential = any(f"{camera}.{name}" in entries for name in ("p1", "p2"))
    return _value(k4) != 0 or not tangential


def _refuse_fisheye(entry: Entry, why: str, path: Path, sensor: Sensor) -> None:
    text = (
        f"{why} belongs to a fisheye calibration (Kannala-Brandt, k1 to k4). orbslam2py has the "
        "pinhole model; with these numbers in it every map would be bent. Undistort the images "
        "first, with cv2.fisheye.estimateNewCameraMatrixForUndistortRectify (gives new_K), "
        "cv2.fisheye.initUndistortRectifyMap(K, D, R, new_K, size, cv2.CV_16SC2) and cv2.remap, "
        "and make settings of new_K without distortion:\n"
        f"    {new_line(sensor)}"
    )
    raise SettingsError(Problem(entry.line, text).located(path))


def _value(entry: Entry) -> float:
    """The number of an entry; NaN, which is not 0, if it is none."""
    try:
        return parse_number(entry.value) if isinstance(entry.value, str) else float("nan")
    except ValueError:
        return float("nan")
