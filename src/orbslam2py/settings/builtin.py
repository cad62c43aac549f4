# SPDX-License-Identifier: BSD-3-Clause
"""Settings of well-known data sets by name, and the choice between a name and a file."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from orbslam2py.errors import SettingsError
from orbslam2py.settings.keys import nearest
from orbslam2py.settings.reader import read_settings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Settings,
    StereoRectification,
    ViewerSettings,
)

BUILTIN_NAMES: tuple[str, ...] = (
    "tum1",
    "tum2",
    "tum3",
    "kitti00-02",
    "kitti03",
    "kitti04-12",
    "euroc",
)

_KITTI_SEQUENCES = {
    f"kitti{number:02d}": "kitti00-02" if number < 3 else "kitti04-12" for number in range(13)
} | {"kitti03": "kitti03"}

# fx, fy, cx, cy, k1, k2, p1, p2, k3
_TUM_CAMERAS = {
    "tum1": (
        (517.306408, 516.469215, 318.643040, 255.313989),
        (0.262383, -0.953104, -0.005358, 0.002628, 1.163314),
        5000.0,
    ),
    "tum2": (
        (520.908620, 521.007327, 325.141442, 249.701764),
        (0.231222, -0.784899, -0.003257, -0.000105, 0.917205),
        5208.0,
    ),
    "tum3": ((535.4, 539.2, 320.1, 247.6), (0.0, 0.0, 0.0, 0.0, 0.0), 5000.0),
}

# fx = fy, cx, cy, bf, close factor, first FAST threshold of the stereo variant
_KITTI_CAMERAS = {
    "kitti00-02": (718.856, 607.1928, 185.2157, 386.1448, 35.0, 20),
    "kitti03": (721.5377, 609.5593, 172.854, 387.5744, 40.0, 20),
    "kitti04-12": (707.0912, 601.8873, 183.1104, 379.8145, 40.0, 12),
}

KITTI_VIEWERS = {
    Sensor.STEREO: ViewerSettings(0.6, 2.0, 1.0, 2.0, 0.7, 3.0, 0.0, -100.0, -0.1, 2000.0),
    Sensor.MONOCULAR: ViewerSettings(0.1, 1.0, 1.0, 2.0, 0.15, 2.0, 0.0, -10.0, -0.1, 2000.0),
}

EUROC_STEREO_ORB = OrbSettings(n_features=1200)
EUROC_CLOSE_FACTOR = 35.0


def builtin_settings(name: str, sensor: Sensor) -> Settings:
    """Make the settings of a data set, as published with ORB-SLAM2 for that sensor.

    Parameters
    ----------
    name
        One of `BUILTIN_NAMES`, or a single KITTI sequence (``kitti00`` ... ``kitti12``).
    sensor
        The variant: stereo and monocular ones differ.

    Raises
    ------
    SettingsError
        If there is no such name, or none for that sensor.
    """
    key = _KITTI_SEQUENCES.get(name.lower(), name.lower())
    if key in _TUM_CAMERAS:
        return _tum(key, sensor)
    if key in _KITTI_CAMERAS:
        return _kitti(key, sensor)
    if key == "euroc":
        return _euroc(sensor)
    suggestion = nearest(name, (*BUILTIN_NAMES, *_KITTI_SEQUENCES))
    advice = f"; did you mean {suggestion}?" if suggestion else ""
    names = ", ".join(BUILTIN_NAMES)
    raise SettingsError(f"no built-in settings '{name}'{advice} (there are: {names})")


def resolve_settings(
    choice: str | PathLike[str] | Settings, sensor: Sensor, *, allow_unknown: bool = False
) -> Settings:
    """Make settings of what a user gave: a built-in name, a file, or finished settings.

    Raises
    ------
    SettingsError
        If it is neither a name nor a readable and correct file, or made for another sensor.
    """
    if isinstance(choice, Settings):
        choice.check_for(sensor)
        return choice
    name = str(choice)
    if name.lower() in BUILTIN_NAMES or name.lower() in _KITTI_SEQUENCES:
        return builtin_settings(name, sensor)
    path = Path(choice)
    if path.exists() or path.suffix or len(path.parts) > 1:
        return read_settings(path, sensor, allow_unknown=allow_unknown)
    return builtin_settings(name, sensor)  # tells the names there are


def _no_variant(name: str, sensor: Sensor, available: str) -> SettingsError:
    return SettingsError(f"built-in settings '{name}' are for {available}, not for {sensor}")


def _tum(name: str, sensor: Sensor) -> Settings:
    if sensor is Sensor.STEREO:
        raise _no_variant(name, sensor, "rgbd and mono")
    (fx, fy, cx, cy), (k1, k2, p1, p2, k3), raw_per_metre = _TUM_CAMERAS[name]
    rgbd = sensor is Sensor.RGBD
    camera = CameraSettings(
        *(fx, fy, cx, cy, k1, k2, p1, p2, k3),
        width=640,
        height=480,
        fps=30.0,
        bf=40.0 if rgbd else 0.0,
        rgb=True,
    )
    return Settings(
        sensor=sensor,
        camera=camera,
        orb=OrbSettings(n_features=1000),
        depth=DepthSettings(40.0, raw_per_metre) if rgbd else None,
    )


def _kitti(name: str, sensor: Sensor) -> Settings:
    if sensor is Sensor.RGBD:
        raise _no_variant(name, sensor, "stereo and mono")
    f, cx, cy, bf, close_factor, first_threshold = _KITTI_CAMERAS[name]
    stereo = sensor is Sensor.STEREO
    camera = CameraSettings(
        f,
        f,
        cx,
        cy,
        width=1241 if stereo else None,
        height=376 if stereo else None,
        fps=10.0,
        bf=bf if stereo else 0.0,
        rgb=True,
    )
    return Settings(
        sensor=sensor,
        camera=camera,
        orb=OrbSettings(n_features=2000, ini_th_fast=first_threshold if stereo else 20),
        depth=DepthSettings(close_factor) if stereo else None,
        viewer=KITTI_VIEWERS[sensor],
    )


def _euroc(sensor: Sensor) -> Settings:
    if sensor is Sensor.RGBD:
        raise _no_variant("euroc", sensor, "stereo and mono")
    if sensor is Sensor.MONOCULAR:
        camera = CameraSettings(
            *(458.654, 457.296, 367.215, 248.375),
            *(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05),
            fps=20.0,
            rgb=True,
        )
        return Settings(sensor=sensor, camera=camera, orb=OrbSettings(n_features=1000))
    f, cx, cy, bf = 435.2046959714599, 367.4517211914062, 252.2008514404297, 47.90639384423901
    rectification = StereoRectification(
        left=CameraRectification(
            K=_camera_matrix(458.654, 457.296, 367.215, 248.375),
            D=np.array([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0]),
            R=np.array(
                [
                    [0.999966347530033, -0.001422739138722922, 0.008079580483432283],
                    [0.001365741834644127, 0.9999741760894847, 0.007055629199258132],
                    [-0.008089410156878961, -0.007044357138835809, 0.9999424675829176],
                ]
            ),
            P=_projection(f, cx, cy, 0.0),
            width=752,
            height=480,
        ),
        right=CameraRectification(
            K=_camera_matrix(457.587, 456.134, 379.999, 255.238),
            D=np.array([-0.28368365, 0.07451284, -0.00010473, -3.555907e-05, 0.0]),
            R=np.array(
                [
                    [0.9999633526194376, -0.003625811871560086, 0.007755443660172947],
                    [0.003680398547259526, 0.9999684752771629, -0.007035845251224894],
                    [-0.007729688520722713, 0.007064130529506649, 0.999945173484644],
                ]
            ),
            P=_projection(f, cx, cy, -bf),
            width=752,
            height=480,
        ),
    )
    camera = CameraSettings(f, f, cx, cy, width=752, height=480, fps=20.0, bf=bf, rgb=True)
    return Settings(
        sensor=sensor,
        camera=camera,
        orb=EUROC_STEREO_ORB,
        depth=DepthSettings(EUROC_CLOSE_FACTOR),
        rectification=rectification,
    )


def _camera_matrix(fx: float, fy: float, cx: float, cy: float) -> NDArray[np.float64]:
    return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def _projection(f: float, cx: float, cy: float, offset: float) -> NDArray[np.float64]:
    return np.array([[f, 0.0, cx, offset], [0.0, f, cy, 0.0], [0.0, 0.0, 1.0, 0.0]])
