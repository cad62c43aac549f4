# SPDX-License-Identifier: BSD-3-Clause
"""Settings from calibration files of other programs: OpenCV, Kalibr, ROS and COLMAP.

All of these use OpenCV's distortion, and but for COLMAP also its pixels, in which the centre of the
top-left pixel is (0, 0).
"""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path

import cv2
import numpy as np

from orbslam2py.calibration.camera_model import (
    CameraModel,
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    five_coefficients,
    require_supported,
)
from orbslam2py.calibration.yaml_camera_files import (
    kalibr_settings,
    parse_yaml,
    ros_camera,
    ros_pair_settings,
)
from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Settings


class CameraFileFormat(str, Enum):
    """Who wrote a calibration file."""

    AUTO = "auto"
    OPENCV = "opencv"
    KALIBR = "kalibr"
    ROS = "ros"
    COLMAP = "colmap"

    def __str__(self) -> str:
        return self.value


def read_camera_file(
    path: str | Path,
    file_format: CameraFileFormat = CameraFileFormat.AUTO,
    *,
    camera: int | None = None,
    right: str | Path | None = None,
    fps: float = 30.0,
    n_features: int = 1000,
) -> Settings:
    """Make settings of another program's calibration file.

    Parameters
    ----------
    path
        The file.
    file_format
        Who wrote it; by default told by its content.
    camera
        Number of the camera: ``cam0``, ``cam1`` ... of Kalibr, ``CAMERA_ID`` of COLMAP. By default
        the only one; of a Kalibr file with several the pair of the first two.
    right
        ROS: the file of the right camera of a rectified pair; `path` is the left one's.
    fps, n_features
        Frames per second and ORB features per image, which such files do not tell.

    Returns
    -------
    Settings
        For a single camera, or for a stereo pair with its rectification.

    Raises
    ------
    SettingsError
        If the file cannot be read or understood, or has a camera model that is not supported.
    """
    path = Path(path)
    text = _read_text(path)
    if file_format is CameraFileFormat.AUTO:
        file_format = _recognise(path, text)
    if right is not None and file_format is not CameraFileFormat.ROS:
        raise SettingsError(f"a file of the right camera goes with ros files, {path} is not one")
    if camera is not None and file_format in (CameraFileFormat.OPENCV, CameraFileFormat.ROS):
        raise SettingsError(f"{path} holds one camera; choosing camera {camera} makes no sense")
    if file_format is CameraFileFormat.COLMAP:
        return _colmap(path, text, camera).settings(fps, n_features)
    if file_format is CameraFileFormat.OPENCV:
        return _opencv(path, text).settings(fps, n_features)
    if file_format is CameraFileFormat.KALIBR:
        return kalibr_settings(path, parse_yaml(path, text), camera, fps, n_features)
    if right is None:
        return ros_camera(path, parse_yaml(path, text)).settings(fps, n_features)
    right = Path(right)
    pair = (path, parse_yaml(path, text)), (right, parse_yaml(right, _read_text(right)))
    return ros_pair_settings(pair[0], pair[1], fps, n_features)


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise SettingsError(f"cannot open {path}: {error.strerror or error}") from error


def _recognise(path: Path, text: str) -> CameraFileFormat:
    if re.search(r"^cam\d+\s*:", text, re.MULTILINE):
        return CameraFileFormat.KALIBR
    if "opencv-matrix" in text or "<opencv_storage>" in text:
        return CameraFileFormat.OPENCV
    if re.search(r"^camera_matrix\s*:", text, re.MULTILINE):
        return CameraFileFormat.ROS
    if re.search(r"^\s*\d+\s+[A-Z][A-Z_]+\s+\d+\s+\d+\s", text, re.MULTILINE):
        return CameraFileFormat.COLMAP
    raise SettingsError(
        f"{path} is no camera file we know: an OpenCV file (matrices), Kalibr's camchain.yaml "
        "(cam0), ROS's camera_info (camera_matrix) or COLMAP's cameras.txt. Name the format if it "
        "is one of them"
    )


# ---- OpenCV --------------------------------------------------------------------------------------
_OPENCV_NAMES = {
    "camera_matrix": ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "M1", "mtx"),
    "distortion_coefficients": (
        "distortion_coefficients",
        "Distortion_Coefficients",
        "distCoeffs",
        "dist_coeffs",
        "distortion",
        "dist",
        "D",
        "D1",
    ),
    "image_width": ("image_width", "image_Width", "width"),
    "image_height": ("image_height", "image_Height", "height"),
}


def _opencv(path: Path, text: str) -> CameraModel:
    try:
        with quiet_opencv():
            storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            if _node(storage, "fisheye_model").real():
                require_supported(path, "camera model", "fisheye", ("pinhole",))
            K = _node(storage, "camera_matrix").mat()
            D = _node(storage, "distortion_coefficients").mat()
            sizes = [_node(storage, name) for name in ("image_width", "image_height")]
            size = None if any(s.empty() for s in sizes) else [int(s.real()) for s in sizes]
            if size is None and not _node(storage, "image_size").empty():
                node = _node(storage, "image_size")
                size = [int(node.at(i).real()) for i in range(2)]
    except (cv2.error, SystemError) as error:
        raise SettingsError(f"{path} is no file that OpenCV reads: {error}") from error
    if K is None:
        names = ", ".join(_OPENCV_NAMES["camera_matrix"])
        raise SettingsError(f"{path} has no camera matrix (looked for {names})")
    return CameraModel(
        checked_camera_matrix(path, np.asarray(K)),
        five_coefficients(path, np.zeros(0) if D is None else np.asarray(D)),
        None if size is None else checked_size(path, size),
    )


def _node(storage: cv2.FileStorage, name: str) -> cv2.FileNode:
    for alias in _OPENCV_NAMES.get(name, (name,)):
        node = storage.getNode(alias)
        if not node.empty():
            return node
    return storage.getNode(name)


# ---- COLMAP --------------------------------------------------------------------------------------
#: Where fx, fy, cx, cy, k1, k2, p1, p2 are among the parameters of a model; -1: zero.
_COLMAP = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2, -1, -1, -1, -1),
    "PINHOLE": (0, 1, 2, 3, -1, -1, -1, -1),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
}


def _colmap(path: Path, text: str, number: int | None) -> CameraModel:
    cameras: dict[int, tuple[int, list[str]]] = {}
    for line_number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) < 5 or not fields[0].isdecimal():
            raise SettingsError(
                f"{path}:{line_number}: expected 'CAMERA_ID MODEL WIDTH HEIGHT PARAMS...'"
            )
        cameras[int(fields[0])] = (line_number, fields[1:])
    ids = ", ".join(map(str, cameras))
    if not cameras:
        raise SettingsError(f"{path} lists no camera")
    if number is None and len(cameras) > 1:
        raise SettingsError(f"{path} lists {len(cameras)} cameras ({ids}); choose one by number")
    if number is not None and number not in cameras:
        raise SettingsError(f"{path} has no camera {number}; there are: {ids}")
    line_number, (model, *values) = cameras[next(iter(cameras)) if number is None else number]
    where = Path(f"{path}:{line_number}")
    require_supported(where, "camera model", model, tuple(_COLMAP))
    places = _COLMAP[model]
    try:
        width, height, *parameters = [float(value) for value in values]
    except ValueError as error:
        raise SettingsError(f"{where}: {error}") from None
    checked_numbers(where, f"parameters of {model}", parameters, (max(places) + 1,))
    fx, fy, cx, cy, k1, k2, p1, p2 = (0.0 if i < 0 else parameters[i] for i in places)
    # COLMAP's pixels begin at their corner: the centre of the first one is (0.5, 0.5).
    K = np.array([[fx, 0.0, cx - 0.5], [0.0, fy, cy - 0.5], [0.0, 0.0, 1.0]])
    return CameraModel(
        K=K,
        distortion=np.array([k1, k2, p1, p2, 0.0]),
        size=checked_size(where, [width, height]),
    )
