# SPDX-License-Identifier: BSD-3-Clause
"""Calibrations of WoodScape, Project Aria and RealSense, after their documentation."""

from __future__ import annotations

from typing import Any

WOODSCAPE: dict[str, Any] = {
    "intrinsic": {
        **{"aspect_ratio": 1.0, "cx_offset": 4.0, "cy_offset": -3.0, "poly_order": 4},
        **{"width": 1280.0, "height": 966.0, "model": "radial_poly"},
        **{"k1": 340.0, "k2": -32.0, "k3": 48.0, "k4": -7.2},
    },
    "name": "FV",
}
ARIA_LENS = [0.033, -0.033, 0.042, -0.051, 0.016, -8e-4, 2e-4, 6e-4, 7e-4, 0.0, -9e-4, -5e-5]
ARIA: dict[str, Any] = {
    "CameraCalibrations": [
        {
            "Label": "camera-slam-left",
            "Projection": {
                "Name": "FisheyeRadTanThinPrism",
                "Params": [245.0, 254.0, 259.0, *ARIA_LENS],
            },
            "T_Device_Camera": {"Translation": [0, 0, 0], "UnitQuaternion": [1.0, [0, 0, 0]]},
        }
    ]
}
REALSENSE = """
 Intrinsic of "Infrared 1" / 848x480 / {Y8/Y16}
  Width:      \t848
  Height:     \t480
  PPX:        \t424.125
  PPY:        \t240.5
  Fx:         \t425.75
  Fy:         \t425.5
  Distortion: \tBrown Conrady
  Coeffs:     \t0  \t0  \t0  \t0  \t0
  FOV (deg):  \t89.76 x 58.8

 Intrinsic of "Infrared 2" / 848x480 / {Y8/Y16}
  Width:      \t848
  Height:     \t480
  PPX:        \t424.125
  PPY:        \t240.5
  Fx:         \t425.75
  Fy:         \t425.5
  Distortion: \tBrown Conrady
  Coeffs:     \t0  \t0  \t0  \t0  \t0

 Intrinsic of "Color" / 640x480 / {RGB8}
  Width:      \t640
  Height:     \t480
  PPX:        \t320.5
  PPY:        \t241
  Fx:         \t605.5
  Fy:         \t605.25
  Distortion: \tInverse Brown Conrady
  Coeffs:     \t-0.05  \t0.06  \t0.0005  \t-0.0003  \t-0.02

 Intrinsic of "Fisheye 1" / 848x800 / {Y8}
  Width:      \t848
  Height:     \t800
  PPX:        \t422.25
  PPY:        \t395.25
  Fx:         \t286.5
  Fy:         \t286.25
  Distortion: \tKannala Brandt4
  Coeffs:     \t-0.00676  \t0.04517  \t-0.04351  \t0.00837  \t0

Extrinsic from "Infrared 1"\t  To\t  "Infrared 2" :
 Rotation Matrix:
   1                0                0
   0                1                0
   0                0                1

 Translation Vector: -0.05  0  0
"""
