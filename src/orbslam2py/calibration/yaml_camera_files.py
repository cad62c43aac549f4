# SPDX-License-Identifier: BSD-3-Clause
"""Calibration files in YAML: Kalibr's camchain and ROS's camera_info."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    CameraModel,
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    five_coefficients,
    require_supported,
)
from orbslam2py.datasets.rectification import rectification_of_pair
from orbslam2py.errors import SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    OrbSettings,
    Sensor,
    Settings,
    StereoRectification,
    builtin_settings,
)
from orbslam2py.settings.defaults import usual_n_features


def parse_yaml(path: Path, text: str) -> Mapping[str, Any]:
    """Parse the text of a file that holds named values.

    Raises
    ------
    SettingsError
        Naming the file, if it is no YAML or holds something else.
    """
    # OpenCV's head line, which some write, is no YAML.
    text = re.sub(r"\A%YAML:1\.0\s*(?:\n---)?", "", text)
    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise SettingsError(f"{path} is no YAML: {error}") from error
    if not isinstance(document, Mapping):
        raise SettingsError(f"{path} holds no named values")
    return document


def _value(path: Path, where: str, values: Mapping[str, Any], key: str) -> Any:
    if key not in values:
        raise SettingsError(f"{path}: {where}{key} is missing; add it, or name another --format")
    return values[key]


# ---- Kalibr --------------------------------------------------------------------------------------
def kalibr_settings(
    path: Path,
    document: Mapping[str, Any],
    number: int | None,
    fps: float,
    *,
    alone: bool = False,
) -> Settings:
    """Make settings of Kalibr's camchain: of one camera, or of the pair of the first two.

    Parameters
    ----------
    path, document
        The file, for messages, and its values.
    number
        Which camera; None for the only one or the pair.
    fps
        Frames per second, which the file does not tell.
    alone
        Take the first camera, not the pair.

    Raises
    ------
    SettingsError
        If values are missing or wrong, or a model is not supported.
    """
    names = sorted(
        (key for key in document if re.fullmatch(r"cam\d+", str(key))), key=lambda key: int(key[3:])
    )
    if not names:
        raise SettingsError(f"{path} has no cam0; is it a camchain of Kalibr?")
    if number is not None and f"cam{number}" not in names:
        raise SettingsError(
            f"{path} has no cam{number}; give --camera with one there is: {', '.join(names)}"
        )
    if number is not None or alone or len(names) == 1:
        name = names[0] if number is None else f"cam{number}"
        return _kalibr_camera(path, name, document[name]).settings(fps)
    left, right = (_kalibr_camera(path, name, document[name]) for name in names[:2])
    where = f"{names[1]}."
    given = _value(path, where, document[names[1]], "T_cn_cnm1")
    T = checked_numbers(path, f"{where}T_cn_cnm1", given, (16,)).reshape(4, 4)
    if np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-3:
        raise SettingsError(f"{path}: {where}T_cn_cnm1 is no 4 x 4 rigid transform")
    if left.size is None or left.size != right.size:
        raise SettingsError(f"{path}: the cameras of a pair must have the same resolution")
    for name, one in zip(names, (left, right), strict=False):
        _require_centre_inside(path, name, one)
    try:
        rectification = rectification_of_pair(
            (left.K, right.K), (left.distortion, right.distortion), T, left.size
        )
    except SettingsError as error:
        raise SettingsError(
            f"{path}: the pair cannot be rectified ({error}); look at intrinsics, "
            "distortion_coeffs and T_cn_cnm1"
        ) from error
    return _pair_settings(path, rectification, fps)


def _require_centre_inside(path: Path, name: str, one: CameraModel) -> None:
    """Refuse a camera of a pair whose images would be zoomed in on a place outside of them."""
    assert one.size is not None
    width, height = one.size
    cx, cy = float(one.K[0, 2]), float(one.K[1, 2])
    if not (0 <= cx < width and 0 <= cy < height):
        raise SettingsError(
            f"{path}: {name}.intrinsics has its centre at {cx:g}, {cy:g}, outside of the {width} x "
            f"{height} pixels of {name}.resolution; give both of the same images"
        )


def _kalibr_camera(path: Path, name: str, values: object) -> CameraModel:
    if not isinstance(values, Mapping):
        raise SettingsError(f"{path}: {name} holds no named values")
    where = f"{name}."
    model = _value(path, where, values, "camera_model")
    require_supported(path, f"{where}camera_model", model, ("pinhole",))
    distortion_model = values.get("distortion_model", "none")
    require_supported(path, f"{where}distortion_model", distortion_model, ("radtan", "none"))
    intrinsics = _value(path, where, values, "intrinsics")
    fx, fy, cx, cy = checked_numbers(path, f"{where}intrinsics", intrinsics, (4,))
    coefficients = np.zeros(0)
    if distortion_model == "radtan":
        given = _value(path, where, values, "distortion_coeffs")
        coefficients = checked_numbers(path, f"{where}distortion_coeffs", given, (4,))
    resolution = _value(path, where, values, "resolution")
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    return CameraModel(
        checked_camera_matrix(path, K, f"{where}intrinsics"),
        five_coefficients(path, coefficients),
        checked_size(path, checked_numbers(path, f"{where}resolution", resolution, (2,)).tolist()),
    )


# ---- ROS -----------------------------------------------------------------------------------------
_ROS_MODELS = ("plumb_bob", "rational_polynomial", "radtan")


def ros_camera(path: Path, values: Mapping[str, Any]) -> CameraModel:
    """Read the raw camera of ROS's camera_info.

    Raises
    ------
    SettingsError
        If values are missing or wrong, or the model is not supported.
    """
    model = values.get("distortion_model", "plumb_bob") or "plumb_bob"
    require_supported(path, "distortion_model", model, _ROS_MODELS)
    size = [_value(path, "", values, key) for key in ("image_width", "image_height")]
    K = _ros_matrix(path, values, ("camera_matrix", "K", "k"), (9,)).reshape(3, 3)
    return CameraModel(
        checked_camera_matrix(path, K),
        five_coefficients(
            path, _ros_matrix(path, values, ("distortion_coefficients", "D", "d"), ())
        ),
        checked_size(
            path, checked_numbers(path, "image_width and image_height", size, (2,)).tolist()
        ),
    )


def _ros_matrix(
    path: Path, values: Mapping[str, Any], names: tuple[str, ...], count: tuple[int, ...]
) -> FloatArray:
    name = next((name for name in names if name in values), None)
    if name is None:
        raise SettingsError(f"{path}: {names[0]} is missing; add it, or name another --format")
    value = values[name]
    if isinstance(value, Mapping):
        value = _value(path, f"{name}.", value, "data")
    return checked_numbers(path, name, value, count)


def ros_pair_settings(
    left: tuple[Path, Mapping[str, Any]],
    right: tuple[Path, Mapping[str, Any]],
    fps: float,
) -> Settings:
    """Make settings of the camera_info files of a rectified pair.

    Parameters
    ----------
    left, right
        Path, for messages, and values of either file.
    fps
        Frames per second, which the files do not tell.

    Raises
    ------
    SettingsError
        If values are missing or wrong, or the cameras are no rectified pair.
    """
    cameras = []
    for path, values in (left, right):
        raw = ros_camera(path, values)
        assert raw.size is not None
        R = _ros_matrix(path, values, ("rectification_matrix", "R", "r"), (9,)).reshape(3, 3)
        P = _ros_matrix(path, values, ("projection_matrix", "P", "p"), (12,)).reshape(3, 4)
        width, height = raw.size
        cameras.append(
            CameraRectification(K=raw.K, D=raw.distortion, R=R, P=P, width=width, height=height)
        )
    if (cameras[0].width, cameras[0].height) != (cameras[1].width, cameras[1].height):
        raise SettingsError(f"{left[0]} and {right[0]} have different image sizes")
    P_left, P_right = cameras[0].P, cameras[1].P
    if np.abs(P_left[:, :3] - P_right[:, :3]).max() > 1e-3 or abs(P_left[0, 3]) > 1e-6:
        raise SettingsError(
            f"{left[0]} and {right[0]} are no rectified pair: their projection_matrix must be "
            "equal but for the last column, which is 0 for the left camera"
        )
    rectification = StereoRectification(left=cameras[0], right=cameras[1])
    return _pair_settings(right[0], rectification, fps)


def _pair_settings(path: Path, rectification: StereoRectification, fps: float) -> Settings:
    P, P_right = rectification.left.P, rectification.right.P
    bf = -float(P_right[0, 3])
    if bf <= 0 or abs(float(P_right[1, 3])) > 1e-3 * abs(bf):
        raise SettingsError(
            f"{path}: the second camera must stand to the right of the first; as it is, the "
            f"projection matrix is shifted by {-P_right[0, 3]:g}, {-P_right[1, 3]:g} pixel metres"
        )
    camera = CameraSettings(
        fx=float(P[0, 0]),
        fy=float(P[1, 1]),
        cx=float(P[0, 2]),
        cy=float(P[1, 2]),
        width=rectification.left.width,
        height=rectification.left.height,
        fps=fps,
        bf=bf,
    )
    return Settings(
        sensor=Sensor.STEREO,
        camera=camera,
        orb=OrbSettings(n_features=usual_n_features(camera.width, camera.height)),
        depth=builtin_settings("euroc", Sensor.STEREO).depth,
        rectification=rectification,
    )
