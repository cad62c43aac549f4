# SPDX-License-Identifier: BSD-3-Clause
"""EuRoC's ``sensor.yaml`` of a camera, and settings from one or two of these files."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.settings import (
    CameraSettings,
    OrbSettings,
    Sensor,
    Settings,
    builtin_settings,
)
from orbslam2py.settings.groups import DISTORTION_FIELDS
from orbslam2py.settings.keys import focal_problems
from orbslam2py.settings.opencv_yaml import Entry, parse_number, read_matrix, scan
from orbslam2py.settings.pair_cameras import cameras_of_pair
from orbslam2py.trajectory.rotations import inverse_poses, nearest_rotations, poses_from


@dataclass(frozen=True, eq=False)
class SensorCalibration:
    """The contents of ``sensor.yaml`` of a camera.

    Attributes
    ----------
    path
        The file.
    T_body_camera
        Camera to body, float64 (4, 4), metres; None if the file has no ``T_BS``.
    intrinsics
        fx, fy, cx, cy in pixels, (4,).
    distortion
        k1, k2, p1, p2, (4,); for a fisheye k1, k2, k3, k4.
    size
        Width and height in pixels.
    rate
        Images per second.
    is_fisheye
        Whether the lens is equidistant (Kannala-Brandt), as in TUM-VI.
    """

    path: Path
    T_body_camera: FloatArray | None
    intrinsics: FloatArray
    distortion: FloatArray
    size: tuple[int, int]
    rate: float
    is_fisheye: bool = False

    @property
    def T_BS(self) -> FloatArray:
        """Camera to body, float64 (4, 4), metres.

        Raises
        ------
        DatasetError
            If the file does not contain it.
        """
        if self.T_body_camera is None:
            raise DatasetError(
                f"{self.path} has no T_BS, the camera's place on the vehicle; stereo and ground "
                "truth need it: add it, or use the camera alone with --sensor mono"
            )
        return self.T_body_camera

    @property
    def camera_matrix(self) -> FloatArray:
        """Camera matrix (3, 3), pixels."""
        fx, fy, cx, cy = self.intrinsics
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])


def read_sensor_yaml(path: Path) -> SensorCalibration:
    """Read the calibration of a pinhole camera, or of an equidistant fisheye.

    Parameters
    ----------
    path
        EuRoC's ``sensor.yaml`` of a camera.

    Returns
    -------
    SensorCalibration
        Without a rate in the file, 20 images per second are assumed. Without ``T_BS``, which a
        single camera does not need, `T_body_camera` is None.

    Raises
    ------
    DatasetError
        The message names the file, the line and the key.
    """
    try:
        document = scan(path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    if document.problems:
        raise DatasetError("\n".join(problem.located(path) for problem in document.problems))
    entries = document.entries
    keys = ("intrinsics", "distortion_coefficients", "resolution")
    missing = [key for key in keys if key not in entries]
    if missing:
        raise DatasetError(f"{path} has no {', '.join(missing)}")
    for key, allowed in (
        ("camera_model", ("pinhole",)),
        ("distortion_model", ("radial-tangential", "equidistant")),
    ):
        if key in entries and entries[key].value not in allowed:
            entry, names = entries[key], " or ".join(allowed)
            raise DatasetError(f"{path}:{entry.line}: {key} is {entry.value}; allowed: {names}")
    intrinsics = _numbers(path, entries["intrinsics"], 4)
    for problem in focal_problems("intrinsics", np.diag(intrinsics[:2])):
        raise DatasetError(f"{path}:{entries['intrinsics'].line}: {problem}")
    width, height = _numbers(path, entries["resolution"], 2)
    rate = _numbers(path, entries["rate_hz"], 1)[0] if "rate_hz" in entries else 20.0
    return SensorCalibration(
        path=path,
        T_body_camera=_rigid(path, entries["T_BS"]) if "T_BS" in entries else None,
        intrinsics=intrinsics,
        distortion=_numbers(path, entries["distortion_coefficients"], 4),
        size=(int(width), int(height)),
        rate=float(rate),
        is_fisheye="distortion_model" in entries
        and entries["distortion_model"].value == "equidistant",
    )


def monocular_settings(camera: SensorCalibration) -> Settings:
    """Make settings for the raw images of one camera."""
    fx, fy, cx, cy = camera.intrinsics.tolist()
    lens: dict[str, Any] = dict(zip(DISTORTION_FIELDS, camera.distortion.tolist(), strict=False))
    if camera.is_fisheye:
        lens = {"model": "kannala_brandt", "lens": tuple(camera.distortion.tolist())}
    return Settings(
        sensor=Sensor.MONOCULAR,
        camera=CameraSettings(
            fx=fx,
            fy=fy,
            cx=cx,
            cy=cy,
            **lens,
            width=camera.size[0],
            height=camera.size[1],
            fps=camera.rate,
            rgb=True,
        ),
        orb=OrbSettings(n_features=1000),
    )


def stereo_settings(left: SensorCalibration, right: SensorCalibration) -> Settings:
    """Make settings for the pair: with its rectification, or of fisheye cameras as they are.

    Raises
    ------
    SettingsError
        If the two are no pair.
    """
    T_right_left = inverse_poses(right.T_BS) @ left.T_BS
    cameras = monocular_settings(left).camera, monocular_settings(right).camera
    pair = cameras_of_pair(*cameras, T_right_left, left.size, "T_BS of both cameras")
    published = builtin_settings("euroc", Sensor.STEREO)
    return Settings(sensor=Sensor.STEREO, **pair.fields, orb=published.orb, depth=published.depth)


def _rigid(path: Path, entry: Entry) -> FloatArray:
    try:
        T = read_matrix(entry)
    except ValueError as error:
        raise DatasetError(f"{path}:{entry.line}: {error}") from None
    if T.shape != (4, 4) or np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() > 1e-3:
        raise DatasetError(f"{path}:{entry.line}: {entry.key} is no 4 x 4 rigid transform")
    pose: FloatArray = poses_from(nearest_rotations(T[None, :3, :3]), T[None, :3, 3])[0]
    return pose


def _numbers(path: Path, entry: Entry, count: int) -> FloatArray:
    items = (entry.value,) if isinstance(entry.value, str) else entry.value
    if not isinstance(items, tuple) or len(items) != count:
        raise DatasetError(f"{path}:{entry.line}: {entry.key} must hold {count} numbers")
    try:
        return np.array([parse_number(item) for item in items], dtype=np.float64)
    except ValueError as error:
        raise DatasetError(f"{path}:{entry.line}: {entry.key}: {error}") from None
