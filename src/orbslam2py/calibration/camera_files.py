# SPDX-License-Identifier: BSD-3-Clause
"""Settings from calibration files of other programs: OpenCV, Kalibr, ROS, COLMAP and KITTI.

All of these use OpenCV's distortion, and but for COLMAP also its pixels, in which the centre of the
top-left pixel is (0, 0).
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arguments import cannot_open, member_of, path_of
from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    CameraModel,
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    five_coefficients,
    require_supported,
)
from orbslam2py.calibration.kitti_camera_file import kitti_settings
from orbslam2py.calibration.yaml_camera_files import (
    kalibr_settings,
    parse_yaml,
    ros_camera,
    ros_pair_settings,
)
from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.errors import SettingsError
from orbslam2py.settings import OrbSettings, Sensor, Settings, settings_for_camera
from orbslam2py.settings.foreign import recognise_camera_file


class CameraFileFormat(str, Enum):
    """Who wrote a calibration file."""

    AUTO = "auto"
    OPENCV = "opencv"
    KALIBR = "kalibr"
    ROS = "ros"
    COLMAP = "colmap"
    KITTI = "kitti"

    def __str__(self) -> str:
        return self.value


def read_camera_file(
    path: str | Path,
    file_format: CameraFileFormat | str = CameraFileFormat.AUTO,
    *,
    camera: int | None = None,
    right: str | Path | None = None,
    sensor: Sensor | str | None = None,
    baseline: float | None = None,
    depth_factor: float | None = None,
    fps: float | None = None,
    n_features: int | None = None,
) -> Settings:
    """Make settings of another program's calibration file.

    Parameters
    ----------
    path
        The file.
    file_format
        Who wrote it, also as text (``"kalibr"``); by default told by its content.
    camera
        Number of the camera: ``cam0``, ``cam1`` ... of Kalibr, ``CAMERA_ID`` of COLMAP, ``P0`` to
        ``P3`` of KITTI. By default the only one; of a file of Kalibr or KITTI with several the pair
        of the first two.
    right
        ROS: the file of the right camera of a rectified pair; `path` is the left one's.
    sensor
        What the settings are for; by default a single camera or the pair, as the file is.
    baseline, depth_factor
        As for `orbslam2py.settings.settings_for_camera`.
    fps, n_features
        Frames per second and ORB features per image, which such files do not tell. By default 30
        (KITTI: 10), and 1000 or, above 0.6 megapixels and for KITTI, 2000.

    Returns
    -------
    Settings
        For a single camera, an RGB-D camera, or a stereo pair with its rectification if it is raw.

    Raises
    ------
    SettingsError
        If the file cannot be read or understood, or has a camera model that is not supported; also
        for the name of a format that there is not.
    """
    path = path_of(path, "the calibration file", SettingsError)
    what = "the format of the calibration file"
    file_format = member_of(CameraFileFormat, file_format, what, SettingsError)
    text = _read_text(path)
    if file_format is CameraFileFormat.AUTO:
        file_format = _recognise(path, text)
    sensor = None if sensor is None else Sensor(sensor)
    settings = _read(path, text, file_format, camera, right, sensor, fps)
    if n_features is not None:
        settings = replace(settings, orb=OrbSettings(n_features=n_features))
    return _made_for(path, settings, sensor, baseline, depth_factor)


def _read(
    path: Path,
    text: str,
    file_format: CameraFileFormat,
    camera: int | None,
    right: str | Path | None,
    sensor: Sensor | None,
    fps: float | None,
) -> Settings:
    """Make settings of what the file holds: of one camera, or of a pair if none else is wanted."""
    alone = sensor is not None and sensor is not Sensor.STEREO
    if right is not None and file_format is not CameraFileFormat.ROS:
        raise SettingsError(
            f"a file of the right camera goes with ros files, {path} is not one; leave out --right"
        )
    if camera is not None and file_format in (CameraFileFormat.OPENCV, CameraFileFormat.ROS):
        raise SettingsError(f"{path} holds one camera, and no camera {camera}; leave out --camera")
    if file_format is CameraFileFormat.KITTI:
        return kitti_settings(path, text, camera, sensor, fps)
    fps = 30.0 if fps is None else fps
    if file_format is CameraFileFormat.COLMAP:
        return _colmap(path, text, camera).settings(fps)
    if file_format is CameraFileFormat.OPENCV:
        return _opencv(path, text).settings(fps)
    document = parse_yaml(path, text)
    if file_format is CameraFileFormat.KALIBR:
        return kalibr_settings(path, document, camera, fps, alone=alone)
    if right is None:
        return ros_camera(path, document).settings(fps)
    if alone:
        raise SettingsError(f"{path} and {right} are a pair; leave --right out for {sensor}")
    right = path_of(right, "the file of the right camera", SettingsError)
    return ros_pair_settings((path, document), (right, parse_yaml(right, _read_text(right))), fps)


def _made_for(
    path: Path,
    settings: Settings,
    sensor: Sensor | None,
    baseline: float | None,
    depth_factor: float | None,
) -> Settings:
    sensor = sensor or settings.sensor
    if settings.sensor is Sensor.STEREO and sensor is Sensor.STEREO and depth_factor is None:
        if baseline is not None:
            raise SettingsError(
                f"{path} tells the baseline, {settings.baseline:.4g} m; leave --baseline out"
            )
        return settings
    return settings_for_camera(
        settings.camera, sensor, baseline=baseline, depth_factor=depth_factor, orb=settings.orb
    )


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise SettingsError(cannot_open(path, error)) from error


def _recognise(path: Path, text: str) -> CameraFileFormat:
    known = recognise_camera_file(text)
    if known is not None:
        return CameraFileFormat(known)
    raise SettingsError(
        f"{path} is no camera file we know: an OpenCV file (matrices), Kalibr's camchain.yaml "
        "(cam0), ROS's camera_info (camera_matrix), COLMAP's cameras.txt or KITTI's calib.txt. "
        "Name the format if it is one of them"
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
            K = _matrix(_node(storage, "camera_matrix"))
            D = _matrix(_node(storage, "distortion_coefficients"))
            sizes = [_node(storage, name) for name in ("image_width", "image_height")]
            size = None if any(s.empty() for s in sizes) else [int(s.real()) for s in sizes]
            if size is None and not _node(storage, "image_size").empty():
                node = _node(storage, "image_size")
                size = [int(node.at(i).real()) for i in range(2)]
    except (cv2.error, SystemError) as error:
        # What it says of the reason is a line of its own source.
        raise SettingsError(
            f"{path} is damaged: OpenCV cannot read it, or a matrix in it has another size than it "
            "says; write it again with cv2.FileStorage, with camera_matrix 3 x 3 and "
            "distortion_coefficients"
        ) from error
    if K is None:
        names = ", ".join(_OPENCV_NAMES["camera_matrix"])
        raise SettingsError(
            f"{path} has no camera matrix (looked for {names}); is it a file of OpenCV?"
        )
    return CameraModel(
        checked_camera_matrix(path, K),
        five_coefficients(path, np.zeros(0) if D is None else D),
        None if size is None else checked_size(path, size),
    )


def _node(storage: cv2.FileStorage, name: str) -> cv2.FileNode:
    for alias in _OPENCV_NAMES.get(name, (name,)):
        node = storage.getNode(alias)
        if not node.empty():
            return node
    return storage.getNode(name)


def _matrix(node: cv2.FileNode) -> FloatArray | None:
    """Give what a node holds; None if there is no matrix.

    Number by number, as `mat` of OpenCV 4.11 makes nonsense of whole ones, "0" or "1", between
    others with a point.
    """
    known = node.mat()  # of which the shape is right, and what is no matrix is refused
    if known is None:
        return None
    known, data = np.asarray(known), node.getNode("data")
    numbers = np.array([data.at(i).real() for i in range(data.size())], dtype=np.float64)
    return numbers.reshape(known.shape)


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
                f"{path}:{line_number}: expected 'CAMERA_ID MODEL WIDTH HEIGHT PARAMS...'; is it "
                "cameras.txt of COLMAP?"
            )
        cameras[int(fields[0])] = (line_number, fields[1:])
    ids = ", ".join(map(str, cameras))
    if not cameras:
        raise SettingsError(f"{path} lists no camera")
    if number is None and len(cameras) > 1:
        raise SettingsError(
            f"{path} lists {len(cameras)} cameras ({ids}); choose one with --camera"
        )
    if number is not None and number not in cameras:
        raise SettingsError(
            f"{path} has no camera {number}; give --camera with one there is: {ids}"
        )
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
        K=checked_camera_matrix(where, K, model),
        distortion=np.array([k1, k2, p1, p2, 0.0]),
        size=checked_size(where, [width, height]),
    )
