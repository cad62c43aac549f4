# SPDX-License-Identifier: BSD-3-Clause
"""Kalibr's camchain."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_numbers,
    checked_pose,
    checked_size,
    kannala_brandt_numbers,
    opencv_coefficients,
    pinhole_matrix,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    both_ways,
)
from orbslam2py.calibration.lenses import PINHOLE, lens_of
from orbslam2py.errors import SettingsError

#: Number of lens parameters that Kalibr writes before fx, fy, cx, cy: xi, alpha; alpha, beta; xi.
_LEADING = {"double_sphere": 2, "eucm": 2, "mei": 1}


def read_kalibr(source: CalibrationSource) -> CameraFile:
    """Read all cameras; ``T_cn_cnm1`` gives the pose of each from the one before."""
    numbers = sorted(
        int(match[1]) for key in source.values if (match := re.fullmatch(r"cam(\d+)", str(key)))
    )
    if not numbers:
        raise SettingsError(
            f"{source.path} has no cam0; is it a camchain of Kalibr? Name another --format"
        )
    cameras: list[ForeignCamera] = []
    T: FloatArray | None = np.eye(4)
    for number in numbers:
        camera, T_cn_cnm1 = _camera(source, number)
        if cameras:
            T = None if T is None or T_cn_cnm1 is None else T_cn_cnm1 @ T
        cameras.append(_placed(camera, T))
    return CameraFile(tuple(cameras), prefix="cam", pairs=both_ways(numbers), place_key="T_cn_cnm1")


def _placed(camera: ForeignCamera, T: FloatArray | None) -> ForeignCamera:
    return replace(camera, T_camera_rig=T)


def _camera(source: CalibrationSource, number: int) -> tuple[ForeignCamera, FloatArray | None]:
    path, name = source.path, f"cam{number}"
    values, where = source.mapping(source.values[name], name), f"{name}."
    lens = lens_of(f"{path}", f"{where}camera_model", source.value("camera_model", values, where))
    resolution = source.value("resolution", values, where)
    size = checked_size(path, resolution, f"{where}resolution")
    if lens in _LEADING:
        camera = _omnidirectional(source, values, where, size, lens)
    else:
        model = values.get("distortion_model", "none")
        if lens == PINHOLE:
            lens = lens_of(f"{path}", f"{where}distortion_model", model)
        camera = _pinhole(source, values, where, size, lens)
    T = values.get("T_cn_cnm1")
    pose = None if T is None else checked_pose(path, f"{where}T_cn_cnm1", T)
    return replace(camera, name=name, number=number), pose


def _pinhole(
    source: CalibrationSource,
    values: Mapping[str, Any],
    where: str,
    size: tuple[int, int],
    lens: str,
) -> ForeignCamera:
    """Make the camera of a pinhole with radtan, equidistant or fov distortion."""
    path, name = source.path, where.rstrip(".")
    if lens not in (PINHOLE, "kannala_brandt", "fov"):
        return ForeignCamera(name, 0, None, NO_DISTORTION, size, lens)
    K = pinhole_matrix(path, f"{where}intrinsics", source.value("intrinsics", values, where))
    key = f"{where}distortion_coeffs"
    if lens == PINHOLE and values.get("distortion_model", "none") == "none":
        D = opencv_coefficients(f"{path}: {name}", values.get("distortion_coeffs", []), K, size)
        return ForeignCamera(name, 0, K, D, size, lens)
    given = source.value("distortion_coeffs", values, where)
    if lens == PINHOLE:
        coefficients = checked_numbers(path, key, given, (4,))
        D = opencv_coefficients(f"{path}: {name}", coefficients, K, size)
        return ForeignCamera(name, 0, K, D, size, lens)
    if lens == "kannala_brandt":
        numbers = kannala_brandt_numbers(path, key, given)
    else:
        numbers = tuple(checked_numbers(path, key, given, (1,)).tolist())
    return ForeignCamera(name, 0, K, NO_DISTORTION, size, lens, lens_numbers=numbers)


def _omnidirectional(
    source: CalibrationSource,
    values: Mapping[str, Any],
    where: str,
    size: tuple[int, int],
    lens: str,
) -> ForeignCamera:
    """Make the camera of a model that has parameters before the focal lengths."""
    path, count = source.path, _LEADING[lens]
    given = source.value("intrinsics", values, where)
    numbers = checked_numbers(path, f"{where}intrinsics", given, (count + 4,)).tolist()
    K = pinhole_matrix(path, f"{where}intrinsics", numbers[count:])
    distortion = str(values.get("distortion_model", "none"))
    own = tuple(numbers[:count])
    if lens == "mei":
        if lens_of(f"{path}", f"{where}distortion_model", distortion) != PINHOLE:
            _refuse_distortion(source, where, lens, distortion, "radtan or none")
        coefficients = [0.0] * 4
        if distortion != "none":
            key = "distortion_coeffs"
            coefficients = checked_numbers(
                path, f"{where}{key}", source.value(key, values, where), (4,)
            ).tolist()
        own += tuple(coefficients)
    elif distortion != "none":
        _refuse_distortion(source, where, lens, distortion, "none")
    return ForeignCamera(where.rstrip("."), 0, K, NO_DISTORTION, size, lens, lens_numbers=own)


def _refuse_distortion(
    source: CalibrationSource, where: str, lens: str, distortion: str, allowed: str
) -> None:
    raise SettingsError(
        f"{source.path}: {where}distortion_model {distortion} does not go with the {lens} lens; "
        f"calibrate the camera with {allowed}"
    )
