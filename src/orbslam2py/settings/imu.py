# SPDX-License-Identifier: BSD-3-Clause
"""What must be known of an IMU: its noise, its place beside the camera, its clock."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from os import PathLike

import numpy as np

from orbslam2py._arguments import is_number, shown
from orbslam2py._arrays import EqualByValue, FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import SettingsError

#: Largest departure of R R^T from the identity of a matrix written with four digits or more.
_ROTATION_TOLERANCE = 1e-3
#: Metres between camera and IMU, beyond which the numbers are probably millimetres.
_FAR = 5.0


@dataclass(frozen=True)
class _Plausible:
    """A noise figure: its unit, the usual range, and the remedy below and above it."""

    unit: str
    low: float
    high: float
    below: str
    above: str


#: By the data sheets in `imu_presets`; files of other programs have figures up to 10 times larger.
_PLAUSIBLE = {
    "gyro_noise": _Plausible(
        "rad/s/sqrt(Hz)",
        1e-6,
        1e-2,
        "is it the variance? Give its square root",
        "if it is in degrees, multiply it by 0.01745",
    ),
    "accel_noise": _Plausible(
        "m/s^2/sqrt(Hz)",
        2e-4,
        0.5,
        "if it is in g, multiply it by 9.81",
        "if it is in micro-g, multiply it by 9.81e-6",
    ),
    "gyro_walk": _Plausible(
        "rad/s^2/sqrt(Hz)",
        1e-9,
        1e-2,
        "is it the variance? Give its square root",
        "if it is in degrees, multiply it by 0.01745",
    ),
    "accel_walk": _Plausible(
        "m/s^3/sqrt(Hz)",
        1e-7,
        0.5,
        "if it is in g, multiply it by 9.81",
        "if it is in micro-g, multiply it by 9.81e-6",
    ),
}


@dataclass(frozen=True, eq=False)
class ImuSettings(EqualByValue):
    """An IMU beside a camera.

    Attributes
    ----------
    gyro_noise
        Noise density of the gyro, rad/s/sqrt(Hz).
    accel_noise
        Noise density of the accelerometer, m/s^2/sqrt(Hz).
    gyro_walk
        Random walk of the bias of the gyro, rad/s^2/sqrt(Hz).
    accel_walk
        Random walk of the bias of the accelerometer, m/s^3/sqrt(Hz).
    T_ci
        From the coordinates of the IMU to those of the (left, unrectified) camera, float64 (4, 4),
        metres. ORB-SLAM3's ``IMU.T_b_c1`` is its inverse, Kalibr's ``T_cam_imu`` is the same.
    time_offset
        Seconds to add to the time of an image for the time on the clock of the IMU, as Kalibr's
        ``timeshift_cam_imu``.
    rate
        Samples per second, Hz; None if it is not known.

    Raises
    ------
    SettingsError
        Naming all values that are wrong, and the remedy.
    """

    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float
    T_ci: FloatArray = field(default_factory=lambda: np.eye(4))
    time_offset: float = 0.0
    rate: float | None = None

    def __post_init__(self) -> None:
        problems = []
        for name, plausible in _PLAUSIBLE.items():
            value = getattr(self, name)
            if not is_number(value) or not (0 < value < math.inf):
                problems.append(f"{name} is {shown(value)}; give {plausible.unit}, above 0")
            else:
                object.__setattr__(self, name, float(value))
        if not is_number(self.time_offset) or not math.isfinite(self.time_offset):
            problems.append(f"time_offset is {shown(self.time_offset)}; give seconds")
        if self.rate is not None and not (is_number(self.rate) and 1 <= self.rate <= 1e5):
            problems.append(f"rate is {shown(self.rate)}; give 1 to 100000 Hz")
        try:
            T = rigid_transform(self.T_ci)
            T.setflags(write=False)
            object.__setattr__(self, "T_ci", T)
        except ValueError as error:
            problems.append(f"T_ci {error}")
        if problems:
            raise SettingsError("; ".join(problems))

    def doubts(self) -> list[str]:
        """Return values that are allowed but probably wrong, such as noise in degrees."""
        found = []
        for name, plausible in _PLAUSIBLE.items():
            value = getattr(self, name)
            if not plausible.low <= value <= plausible.high:
                remedy = plausible.below if value < plausible.low else plausible.above
                found.append(
                    f"{name} is {value:g} {plausible.unit}, but IMUs have {plausible.low:g} to "
                    f"{plausible.high:g}; {remedy}"
                )
        distance = float(np.linalg.norm(self.T_ci[:3, 3]))
        if distance > _FAR:
            found.append(
                f"T_ci has the IMU {distance:.3g} m beside the camera; if these are millimetres, "
                "divide them by 1000"
            )
        if abs(self.time_offset) > 0.5:
            found.append(
                f"time_offset is {self.time_offset:g} s; if these are milliseconds, divide by 1000"
            )
        return found

    def seen_by(self, R: FloatArray) -> ImuSettings:
        """Return the settings for a camera that is turned, such as a rectified one.

        Parameters
        ----------
        R
            Rotation (3, 3) from the old to the new coordinates of the camera.
        """
        turn = np.eye(4)
        turn[:3, :3] = R
        return replace(self, T_ci=turn @ self.T_ci)

    def save(self, path: str | PathLike[str]) -> None:
        """Write a file with the keys of ORB-SLAM3; `read_imu_settings` reads equal settings.

        Parameters
        ----------
        path
            The file; replaced only after everything is written.

        Raises
        ------
        OSError
            If the file cannot be written; an existing file is kept then.
        """
        T_ic = np.linalg.inv(self.T_ci)
        matrix = ", ".join(repr(float(value) + 0.0) for value in T_ic.ravel())
        lines = [
            "%YAML:1.0",
            f"IMU.NoiseGyro: {self.gyro_noise!r}",
            f"IMU.NoiseAcc: {self.accel_noise!r}",
            f"IMU.GyroWalk: {self.gyro_walk!r}",
            f"IMU.AccWalk: {self.accel_walk!r}",
            *([] if self.rate is None else [f"IMU.Frequency: {float(self.rate)!r}"]),
            *([f"IMU.TimeOffset: {float(self.time_offset)!r}"] if self.time_offset else []),
            "IMU.T_b_c1: !!opencv-matrix",
            *("   rows: 4", "   cols: 4", "   dt: d", f"   data: [{matrix}]"),
        ]
        with atomic_write(path) as stream:
            stream.write("\n".join(lines) + "\n")


def rigid_transform(value: object) -> FloatArray:
    """Make a rigid transform (4, 4) of a matrix as files have it; its rotation is made exact.

    Raises
    ------
    ValueError
        With the end of a sentence that begins with the name of the matrix.
    """
    try:
        T = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        T = np.zeros(0)
    if T.shape == (3, 4):
        T = np.vstack([T, [0.0, 0.0, 0.0, 1.0]])
    if T.shape != (4, 4) or not np.isfinite(T).all():
        raise ValueError("is no 4 x 4 matrix of finite numbers; give rotation and translation")
    R = T[:3, :3]
    if np.abs(T[3] - [0, 0, 0, 1]).max() > 1e-9:
        raise ValueError(
            "does not end with the row 0 0 0 1; write it row by row, not column by column"
        )
    if np.abs(R @ R.T - np.eye(3)).max() > _ROTATION_TOLERANCE:
        raise ValueError(
            "is no rigid transform: the rotation R has R R^T apart from the identity by "
            f"{np.abs(R @ R.T - np.eye(3)).max():.2g}; write it with more digits, or calibrate "
            "again"
        )
    if np.linalg.det(R) < 0:
        raise ValueError(
            "is a reflection, not a rotation: one axis has the wrong sign; correct this axis"
        )
    U, _, Vt = np.linalg.svd(R)
    T[:3, :3] = U @ Vt
    T[3] = (0.0, 0.0, 0.0, 1.0)
    return np.asarray(T)
