# SPDX-License-Identifier: BSD-3-Clause
"""A camera as other programs write it."""

from __future__ import annotations

from pathlib import Path

FX, FY, CX, CY = 520.5, 515.25, 325.75, 236.125
D = (-0.25, 0.08, 0.0008, -0.0006)

OPENCV = f"""%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ {FX}, 0., {CX}, 0., {FY}, {CY}, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ {D[0]}, {D[1]}, {D[2]}, {D[3]}, 0. ]
"""

KALIBR = f"""cam0:
  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: [{D[0]}, {D[1]}, {D[2]}, {D[3]}]
  intrinsics: [{FX}, {FY}, {CX}, {CY}]
  resolution: [640, 480]
"""

KALIBR_PAIR = (
    KALIBR
    + KALIBR.replace("cam0", "cam1")
    + """  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.11]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
"""
)

ROS = f"""image_width: 640
image_height: 480
camera_name: left
camera_matrix:
  rows: 3
  cols: 3
  data: [{FX}, 0, {CX}, 0, {FY}, {CY}, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [{D[0]}, {D[1]}, {D[2]}, {D[3]}, 0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [500, 0, 320, 0, 0, 500, 240, 0, 0, 0, 1, 0]
"""

#: Grey pair with a baseline of 0.5 m, colour pair with one of 0.4 m.
KITTI = """P0: 700 0 600 0 0 700 180 0 0 0 1 0
P1: 700 0 600 -350 0 700 180 0 0 0 1 0
P2: 710 0 610 45 0 710 181 0 0 0 1 0
P3: 710 0 610 -239 0 710 181 0 0 0 1 0
Tr: 1 0 0 0 0 1 0 0 0 0 1 0
"""


def written(tmp_path: Path, text: str, name: str = "camera.yaml") -> Path:
    path = tmp_path / name
    path.write_text(text)
    return path
