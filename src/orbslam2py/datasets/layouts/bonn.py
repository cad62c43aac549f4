# SPDX-License-Identifier: BSD-3-Clause
"""Bonn RGB-D Dynamic (Palazzolo et al. 2019): the lists of TUM RGB-D, another camera."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from orbslam2py.datasets.base import Layout
from orbslam2py.datasets.tum import TumSequence
from orbslam2py.settings import CameraSettings, Sensor, Settings, settings_for_camera

_NAME = "rgbd_bonn"
_DEPTH_PER_METRE = 5000.0
#: As published with the data set.
_CAMERA = CameraSettings(
    fx=542.822841,
    fy=542.576870,
    cx=315.593520,
    cy=237.756098,
    k1=0.039903,
    k2=-0.099343,
    p1=-0.000730,
    p2=-0.000144,
    width=640,
    height=480,
    fps=30.0,
    rgb=True,
)


class BonnSequence(TumSequence):
    """A sequence of Bonn RGB-D Dynamic, such as ``rgbd_bonn_balloon``; see `TumSequence`."""

    layout = Layout.BONN

    @staticmethod
    def recognises(folder: Path) -> bool:
        """Return whether a folder is such a sequence, by its name."""
        names = (folder.resolve().name, folder.absolute().name)
        return (folder / "rgb.txt").is_file() and any(name.startswith(_NAME) for name in names)

    def _from_calibration(self) -> Settings:
        factor = _DEPTH_PER_METRE if self.sensor is Sensor.RGBD else None
        return settings_for_camera(replace(_CAMERA), self.sensor, depth_factor=factor)
