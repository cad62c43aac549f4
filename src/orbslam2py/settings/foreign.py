# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of other programs, told by their content, and commands that make settings."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

from orbslam2py.settings.sensor import Sensor

#: Who writes such files, as ``--format`` of ``import-camera`` names them, and what they are called.
FOREIGN_FORMATS = {
    "kalibr": "a camchain of Kalibr",
    "opencv": "a calibration of OpenCV",
    "ros": "a camera_info of ROS",
    "colmap": "a camera list of COLMAP",
    "kitti": "a calibration of KITTI",
}

_NUMBER = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"
_SIGNS = {
    "kalibr": re.compile(r"^cam\d+\s*:", re.MULTILINE),
    "opencv": re.compile(r"opencv-matrix|<opencv_storage>"),
    "ros": re.compile(r"^camera_matrix\s*:", re.MULTILINE),
    "colmap": re.compile(r"^\s*\d+\s+[A-Z][A-Z_]+\s+\d+\s+\d+\s", re.MULTILINE),
    "kitti": re.compile(rf"^P(?:_rect_0)?\d:(?:[ \t]+{_NUMBER}){{12}}\s*$", re.MULTILINE),
}


def recognise_camera_file(text: str) -> str | None:
    """Tell by its text who wrote a calibration file: a key of `FOREIGN_FORMATS`, or None."""
    return next((name for name, sign in _SIGNS.items() if sign.search(text)), None)


def import_line(path: Path, file_format: str, sensor: Sensor) -> str:
    """Return the command that makes settings of such a file."""
    words = ["orbslam2py", "import-camera", str(path), "--sensor", str(sensor)]
    if sensor is Sensor.RGBD:
        words += ["--depth-factor", "1000"]
    elif sensor is Sensor.STEREO and file_format == "ros":
        words += ["--right", "RIGHT.yaml"]
    elif sensor is Sensor.STEREO and file_format in ("opencv", "colmap"):
        words += ["--baseline", "0.12"]
    rate = "10" if file_format == "kitti" else "30"
    return shlex.join([*words, "--fps", rate, "--output", "my.yaml"])


def new_line(sensor: Sensor) -> str:
    """Return the command that makes settings of a camera's numbers, which are to be filled in."""
    words = ["orbslam2py settings new --sensor", str(sensor), "--fx FX --fy FY --cx CX --cy CY"]
    if sensor is Sensor.RGBD:
        words.append("--depth-factor 1000")
    elif sensor is Sensor.STEREO:
        words.append("--baseline METRES")
    return " ".join([*words, "--output my.yaml"])
