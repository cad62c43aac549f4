# SPDX-License-Identifier: BSD-3-Clause
"""Writes settings as the text of an ORB-SLAM settings file."""

from __future__ import annotations

from typing import Literal

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings.fisheye import LENS_PARAMETERS, PINHOLE, TYPES
from orbslam2py.settings.groups import DISTORTION_FIELDS, CameraSettings
from orbslam2py.settings.keys import KEYS, Key
from orbslam2py.settings.right_camera import RightCamera, SettingsGroups
from orbslam2py.settings.sensor import Sensor

_TITLES: dict[Literal["camera", "depth", "orb", "viewer"], str] = {
    "camera": "Camera: pixels, OpenCV's distortion order, bf = baseline [m] * fx",
    "depth": "Depth: close points are nearer than ThDepth baselines",
    "orb": "ORB features",
    "viewer": "Map view: sizes in world units, widths in pixels",
}


#: Written only of a rational distortion, so that files of other cameras stay as others read them.
_RATIONAL = ("k4", "k5", "k6")


def format_settings(sensor: Sensor, groups: SettingsGroups) -> str:
    """Return a text that reads back as equal settings; numbers keep all their digits."""
    lines = ["%YAML:1.0", f"# Settings for sensor {sensor}"]
    for group, title in _TITLES.items():
        values = groups[group]
        if values is None:
            continue
        lines += ["", f"# {title}"]
        fisheye = group == "camera" and groups["camera"].is_fisheye
        lines += lens_lines(groups["camera"]) if fisheye else []
        for key in KEYS:
            if fisheye and key.field in DISTORTION_FIELDS:
                continue
            value = getattr(values, key.field) if key.group == group else None
            if key.field in _RATIONAL and len(groups["camera"].distortion) < 8:
                continue
            if value is not None and sensor in key.sensors:
                lines.append(f"{key.name}: {_number(key, value)}")
    rectification = groups["rectification"]
    if rectification is not None:
        lines += ["", "# Rectification of the raw stereo pair"]
        for side, camera in (("LEFT", rectification.left), ("RIGHT", rectification.right)):
            lines.append(f"{side}.width: {camera.width}")
            lines.append(f"{side}.height: {camera.height}")
            for name in "KDRP":
                lines += matrix_lines(f"{side}.{name}", getattr(camera, name))
            if camera.model != PINHOLE:
                lines.append(f"{side}.model: {TYPES[camera.model]}")
    lines += _right_lines(groups["right"])
    return "\n".join(lines) + "\n"


def lens_lines(camera: CameraSettings, key: str = "Camera") -> list[str]:
    """Return the model of a fisheye lens and its parameters."""
    names = LENS_PARAMETERS[camera.model]
    lines = [f"{key}.type: {TYPES[camera.model]}"]
    return lines + [f"{key}.{n}: {value!r}" for n, value in zip(names, camera.lens, strict=True)]


def _right_lines(right: RightCamera | None) -> list[str]:
    """The right camera of a fisheye pair."""
    if right is None:
        return []
    camera = right.camera
    lines = ["", "# Right camera of a fisheye pair; T_c1_c2 maps its coordinates to the left ones"]
    if camera.is_fisheye:
        lines += lens_lines(camera, "Camera2")
    else:
        names = zip(DISTORTION_FIELDS, camera.distortion.tolist(), strict=False)
        lines += ["Camera2.type: PinHole", *(f"Camera2.{n}: {value!r}" for n, value in names)]
    lines += [f"Camera2.{n}: {getattr(camera, n)!r}" for n in ("fx", "fy", "cx", "cy")]
    return lines + matrix_lines("Stereo.T_c1_c2", right.T_left_right)


def _number(key: Key, value: float) -> str:
    return repr(float(value)) if key.kind is float else str(int(value))


def matrix_lines(name: str, values: FloatArray) -> list[str]:
    """Return a matrix as OpenCV writes it."""
    rows = np.atleast_2d(values)
    text = ",\n      ".join(", ".join(repr(float(item)) for item in row) for row in rows)
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows.shape[0]}",
        f"   cols: {rows.shape[1]}",
        "   dt: d",
        f"   data: [{text}]",
    ]
