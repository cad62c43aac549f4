# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of many programs, made of the same numbers."""

from __future__ import annotations

import json
import math
from typing import Any

FX, FY, CX, CY = 300.5, 301.25, 321.5, 238.75
K = [[FX, 0, CX], [0, FY, CY], [0, 0, 1]]
ROWS = [FX, 0, CX, 0, FY, CY, 0, 0, 1]
COLUMNS = [FX, 0, 0, 0, FY, 0, CX, CY, 1]
D = (-0.05, 0.06, 0.001, -0.0005, 0.02)
RATIONAL = (0.5, -2.1, 0.0004, -0.0005, 1.2, 0.4, -1.9, 1.1)
SIZE = (640, 480)
NUMBERS = {"fx": FX, "fy": FY, "cx": CX, "cy": CY}
BASELINE = 0.12


def matrix(name: str, values: list[Any] | tuple[Any, ...], columns: int = 3) -> str:
    """A matrix as OpenCV writes it."""
    return (
        f"{name}: !!opencv-matrix\n   rows: {len(values) // columns}\n   cols: {columns}\n"
        f"   dt: d\n   data: {[float(value) for value in values]}\n"
    )


ROS1 = f"""header:
  seq: 233
  frame_id: "camera"
height: 480
width: 640
distortion_model: "plumb_bob"
D: {list(D)}
K: {ROWS}
R: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
P: [300.0, 0.0, 320.0, 0.0, 0.0, 300.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: False
---
"""
ROS2 = (
    "header:\n  frame_id: camera\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n"
    + "".join(
        f"{name}:\n" + "".join(f"- {value}\n" for value in values)
        for name, values in (("d", D), ("k", ROWS), ("r", [1, 0, 0, 0, 1, 0, 0, 0, 1]))
    )
    + "binning_x: 0\nbinning_y: 0\n"
    + "roi:\n  x_offset: 0\n  y_offset: 0\n  height: 0\n  width: 0\n---\n"
)


def ost(shift: float = 0.0, name: str = "narrow_stereo") -> str:
    """An ost.txt, of the right camera if the last column of its projection is not 0."""
    return f"""# oST version 5.0 parameters


[image]

width
640

height
480

[{name}]

camera matrix
{FX} 0.000000 {CX}
0.000000 {FY} {CY}
0.000000 0.000000 1.000000

distortion
{" ".join(map(str, D))}

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
300.0 0.000000 320.0 {shift}
0.000000 300.0 240.0 0.000000
0.000000 0.000000 1.000000 0.000000
"""


OST = ost()
OST_PAIR = ost(name="narrow_stereo/left") + "\n" + ost(-36.0, "narrow_stereo/right")
EUROC = f"""#Default cam0
%YAML:1.0
sensor_type: camera
comment: VI-Sensor cam0
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [640, 480]
camera_model: pinhole
intrinsics: [{FX}, {FY}, {CX}, {CY}] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: {list(D[:4])}
"""
EUROC_RIGHT = EUROC.replace("[1, 0, 0, 0, 0,", f"[1, 0, 0, {BASELINE}, 0,")
VINS = f"""%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 640
image_height: 480
distortion_parameters:
   k1: {D[0]}
   k2: {D[1]}
   p1: {D[2]}
   p2: {D[3]}
projection_parameters:
   fx: {FX}
   fy: {FY}
   cx: {CX}
   cy: {CY}
"""
#: The configuration of VINS-Mono has a camera and OpenCV's matrices in one file.
VINS_MONO = VINS + matrix("extrinsicRotation", [1, 0, 0, 0, 1, 0, 0, 0, 1])
STELLA = f"""Camera:
  name: "USB cam"
  setup: "monocular"
  model: "perspective"
  fx: {FX}
  fy: {FY}
  cx: {CX}
  cy: {CY}
  k1: {D[0]}
  k2: {D[1]}
  p1: {D[2]}
  p2: {D[3]}
  k3: {D[4]}
  fps: 20.0
  cols: 640
  rows: 480
  color_order: "RGB"
Feature:
  scale_factor: 1.2
"""
FCA = f"""image:
  width: 640
  height: 480
parameter:
  fx: {FX}
  fy: {FY}
  cx: {CX}
  cy: {CY}
  k1: {D[0]}
  k2: {D[1]}
  k3: {D[4]}
  p1: {D[2]}
  p2: {D[3]}
"""


def basalt(kind: str, *cameras: dict[str, float], baseline: float = BASELINE) -> str:
    """A calibration of Basalt; the second camera stands to the right of the first."""
    still = {"py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}
    return json.dumps(
        {
            "value0": {
                "T_imu_cam": [{"px": i * baseline, **still} for i in range(len(cameras))],
                "intrinsics": [{"camera_type": kind, "intrinsics": one} for one in cameras],
                "resolution": [list(SIZE) for _ in cameras],
            }
        }
    )


RADTAN8 = dict(zip(("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"), RATIONAL, strict=True))
BASALT = basalt("pinhole", NUMBERS)
BASALT_PAIR = basalt("pinhole-radtan8", NUMBERS | RADTAN8, NUMBERS | RADTAN8)


def oak_camera(
    socket: int, to: int, centimetres: float, kind: int = 0, coefficients: Any = RATIONAL
) -> list[Any]:
    """A camera of an OAK calibration and where the next one stands."""
    return [
        socket,
        {
            "cameraType": kind,
            "distortionCoeff": [*coefficients, 0, 0, 0, 0, 0, 0][:14],
            "extrinsics": {
                "rotationMatrix": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
                "toCameraSocket": to,
                "translation": {"x": centimetres, "y": 0.0, "z": 0.0},
            },
            "height": 480,
            "width": 640,
            "intrinsicMatrix": K,
        },
    ]


#: Colour camera on socket 0 between the pair of 1 (left) and 2 (right), 12 cm apart.
OAK = json.dumps(
    {
        "boardName": "X",
        "cameraData": [
            oak_camera(0, -1, 0.0),
            oak_camera(1, 2, -12.0),
            oak_camera(2, 0, 6.0),
            [3, {"width": 0, "height": 0}],
        ],
    }
)


def zed(*names: str, factor: float = 1.0) -> str:
    """A calibration of a ZED camera for resolutions of these names."""
    text = ""
    for name in names:
        for side in ("LEFT", "RIGHT"):
            text += f"[{side}_CAM_{name}]\nfx={FX * factor}\nfy={FY * factor}\n"
            text += f"cx={CX * factor}\ncy={CY * factor}\n"
            text += f"k1={D[0]}\nk2={D[1]}\np1={D[2]}\np2={D[3]}\nk3={D[4]}\n\n"
    text += "[STEREO]\nBaseline=120.0\nTY=0.0\nTZ=0.0\n"
    return text + "".join(f"CV_{name}=0.001\nRX_{name}=0.0\nRZ_{name}=0.0\n" for name in names)


#: nerfstudio's centre of the first pixel is (0.5, 0.5).
NERFSTUDIO_NUMBERS = {"fl_x": FX, "fl_y": FY, "cx": CX + 0.5, "cy": CY + 0.5, "w": 640, "h": 480}
LENS = dict(zip(("k1", "k2", "p1", "p2", "k3"), D, strict=True))
FRAME = {"file_path": "images/1.png", "transform_matrix": [[1, 0, 0, 0]]}
NERFSTUDIO = json.dumps(
    {"camera_model": "OPENCV", **NERFSTUDIO_NUMBERS, **LENS, "frames": [FRAME, FRAME]}
)
NERFSTUDIO_FRAMES = json.dumps({"frames": [{**NERFSTUDIO_NUMBERS, **LENS, **FRAME}]})
OPEN3D = json.dumps({"width": 640, "height": 480, "intrinsic_matrix": COLUMNS})
REPLICA = json.dumps({"camera": {"w": 640, "h": 480, **NUMBERS, "scale": 6553.5}})
RECORD3D = json.dumps({"w": 640, "h": 480, "K": COLUMNS, "fps": 60, "poses": [[0] * 7]})
POLYCAM = json.dumps({**NUMBERS, "width": 640, "height": 480, "t_00": 1, "blur_score": 55.0})
REALSENSE = json.dumps(
    {
        "fx": FX,
        "fy": FY,
        "ppx": CX,
        "ppy": CY,
        "width": 640,
        "height": 480,
        "model": "distortion.inverse_brown_conrady",
        "coeffs": [0, 0, 0, 0, 0],
    }
)
SIMPLE = json.dumps(
    {"camera_matrix": K, "dist_coeff": [list(D)], "image_width": 640, "image_height": 480}
)
SIMPLE_YAML = f"fx: {FX}\nfy: {FY}\ncx: {CX}\ncy: {CY}\nwidth: 640\nheight: 480\n"
OPENCV_PAIR = (
    "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    + matrix("M1", ROWS)
    + matrix("D1", D, 5)
    + matrix("M2", [FX + 1, *ROWS[1:]])
    + matrix("D2", D, 5)
    + matrix("R", [1, 0, 0, 0, 1, 0, 0, 0, 1])
    + matrix("T", [-BASELINE, 0, 0], 1)
)


def kalibr_pair(degrees: float, x: float = -BASELINE) -> str:
    """A camchain whose second camera is turned to the right by so many degrees."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    camera = f"""  camera_model: pinhole
  distortion_model: radtan
  distortion_coeffs: {list(D[:4])}
  intrinsics: [{FX}, {FY}, {CX}, {CY}]
  resolution: [640, 480]
"""
    rows = [[c, 0.0, -s, x], [0.0, 1.0, 0.0, 0.0], [s, 0.0, c, 0.0], [0.0, 0.0, 0.0, 1.0]]
    return f"cam0:\n{camera}cam1:\n{camera}  T_cn_cnm1:\n" + "".join(f"  - {row}\n" for row in rows)


#: Calibrations that cannot be used, by the names of their files.
WRONG: dict[str, str] = {
    "back.yaml": kalibr_pair(180),
    "equi.yaml": kalibr_pair(0).replace("radtan", "equidistant"),
    "ds.json": basalt("ds", NUMBERS),
    "kb4.json": basalt("kb4", NUMBERS),
    "quaternion.json": BASALT_PAIR.replace('"qw": 1', '"qw": 3'),
    "nofx.json": BASALT.replace('"fx"', '"f"'),
    "cut.json": NERFSTUDIO[:200],
    "frames.json": NERFSTUDIO.replace('"frames": [', '"frames": [{"fl_x": 1.0}, '),
    "k4.json": NERFSTUDIO.replace('"k1"', '"k4": 0.2, "k1"'),
    "panorama.json": NERFSTUDIO.replace("OPENCV", "EQUIRECTANGULAR"),
    "nobody.json": SIMPLE.replace("dist_coeff", 'model": "cubic", "dist_coeff'),
    "short.json": json.dumps({"camera_matrix": [[1, 0], [0, 1]]}),
    "negative.json": POLYCAM.replace(f'"fx": {FX}', '"fx": -5'),
    "no_size.yml": OPENCV_PAIR.replace("image_width: 640\nimage_height: 480\n", ""),
    "no_place.yml": OPENCV_PAIR.partition("R: !!")[0],
    "mirror.yml": OPENCV_PAIR.replace("1.0, 0.0, 0.0, 0.0, 1.0", "-1.0, 0.0, 0.0, 0.0, 1.0"),
    "two.conf": zed("HD", "VGA"),
    "bad.conf": zed("HD").replace(f"fy={FY}", "fy=much"),
    "empty_oak.json": '{"cameraData": []}',
    "socket.json": '{"cameraData": [[0]]}',
    "zero.yaml": ROS1.replace(str(ROWS), str([0.0] * 9)),
    "roi.yaml": ROS1.replace("x_offset: 0", "x_offset: 700"),
    "seven.yaml": ROS1.replace(str(list(D)), str([0.1] * 7)),
    "prism.yaml": ROS1.replace(str(list(D)), str([0.1] * 14)),
    "words.txt": OST.replace("distortion\n", "distortion\nnone of it\n"),
    "half.txt": OST.partition("distortion")[0],
    "mei.yaml": "model_type: MEI\nimage_width: 640\nimage_height: 480\n",
    "rate.yaml": STELLA.replace("fps: 20.0", "fps: often"),
    "turned.yaml": EUROC.replace("data: [1, 0", "data: [2, 0"),
    "half.yaml": EUROC.replace("640", "640.5"),
    "kb8.yaml": 'Camera.type: "KannalaBrandt8"\nCamera1.fx: 200\n',
    "imu.yaml": "imu0:\n  update_rate: 200.0\n",
    "nested.json": '{"cam": {"fx": 500, "fy": 501, "cx": 320, "cy": 240}}',
}
