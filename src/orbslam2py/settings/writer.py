# SPDX-License-Identifier: BSD-3-Clause
"""Settings to the text of an ORB-SLAM settings file."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from orbslam2py.settings.keys import KEYS, Key

if TYPE_CHECKING:
    from orbslam2py.settings.settings import Settings

_TITLES = {
    "camera": "Camera: pixels, OpenCV's distortion order, bf = baseline [m] * fx",
    "depth": "Depth: close points are nearer than ThDepth baselines",
    "orb": "ORB features",
    "viewer": "Map view: sizes in world units, widths in pixels",
}


def format_settings(settings: Settings) -> str:
    """Make the text that reads back as equal settings; numbers keep all their digits."""
    lines = ["%YAML:1.0", f"# Settings for sensor {settings.sensor}"]
    for group, title in _TITLES.items():
        values = getattr(settings, group)
        if values is None:
            continue
        lines += ["", f"# {title}"]
        for key in KEYS:
            value = getattr(values, key.field) if key.group == group else None
            if value is not None and settings.sensor in key.sensors:
                lines.append(f"{key.name}: {_number(key, value)}")
    if settings.rectification is not None:
        lines += ["", "# Rectification of the raw stereo pair"]
        for side in ("left", "right"):
            camera = getattr(settings.rectification, side)
            lines.append(f"{side.upper()}.width: {camera.width}")
            lines.append(f"{side.upper()}.height: {camera.height}")
            for name in "KDRP":
                lines += _matrix(f"{side.upper()}.{name}", getattr(camera, name))
    return "\n".join(lines) + "\n"


def _number(key: Key, value: float) -> str:
    return repr(float(value)) if key.kind is float else str(int(value))


def _matrix(name: str, values: NDArray[np.float64]) -> list[str]:
    rows = np.atleast_2d(values)
    text = ",\n      ".join(", ".join(repr(float(item)) for item in row) for row in rows)
    return [
        f"{name}: !!opencv-matrix",
        f"   rows: {rows.shape[0]}",
        f"   cols: {rows.shape[1]}",
        "   dt: d",
        f"   data: [{text}]",
    ]
