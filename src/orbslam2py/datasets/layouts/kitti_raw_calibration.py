# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of a day of KITTI raw, and its settings."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    StereoRectification,
    builtin_settings,
)

CAMERAS_FILE = "calib_cam_to_cam.txt"
_IMU_FILE, _VELODYNE_FILE = "calib_imu_to_velo.txt", "calib_velo_to_cam.txt"
_FEATURES, _CLOSE_FACTOR = 2000, 40.0
_SHAPES = {"S": (2,), "K": (3, 3), "D": (5,), "R": (3, 3), "T": (3,), "P": (3, 4)}


class DriveCalibration:
    """The contents of the calibration files of a day.

    Parameters
    ----------
    paths
        The files by their names; None for a missing one.
    """

    VEHICLE_FILES = (_IMU_FILE, _VELODYNE_FILE)
    FILES = (CAMERAS_FILE, *VEHICLE_FILES)

    def __init__(self, paths: Mapping[str, Path | None]) -> None:
        self._paths = paths

    def size(self, camera: int, *, raw: bool) -> tuple[int, int]:
        """Width and height of a camera's images, raw or rectified [pixels]."""
        width, height = self._of_camera("S" if raw else "S_rect", camera)
        return int(width), int(height)

    def monocular_settings(self, camera: int, fps: float, *, raw: bool) -> Settings:
        """Make settings of one camera, raw (with its distortion) or rectified."""
        K = self._of_camera("K", camera) if raw else self._of_camera("P_rect", camera)
        k1, k2, p1, p2, k3 = self._of_camera("D", camera).tolist() if raw else [0.0] * 5
        lens = {"k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3}
        return self._settings(Sensor.MONOCULAR, K, self.size(camera, raw=raw), fps, lens)

    def stereo_settings(self, pair: tuple[int, int], fps: float, *, raw: bool) -> Settings:
        """Make settings of a rectified pair, with the rectification if images are raw."""
        P_left, P_right = (self._of_camera("P_rect", camera) for camera in pair)
        bf = float(P_left[0, 3] - P_right[0, 3])
        if bf <= 0:
            raise DatasetError(
                f"{self._path(CAMERAS_FILE)}: P_rect_{pair[1]:02d} does not stand to the right of "
                f"P_rect_{pair[0]:02d}; copy the file of the day again"
            )
        rectification = None
        if raw:
            sides = (self._rectification(camera, pair[0]) for camera in pair)
            rectification = StereoRectification(*sides)
        size = self.size(pair[0], raw=raw)
        return self._settings(Sensor.STEREO, P_left, size, fps, {"bf": bf}, rectification)

    def T_camera_imu(self, camera: int, *, raw: bool) -> FloatArray:
        """Return the transform (4, 4) from the IMU to a camera, raw or rectified [m]."""
        to_velodyne = self._rigid(self._read(_IMU_FILE), _IMU_FILE)
        to_first = self._rigid(self._read(_VELODYNE_FILE), _VELODYNE_FILE)
        T = np.eye(4)
        if raw:
            T[:3, :3], T[:3, 3] = self._of_camera("R", camera), self._of_camera("T", camera)
        else:
            P = self._of_camera("P_rect", camera)  # K [I | t], from the rectified first camera
            T[:3, 3] = np.linalg.solve(P[:, :3], P[:, 3])
            R = np.eye(4)
            R[:3, :3] = self._of_camera("R_rect", 0)
            T = T @ R
        return np.asarray(T @ to_first @ to_velodyne)

    def _rectification(self, camera: int, left: int) -> CameraRectification:
        P = self._of_camera("P_rect", camera).copy()
        P[:, 3] -= self._of_camera("P_rect", left)[:, 3]  # both from the left camera
        try:
            return CameraRectification(
                self._of_camera("K", camera),
                self._of_camera("D", camera),
                self._of_camera("R_rect", camera),
                P,
                *self.size(camera, raw=True),
            )
        except SettingsError as error:
            raise DatasetError(
                f"{self._path(CAMERAS_FILE)}, camera {camera:02d}: {error}"
            ) from error

    def _settings(
        self,
        sensor: Sensor,
        K: FloatArray,
        size: tuple[int, int],
        fps: float,
        more: Mapping[str, float],
        rectification: StereoRectification | None = None,
    ) -> Settings:
        given = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], **more}
        numbers: dict[str, Any] = {name: float(value) for name, value in given.items()}
        try:
            camera = CameraSettings(
                **numbers,
                width=size[0],
                height=size[1],
                fps=fps,
                rgb=True,
            )
            return Settings(
                sensor=sensor,
                camera=camera,
                orb=OrbSettings(n_features=_FEATURES),
                depth=DepthSettings(_CLOSE_FACTOR) if sensor is Sensor.STEREO else None,
                rectification=rectification,
                viewer=builtin_settings("kitti00-02", sensor).viewer,
            )
        except SettingsError as error:
            raise DatasetError(f"{self._path(CAMERAS_FILE)}: {error}") from error

    # ---- files -----------------------------------------------------------------------------------
    def _path(self, name: str) -> Path:
        path = self._paths[name]
        if path is None:
            raise DatasetError(f"{name} is missing; copy it from the calibration of the day")
        return path

    @cached_property
    def _cameras(self) -> dict[str, FloatArray]:
        return self._read(CAMERAS_FILE)

    def _of_camera(self, name: str, camera: int) -> FloatArray:
        key = f"{name}_{camera:02d}"
        return _shaped(self._path(CAMERAS_FILE), self._cameras, key, _SHAPES[name[0]])

    def _rigid(self, values: Mapping[str, FloatArray], name: str) -> FloatArray:
        T = np.eye(4)
        T[:3, :3] = _shaped(self._path(name), values, "R", (3, 3))
        T[:3, 3] = _shaped(self._path(name), values, "T", (3,))
        return T

    def _read(self, name: str) -> dict[str, FloatArray]:
        """Read numbers by their names; other values (``calib_time``) are left out."""
        path = self._path(name)
        found = {}
        for line in content_lines(path):
            key = line.fields[0].rstrip(":")
            if not key.startswith(tuple(_SHAPES)):
                continue
            found[key] = np.array([number_of(path, line, field) for field in line.fields[1:]])
        return found


def _shaped(
    path: Path, values: Mapping[str, FloatArray], key: str, shape: tuple[int, ...]
) -> FloatArray:
    if key not in values:
        raise DatasetError(f"{path} has no line '{key}:'; copy the file of the day again")
    n = int(np.prod(shape))
    if values[key].size != n:
        raise DatasetError(
            f"{path}: {key} has {values[key].size} numbers instead of {n}; copy the file of the "
            "day again"
        )
    return values[key].reshape(shape)
