# SPDX-License-Identifier: BSD-3-Clause
"""Small settings files, and what is said of bad ones."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import Sensor, Settings, SettingsError

MONO = {
    "Camera.fx": "517.3",
    "Camera.fy": "516.4",
    "Camera.cx": "318.6",
    "Camera.cy": "255.3",
    "ORBextractor.nFeatures": "1000",
    "ORBextractor.scaleFactor": "1.2",
    "ORBextractor.nLevels": "8",
    "ORBextractor.iniThFAST": "20",
    "ORBextractor.minThFAST": "7",
}

DEPTH = {"Camera.bf": "40.0", "ThDepth": "40.0", "DepthMapFactor": "5000.0"}

MATRIX = """\
LEFT.height: 480
LEFT.width: 752
LEFT.D: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data:[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0]
LEFT.K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [458.654, 0.0, 367.215,
     0.0, 457.296, 248.375,
     0.0, 0.0, 1.0]
LEFT.R:  !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
LEFT.P:  !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [435.2, 0, 367.4, 0,  0, 435.2, 252.2, 0,  0, 0, 1, 0]
"""


def write(path: Path, values: dict[str, str], extra: str = "") -> Path:
    lines = ["%YAML:1.0", "", "# a camera"]
    lines += [f"{key}: {value}" for key, value in values.items()]
    path.write_text("\n".join(lines) + "\n" + extra)
    return path


def refusal(path: Path, sensor: Sensor = Sensor.MONOCULAR) -> str:
    with pytest.raises(SettingsError) as caught:
        Settings.load(path, sensor)
    return str(caught.value)
