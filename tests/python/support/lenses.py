# SPDX-License-Identifier: BSD-3-Clause
"""Small cameras with lenses of each kind."""

from __future__ import annotations

from orbslam2py.settings import CameraSettings

#: About 150 degrees across.
FISHEYE = CameraSettings(
    fx=120,
    fy=120,
    cx=159.5,
    cy=119.5,
    width=320,
    height=240,
    model="kannala_brandt",
    lens=(-0.01, 0.02, -0.01, 0.002),
)
#: About 200 degrees across.
VERY_WIDE = CameraSettings(
    fx=90,
    fy=90,
    cx=179.5,
    cy=179.5,
    width=360,
    height=360,
    model="double_sphere",
    lens=(-0.2, 0.6),
)
DISTORTED = CameraSettings(
    fx=230, fy=230, cx=159.5, cy=119.5, k1=-0.28, k2=0.07, width=320, height=240
)
