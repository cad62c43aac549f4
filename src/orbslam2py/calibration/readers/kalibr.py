# SPDX-License-Identifier: BSD-3-Clause
"""Kalibr's camchain."""

from __future__ import annotations

import re

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_numbers,
    checked_pose,
    checked_size,
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
    return ForeignCamera(
        camera.name, camera.number, camera.K, camera.distortion, camera.size, camera.lens, T
    )


def _camera(source: CalibrationSource, number: int) -> tuple[ForeignCamera, FloatArray | None]:
    path, name = source.path, f"cam{number}"
    values, where = source.mapping(source.values[name], name), f"{name}."
    lens = lens_of(f"{path}", f"{where}camera_model", source.value("camera_model", values, where))
    if lens == PINHOLE:
        model = values.get("distortion_model", "none")
        lens = lens_of(f"{path}", f"{where}distortion_model", model)
    resolution = source.value("resolution", values, where)
    size = checked_size(path, resolution, f"{where}resolution")
    K, D = None, NO_DISTORTION
    if lens == PINHOLE:
        given = source.value("intrinsics", values, where)
        K = pinhole_matrix(path, f"{where}intrinsics", given)
        coefficients = values.get("distortion_coeffs", [])
        if values.get("distortion_model", "none") != "none":
            given = source.value("distortion_coeffs", values, where)
            coefficients = checked_numbers(path, f"{where}distortion_coeffs", given, (4,))
        D = opencv_coefficients(f"{path}: {name}", coefficients, K, size)
    T = values.get("T_cn_cnm1")
    pose = None if T is None else checked_pose(path, f"{where}T_cn_cnm1", T)
    return ForeignCamera(name, number, K, D, size, lens), pose
