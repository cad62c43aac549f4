# SPDX-License-Identifier: BSD-3-Clause
"""Settings files as ORB-SLAM3 and stella_vslam write them, with numbers of a made-up camera."""

from __future__ import annotations

import cv2
import numpy as np

ORB = """\
ORBextractor.nFeatures: 1200
ORBextractor.scaleFactor: 1.2
ORBextractor.nLevels: 8
ORBextractor.iniThFAST: 20
ORBextractor.minThFAST: 7
"""

IMU = """\
IMU.NoiseGyro: 1.7e-4
IMU.T_b_c1: !!opencv-matrix
  rows: 4
  cols: 4
  dt: f
  data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]
System.thFarPoints: 20.0
Viewer.KeyFrameSize: 0.05
Viewer.imageViewScale: 1.0
"""

HEAD_V1 = """\
%YAML:1.0
File.version: "1.0"
Camera.type: "PinHole"
Camera.width: 640
Camera.height: 480
Camera.fps: 20
Camera.RGB: 1
"""

FIRST = """\
Camera1.fx: 460.5
Camera1.fy: 459.5
Camera1.cx: 321.5
Camera1.cy: 238.5
Camera1.k1: -0.28
Camera1.k2: 0.07
Camera1.p1: 0.0002
Camera1.p2: 0.0001
"""

SECOND = """\
Camera2.fx: 458.0
Camera2.fy: 457.0
Camera2.cx: 318.0
Camera2.cy: 241.0
Camera2.k1: -0.27
Camera2.k2: 0.06
Camera2.p1: -0.0001
Camera2.p2: 0.0003
"""

MONO_V1 = HEAD_V1 + FIRST + ORB + IMU
RGBD_V1 = MONO_V1 + "Stereo.ThDepth: 40.0\nStereo.b: 0.075\nRGBD.DepthMapFactor: 5000.0\n"
RECTIFIED_V1 = (
    HEAD_V1.replace("PinHole", "Rectified")
    + FIRST.replace("-0.28", "0").replace("0.07", "0").replace("0.0002", "0").replace("0.0001", "0")
    + ORB
    + "Stereo.ThDepth: 40.0\nStereo.b: 0.11\n"
)

#: Camera 2 to camera 1.
T_C1_C2 = np.eye(4)
T_C1_C2[:3, :3] = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0]
T_C1_C2[:3, 3] = [0.11, -0.001, 0.002]


def pose_text(T: np.ndarray) -> str:
    numbers = ", ".join(repr(float(value)) for value in T.ravel())
    return f"Stereo.T_c1_c2: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: f\n  data: [{numbers}]\n"


PAIR_V1 = HEAD_V1 + FIRST + SECOND + "Stereo.ThDepth: 60.0\n" + pose_text(T_C1_C2) + ORB + IMU

STELLA = """\
# stella_vslam
Camera:
  name: "a pair"
  setup: "monocular"
  model: "perspective"
  fx: 460.5
  fy: 459.5
  cx: 321.5
  cy: 238.5
  k1: -0.28
  k2: 0.07
  p1: 0.0002
  p2: 0.0001
  k3: 0.01
  fps: 20.0
  cols: 640
  rows: 480
  color_order: "RGB"

Preprocessing:
  min_size: 800
  mask_rectangles:
    - [0.0, 1.0, 0.0, 0.1]
    - [0.0, 1.0, 0.84, 1.0]

Feature:
  name: "default ORB feature extraction setting"
  scale_factor: 1.3
  num_levels: 7
  ini_fast_threshold: 21
  min_fast_threshold: 8

Mapping:
  backend: "g2o"
  baseline_dist_thr_ratio: 0.02

PangolinViewer:
  keyframe_size: 0.07
  viewpoint_f: 400
"""

STELLA_RGBD = STELLA.replace(
    "  color_order", "  focal_x_baseline: 34.5\n  depth_threshold: 40.0\n  color_order"
).replace("  min_size: 800", "  min_size: 800\n  depthmap_factor: 5000.0")

STELLA_STEREO = (
    STELLA.replace("monocular", "stereo")
    .replace("-0.28", "0")
    .replace("0.07\n  p1: 0.0002\n  p2: 0.0001\n  k3: 0.01", "0\n  p1: 0\n  p2: 0\n  k3: 0")
    .replace("  color_order", "  focal_x_baseline: 50.0\n  depth_threshold: 40.0\n  color_order")
    + """\
StereoRectifier:
  model: "perspective"
  K_left: [460.5, 0.0, 321.5, 0.0, 459.5, 238.5, 0.0, 0.0, 1.0]
  K_right: [458.0, 0.0, 318.0, 0.0, 457.0, 241.0, 0.0, 0.0, 1.0]
  D_left: [-0.28, 0.07, 0.0002, 0.0001, 0.0]
  D_right: [-0.27, 0.06, -0.0001, 0.0003, 0.0]
  R_left: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
  R_right: [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]
"""
)
