# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files of other programs: their names, signs and commands.

`FORMATS` is the only list of them. `orbslam2py.calibration.formats` adds their readers, and the
documentation is generated from it.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from orbslam2py._arrays import FloatArray
from orbslam2py.settings.sensor import Sensor


class CalibrationText:
    """The text of a file, and its contents if it is JSON.

    Parameters
    ----------
    text
        The text.
    """

    def __init__(self, text: str) -> None:
        self.text = text

    @cached_property
    def json(self) -> Mapping[str, Any]:
        """Return the named values of JSON; empty if the text is no JSON."""
        try:
            values = json.loads(self.text)
        except (ValueError, RecursionError):
            return {}
        return values if isinstance(values, dict) else {}

    def has(self, *keys: str) -> bool:
        """Return whether JSON has all these keys."""
        return all(key in self.json for key in keys)


@dataclass(frozen=True)
class ForeignFormat:
    """A kind of calibration file.

    Attributes
    ----------
    name
        As ``--format`` of ``import-camera`` takes it.
    noun
        Name of the file, with its article.
    written_by
        The programs that write it.
    description
        The data that are read from it, in one line.
    sign
        Return whether a text is of this kind.
    example
        A line or two of such a file, by which it is recognised.
    pair
        What settings of a stereo pair need: "file" (it has the pair), "right" (also the file of the
        right camera), or "baseline" (rectified images and their baseline).
    rate
        Usual number of images per second.
    """

    name: str
    noun: str
    written_by: str
    description: str
    sign: Callable[[CalibrationText], bool] = field(repr=False)
    example: str
    pair: str = "baseline"
    rate: int = 30


def _line(*patterns: str) -> Callable[[CalibrationText], bool]:
    """A sign: lines with this beginning."""
    found = [re.compile(pattern, re.MULTILINE) for pattern in patterns]
    return lambda content: all(one.search(content.text) for one in found)


def _is_opencv(content: CalibrationText) -> bool:
    """Settings of ORB-SLAM contain matrices of OpenCV too."""
    found = re.search(r"opencv-(?:nd-)?matrix|<opencv_storage>", content.text)
    return bool(found) and not _line(r"^Camera1?\.fx\s*:")(content)


def _is_opencv_pair(content: CalibrationText) -> bool:
    return bool(re.search(r"\b(?:[MK]2|[KM]R|\w*[mM]atrix_?[2R]|\w*right\w*)\b", content.text))


def _is_nerfstudio(content: CalibrationText) -> bool:
    frames = content.json.get("frames")
    if not isinstance(frames, list):
        return False
    first = frames[0] if frames and isinstance(frames[0], dict) else {}
    return bool({"fl_x", "camera_angle_x", "camera_model"} & (set(content.json) | set(first)))


def _is_replica(content: CalibrationText) -> bool:
    camera = content.json.get("camera")
    return isinstance(camera, dict) and {"fx", "fy", "cx", "cy", "scale"} <= set(camera)


def _is_open3d(content: CalibrationText) -> bool:
    inner = content.json.get("intrinsic", content.json)
    return isinstance(inner, dict) and {"intrinsic_matrix", "width", "height"} <= set(inner)


def _is_basalt(content: CalibrationText) -> bool:
    inner = content.json.get("value0")
    return isinstance(inner, dict) and "intrinsics" in inner


def _is_woodscape(content: CalibrationText) -> bool:
    inner = content.json.get("intrinsic")
    return isinstance(inner, dict) and inner.get("model") == "radial_poly" and "cx_offset" in inner


#: Keys of a camera matrix in files without a known format.
MATRIX_KEYS = ("camera_matrix", "cameraMatrix", "intrinsic_matrix", "mtx", "K", "intrinsics")


def _is_numbers(content: CalibrationText) -> bool:
    if {"fx", "fy"} <= set(content.json) or any(key in content.json for key in MATRIX_KEYS):
        return True
    return _line(r"^fx\s*:", r"^fy\s*:", r"^cx\s*:", r"^cy\s*:")(content)


_NUMBER = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"

#: All kinds, in the order in which they are tried: those with the clearer sign first.
FORMATS: tuple[ForeignFormat, ...] = (
    ForeignFormat(
        "kalibr",
        "a camchain of Kalibr",
        "Kalibr",
        "One camera, or the pair of the first two with its rectification. Fisheyes, also pairs: "
        "pinhole-equi, pinhole-fov, ds-none, eucm-none, omni-radtan, omni-none.",
        _line(r"^cam\d+\s*:"),
        "cam0:\n  camera_model: pinhole",
        "file",
    ),
    ForeignFormat(
        "vins",
        "a camera of VINS (camodocal)",
        "VINS-Mono, VINS-Fusion, camodocal",
        "One camera of the model PINHOLE, PINHOLE_FULL, KANNALA_BRANDT or MEI.",
        _line(r"^model_type\s*:"),
        "model_type: PINHOLE\ndistortion_parameters:",
    ),
    ForeignFormat(
        "opencv",
        "a calibration of OpenCV",
        "OpenCV's FileStorage (YAML or XML), its calibration samples",
        "One camera, or the pair of M1, D1, M2, D2, R, T with its rectification. A fisheye with "
        "fisheye_model: 1 or distortion_model: fisheye.",
        _is_opencv,
        "camera_matrix: !!opencv-matrix",
    ),
    ForeignFormat(
        "ros",
        "a camera_info of ROS",
        "ROS's camera_calibration, rostopic echo, ros2 topic echo",
        "One camera, also of the model equidistant; two files with --right are a pair.",
        lambda content: (
            _line(r"^camera_matrix\s*:")(content)
            or _line(r"^[kK]\s*:", r"^distortion_model\s*:")(content)
        ),
        "distortion_model: plumb_bob\nK: [200.0, 0.0, 159.5, 0.0, 200.0, 119.5, 0.0, 0.0, 1.0]",
        "right",
    ),
    ForeignFormat(
        "ost",
        "an ost.txt of ROS",
        "ROS's camera_calibration",
        "One camera, or the pair if it holds both; two files with --right are a pair as well.",
        _line(r"^\[image\]\s*$", r"^camera matrix\s*$"),
        "[narrow_stereo]\ncamera matrix",
        "right",
    ),
    ForeignFormat(
        "colmap",
        "a camera list of COLMAP",
        "COLMAP's cameras.txt",
        "The camera of --camera, of any pinhole model, or FOV and the fisheye models without thin "
        "prism.",
        _line(r"^\s*\d+\s+[A-Z][A-Z_]+\s+\d+\s+\d+\s"),
        "1 PINHOLE 640 480 500 500 320 240",
    ),
    ForeignFormat(
        "kitti",
        "a calibration of KITTI",
        "KITTI's calib.txt, calib_cam_to_cam.txt",
        "The rectified grey pair; --camera 2 --sensor stereo for the colour pair.",
        _line(rf"^P(?:_rect_0)?\d:(?:[ \t]+{_NUMBER}){{12}}\s*$"),
        "P0: 718.86 0 607.19 0 0 718.86 185.22 0 0 0 1 0",
        "file",
        10,
    ),
    ForeignFormat(
        "euroc",
        "a sensor.yaml of EuRoC",
        "EuRoC's and TUM-VI's sensor.yaml of a camera",
        "One camera, also equidistant; two files with --right are a pair, with its rectification.",
        _line(r"^sensor_type\s*:\s*camera", r"^intrinsics\s*:"),
        "sensor_type: camera\nintrinsics: [458.654, 457.296, 367.215, 248.375]",
        "right",
        20,
    ),
    ForeignFormat(
        "stella_vslam",
        "a configuration of stella_vslam",
        "stella_vslam, OpenVSLAM",
        "One camera of the model perspective or fisheye.",
        _line(r"^Camera\s*:\s*$", r"^[ \t]+fx\s*:", r"^[ \t]+model\s*:"),
        "Camera:\n  model: perspective",
    ),
    ForeignFormat(
        "zed",
        "a calibration of a ZED camera",
        "Stereolabs' SN*.conf",
        "The pair of the resolution that --size chooses, with its rectification.",
        _line(r"^\[LEFT_CAM_\w+\]"),
        "[LEFT_CAM_HD]\nfx=700.5",
        "file",
    ),
    ForeignFormat(
        "oak",
        "a calibration of an OAK camera",
        "DepthAI (OAK cameras), JSON",
        "The stereo pair with its rectification, or the camera of a socket.",
        lambda content: content.has("cameraData"),
        '{"cameraData": [[0, {"intrinsicMatrix": ...}]]}',
        "file",
    ),
    ForeignFormat(
        "basalt",
        "a calibration of Basalt",
        "Basalt, JSON",
        "One camera or the pair of the first two, also kb4, ds, eucm, ucm and fov; pinhole pairs "
        "with their rectification.",
        _is_basalt,
        '{"value0": {"intrinsics": [{"camera_type": "pinhole", ...}]}}',
        "file",
    ),
    ForeignFormat(
        "nerfstudio",
        "a transforms.json of nerfstudio",
        "nerfstudio, instant-ngp, orbslam2py map export",
        "The camera of all its frames, OPENCV or OPENCV_FISHEYE.",
        _is_nerfstudio,
        '{"camera_model": "OPENCV", "fl_x": 500.0, "frames": [...]}',
    ),
    ForeignFormat(
        "open3d",
        "an intrinsic of Open3D",
        "Open3D's PinholeCameraIntrinsic, JSON",
        "One camera without distortion.",
        _is_open3d,
        '{"width": 640, "height": 480, "intrinsic_matrix": [525, 0, 0, 0, 525, 0, 320, 240, 1]}',
    ),
    ForeignFormat(
        "replica",
        "a cam_params.json of Replica",
        "Replica as NICE-SLAM renders it",
        "One camera without distortion, and the factor of its depth images.",
        _is_replica,
        '{"camera": {"w": 1200, "h": 680, "fx": 600.0, ..., "scale": 6553.5}}',
    ),
    ForeignFormat(
        "record3d",
        "metadata of Record3D",
        "Record3D (iPhone), metadata",
        "The camera of the colour images.",
        lambda content: content.has("K", "w", "h"),
        '{"w": 720, "h": 960, "K": [757.2, 0, 0, 0, 757.2, 0, 360.5, 480.1, 1], "fps": 60}',
    ),
    ForeignFormat(
        "polycam",
        "a frame of Polycam",
        "Polycam's raw data, a file of cameras/",
        "The camera of this frame.",
        lambda content: content.has("fx", "fy", "t_00"),
        '{"fx": 720.3, "fy": 720.3, "cx": 512.5, "cy": 384.2, "t_00": ..., "width": 1024}',
    ),
    ForeignFormat(
        "fca",
        "a camera of the Fisheye-Calib-Adapter",
        "Fisheye-Calib-Adapter",
        "One camera of its models RadTan, KB, DS, EUCM and UCM.",
        _line(r"^image\s*:\s*$", r"^parameter\s*:\s*$"),
        "image:\n  width: 752\nparameter:\n  fx: 459.26",
    ),
    ForeignFormat(
        "woodscape",
        "a camera of WoodScape",
        "WoodScape, JSON",
        "One camera: the model of ours that comes closest to its polynomial is fitted.",
        _is_woodscape,
        '{"intrinsic": {"model": "radial_poly", "cx_offset": 3.9, ...}}',
    ),
    ForeignFormat(
        "aria",
        "a calibration of Project Aria",
        "Project Aria, JSON",
        "One camera: the model of ours that comes closest to FISHEYE624 is fitted. Needs --size.",
        lambda content: content.has("CameraCalibrations"),
        '{"CameraCalibrations": [{"Projection": {"Name": "FisheyeRadTanThinPrism", ...}}]}',
        "file",
    ),
    ForeignFormat(
        "realsense",
        "a factory calibration of a RealSense camera",
        "rs-enumerate-devices -c",
        "The cameras of the resolution that --size chooses: one, or the infrared or fisheye pair.",
        _line(r'^\s*Intrinsic of\s+"'),
        'Intrinsic of "Infrared 1" / 848x480 / {Y8}\n  Width: 848\n  PPX: 424.1',
        "file",
    ),
    ForeignFormat(
        "numbers",
        "the numbers of a camera",
        "your own scripts, RealSense tools: JSON or YAML",
        "One camera of fx, fy, cx, cy (or a camera matrix) and its coefficients; a fisheye with "
        "its model, such as fisheye or ds.",
        _is_numbers,
        '{"fx": 600.0, "fy": 600.0, "cx": 320.0, "cy": 240.0, "width": 640, "height": 480}',
    ),
)

_BY_NAME = {one.name: one for one in FORMATS}
#: What files of each are called.
FOREIGN_FORMATS = {one.name: one.noun for one in FORMATS}


def recognise_camera_file(text: str) -> str | None:
    """Return the program of a calibration file by its text: a key of `FOREIGN_FORMATS`, or None."""
    content = CalibrationText(text)
    return next((one.name for one in FORMATS if one.sign(content)), None)


def import_line(path: Path, file_format: str, sensor: Sensor, text: str) -> str:
    """Return the command that converts such a file to settings; `text` is its content."""
    kind = _BY_NAME[file_format]
    words = ["orbslam2py", "import-camera", str(path), "--sensor", str(sensor)]
    if sensor is Sensor.RGBD:
        words += ["--depth-factor", "1000"]
    elif sensor is Sensor.STEREO and kind.pair == "right":
        words += ["--right", "RIGHT.yaml"]
    elif sensor is Sensor.STEREO and kind.pair == "baseline":
        pair = file_format == "opencv" and _is_opencv_pair(CalibrationText(text))
        words += [] if pair else ["--baseline", "METRES"]
    return shlex.join([*words, "--fps", str(kind.rate), "--output", "my.yaml"])


def new_line(sensor: Sensor) -> str:
    """Return the command that makes settings, with places for a camera's parameters."""
    words = ["orbslam2py settings new --sensor", str(sensor), "--fx FX --fy FY --cx CX --cy CY"]
    if sensor is Sensor.RGBD:
        words.append("--depth-factor 1000")
    elif sensor is Sensor.STEREO:
        words.append("--baseline METRES")
    return " ".join([*words, "--output my.yaml"])


def filled_line(K: FloatArray, size: tuple[int, int] | None, sensor: Sensor) -> str:
    """Return the command of `new_line` with the numbers of a camera matrix (3, 3) filled in."""
    line = new_line(sensor)
    for word, (row, column) in {"FX": (0, 0), "FY": (1, 1), "CX": (0, 2), "CY": (1, 2)}.items():
        line = line.replace(f" {word} ", f" {float(K[row, column])!r} ")
    sized = "" if size is None else f"--size {size[0]}x{size[1]} "
    return line.replace("--output", f"{sized}--output")
