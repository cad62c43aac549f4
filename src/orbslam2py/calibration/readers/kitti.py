# SPDX-License-Identifier: BSD-3-Clause
"""KITTI's calibration: ``calib.txt`` of the odometry benchmark, ``calib_cam_to_cam.txt``."""

from __future__ import annotations

import re

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import checked_camera_matrix, checked_numbers, checked_size
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
)
from orbslam2py.errors import SettingsError

_PROJECTION = re.compile(r"^P(?:_rect_0)?(\d):(.*)$", re.MULTILINE)
_SIZE = re.compile(r"^S_rect_0(\d):(.*)$", re.MULTILINE)
_RATE = 10.0
_FEATURES = 2000


def read_kitti(source: CalibrationSource) -> CameraFile:
    """Read the rectified cameras; each and the next are a pair."""
    path = source.path
    projections = {
        int(match[1]): checked_numbers(path, f"P{match[1]}", match[2].split(), (12,)).reshape(3, 4)
        for match in _PROJECTION.finditer(source.text)
    }
    if not projections:
        raise SettingsError(
            f"{path} has no projection matrix P0; is it a calib.txt of KITTI? Name another --format"
        )
    sizes = {
        int(match[1]): checked_size(path, match[2].split(), f"S_rect_0{match[1]}")
        for match in _SIZE.finditer(source.text)
    }
    numbers = sorted(projections)
    cameras = tuple(_camera(source, n, projections[n], sizes.get(n)) for n in numbers)
    pairs = tuple((n, n + 1) for n in numbers if n + 1 in projections)
    return CameraFile(
        cameras,
        prefix="P",
        pairs=pairs,
        rectified=True,
        fps=_RATE,
        n_features=_FEATURES,
        rgb=True,
    )


def _camera(
    source: CalibrationSource, number: int, P: FloatArray, size: tuple[int, int] | None
) -> ForeignCamera:
    name = f"P{number}"
    K = checked_camera_matrix(source.path, P[:, :3], name)
    return ForeignCamera(name, number, K, NO_DISTORTION, size, P=P)
