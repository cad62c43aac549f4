# SPDX-License-Identifier: BSD-3-Clause
"""The files of built-in settings say what was published with ORB-SLAM2, variant by variant."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from orbslam2py.settings import (
    BUILTIN_NAMES,
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    StereoRectification,
    ViewerSettings,
    builtin_settings,
)
from orbslam2py.settings.sensor import WITHOUT_RIG

TUM = {
    "tum1": (
        {"fx": 517.306408, "fy": 516.469215, "cx": 318.643040, "cy": 255.313989},
        {"k1": 0.262383, "k2": -0.953104, "p1": -0.005358, "p2": 0.002628, "k3": 1.163314},
        5000.0,
    ),
    "tum2": (
        {"fx": 520.908620, "fy": 521.007327, "cx": 325.141442, "cy": 249.701764},
        {"k1": 0.231222, "k2": -0.784899, "p1": -0.003257, "p2": -0.000105, "k3": 0.917205},
        5208.0,
    ),
    "tum3": ({"fx": 535.4, "fy": 539.2, "cx": 320.1, "cy": 247.6}, {}, 5000.0),
}

# Camera; baseline times fx; close factor; first FAST threshold for stereo.
KITTI = {
    "kitti00-02": ({"fx": 718.856, "cx": 607.1928, "cy": 185.2157}, 386.1448, 35.0, 20),
    "kitti03": ({"fx": 721.5377, "cx": 609.5593, "cy": 172.854}, 387.5744, 40.0, 20),
    "kitti04-12": ({"fx": 707.0912, "cx": 601.8873, "cy": 183.1104}, 379.8145, 40.0, 12),
}
KITTI_VIEWERS = {
    Sensor.STEREO: ViewerSettings(0.6, 2.0, 1.0, 2.0, 0.7, 3.0, 0.0, -100.0, -0.1, 2000.0),
    Sensor.MONOCULAR: ViewerSettings(0.1, 1.0, 1.0, 2.0, 0.15, 2.0, 0.0, -10.0, -0.1, 2000.0),
}

EUROC_F, EUROC_CX, EUROC_CY = 435.2046959714599, 367.4517211914062, 252.2008514404297
EUROC_BF = 47.90639384423901


def tum(name: str, sensor: Sensor) -> Settings:
    pinhole, distortion, raw_per_metre = TUM[name]
    rgbd = sensor is Sensor.RGBD
    return Settings(
        sensor=sensor,
        camera=CameraSettings(
            **pinhole,
            **distortion,
            width=640,
            height=480,
            fps=30.0,
            bf=40.0 if rgbd else 0.0,
            rgb=True,
        ),
        orb=OrbSettings(1000, 1.2, 8, 20, 7),
        depth=DepthSettings(40.0, raw_per_metre) if rgbd else None,
    )


def kitti(name: str, sensor: Sensor) -> Settings:
    pinhole, bf, close_factor, first_threshold = KITTI[name]
    stereo = sensor is Sensor.STEREO
    return Settings(
        sensor=sensor,
        camera=CameraSettings(
            **pinhole,
            fy=pinhole["fx"],
            width=1241 if stereo else None,
            height=376 if stereo else None,
            fps=10.0,
            bf=bf if stereo else 0.0,
            rgb=True,
        ),
        orb=OrbSettings(2000, 1.2, 8, first_threshold if stereo else 20, 7),
        depth=DepthSettings(close_factor) if stereo else None,
        viewer=KITTI_VIEWERS[sensor],
    )


def euroc_mono() -> Settings:
    return Settings(
        sensor=Sensor.MONOCULAR,
        camera=CameraSettings(
            fx=458.654,
            fy=457.296,
            cx=367.215,
            cy=248.375,
            k1=-0.28340811,
            k2=0.07395907,
            p1=0.00019359,
            p2=1.76187114e-05,
            fps=20.0,
            rgb=True,
        ),
        orb=OrbSettings(1000, 1.2, 8, 20, 7),
    )


def projection(offset: float) -> np.ndarray:
    return np.array(
        [[EUROC_F, 0, EUROC_CX, offset], [0, EUROC_F, EUROC_CY, 0], [0, 0, 1, 0]], np.float64
    )


def euroc_stereo() -> Settings:
    left = CameraRectification(
        K=np.array([[458.654, 0.0, 367.215], [0.0, 457.296, 248.375], [0.0, 0.0, 1.0]]),
        D=np.array([-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0]),
        R=np.array(
            [
                [0.999966347530033, -0.001422739138722922, 0.008079580483432283],
                [0.001365741834644127, 0.9999741760894847, 0.007055629199258132],
                [-0.008089410156878961, -0.007044357138835809, 0.9999424675829176],
            ]
        ),
        P=projection(0.0),
        width=752,
        height=480,
    )
    right = CameraRectification(
        K=np.array([[457.587, 0.0, 379.999], [0.0, 456.134, 255.238], [0.0, 0.0, 1.0]]),
        D=np.array([-0.28368365, 0.07451284, -0.00010473, -3.555907e-05, 0.0]),
        R=np.array(
            [
                [0.9999633526194376, -0.003625811871560086, 0.007755443660172947],
                [0.003680398547259526, 0.9999684752771629, -0.007035845251224894],
                [-0.007729688520722713, 0.007064130529506649, 0.999945173484644],
            ]
        ),
        P=projection(-EUROC_BF),
        width=752,
        height=480,
    )
    return Settings(
        sensor=Sensor.STEREO,
        camera=CameraSettings(
            fx=EUROC_F,
            fy=EUROC_F,
            cx=EUROC_CX,
            cy=EUROC_CY,
            width=752,
            height=480,
            fps=20.0,
            bf=EUROC_BF,
            rgb=True,
        ),
        orb=OrbSettings(1200, 1.2, 8, 20, 7),
        depth=DepthSettings(35.0),
        rectification=StereoRectification(left, right),
    )


PUBLISHED = {
    **{
        (name, sensor): tum(name, sensor)
        for name in TUM
        for sensor in WITHOUT_RIG
        if sensor is not Sensor.STEREO
    },
    **{(name, sensor): kitti(name, sensor) for name in KITTI for sensor in KITTI_VIEWERS},
    ("euroc", Sensor.MONOCULAR): euroc_mono(),
    ("euroc", Sensor.STEREO): euroc_stereo(),
}


def test_every_name_is_looked_at() -> None:
    assert {name for name, _ in PUBLISHED} == set(BUILTIN_NAMES)


@pytest.mark.parametrize(("name", "sensor"), list(PUBLISHED))
def test_files_say_what_was_published(
    name: str, sensor: Sensor, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        settings = builtin_settings(name, sensor)
    assert settings == PUBLISHED[name, sensor]
    assert settings.to_yaml() == PUBLISHED[name, sensor].to_yaml()
    assert caplog.text == ""
