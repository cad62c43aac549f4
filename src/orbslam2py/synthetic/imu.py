# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU on a synthetic camera: exact ones, or with the noise of a chip."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import ImuSamples
from orbslam2py.settings import ImuSettings, imu_noise
from orbslam2py.synthetic.spline import PoseSpline
from orbslam2py.trajectory.rotations import inverse_poses

if TYPE_CHECKING:
    from orbslam2py.synthetic.options import SyntheticOptions

#: Samples per second.
RATE = 200.0
#: The IMU beside the camera: x forward, y left, z up, as on most robots; metres.
T_CI: FloatArray = np.array(
    [
        [0.0, -1.0, 0.0, 0.05],
        [0.0, 0.0, -1.0, -0.02],
        [1.0, 0.0, 0.0, -0.03],
        [0.0, 0.0, 0.0, 1.0],
    ]
)
#: Acceleration of free fall in the world, whose y points down, m/s^2.
_GRAVITY = np.array([0.0, 9.81, 0.0])
#: Deviation of the bias at the start: gyro [rad/s], accelerometer [m/s^2].
_FIRST_BIAS = (0.01, 0.1)
#: Noise that settings tell where the samples have none.
_EXACT = "adis16448"
#: Distinguishes the random numbers of the IMU from others of the same seed.
_STREAM = 0x1A55

TABLE, SETTINGS = "imu.csv", "imu.yaml"


class SyntheticImu:
    """The part of a synthetic sequence that makes the samples of its IMU."""

    if TYPE_CHECKING:
        options: SyntheticOptions

        @property
        def timestamps(self) -> FloatArray: ...  # noqa: D102
        @property
        def name(self) -> str: ...  # noqa: D102
        def T_wc(self, index: int) -> FloatArray: ...  # noqa: D102
        def __len__(self) -> int: ...

    @cached_property
    def _imu_path(self) -> PoseSpline:
        """The path of the IMU, through the poses of all images."""
        T_wc = np.stack([self.T_wc(index) for index in range(len(self))])
        return PoseSpline(self.timestamps, T_wc @ T_CI)

    def imu(self) -> ImuSamples | None:
        """Make the samples of the IMU from the first to the last image.

        Returns
        -------
        ImuSamples or None
            200 per second; None without `SyntheticOptions.imu`.
        """
        if not self.options.imu:
            return None
        seconds = self.timestamps
        t = seconds[0] + np.arange(int(np.floor((seconds[-1] - seconds[0]) * RATE)) + 1) / RATE
        path = self._imu_path
        R = path.poses(t)[:, :3, :3]
        force = np.einsum("nji,nj->ni", R, path.accelerations(t) - _GRAVITY)
        readings = np.hstack([path.rates(t), force])
        if self.options.imu_noise is not None:
            readings += self._errors(len(t))
        data = np.column_stack([t, readings])
        data.setflags(write=False)
        return ImuSamples(self.name, data)

    def imu_settings(self) -> ImuSettings | None:
        """Return the settings of the IMU; None without `SyntheticOptions.imu`."""
        if not self.options.imu:
            return None
        noise = imu_noise(self.options.imu_noise or _EXACT)
        return ImuSettings(
            noise.gyro_noise,
            noise.accel_noise,
            noise.gyro_walk,
            noise.accel_walk,
            T_ci=T_CI,
            rate=RATE,
        )

    def T_wc_between(self, seconds: float) -> FloatArray:
        """Pose of the camera (4, 4) at any time inside the path that the IMU measures."""
        T_wi = self._imu_path.poses(np.array([seconds]))[0]
        return np.asarray(T_wi @ inverse_poses(T_CI))

    def _errors(self, n: int) -> FloatArray:
        """White noise and a bias that walks, (n, 6)."""
        noise = imu_noise(self.options.imu_noise or _EXACT)
        random = np.random.default_rng([self.options.seed, _STREAM])
        white = np.repeat([noise.gyro_noise, noise.accel_noise], 3) * np.sqrt(RATE)
        walk = np.repeat([noise.gyro_walk, noise.accel_walk], 3) / np.sqrt(RATE)
        bias = np.repeat(_FIRST_BIAS, 3) * random.standard_normal(6)
        walked = np.cumsum(walk * random.standard_normal((n, 6)), axis=0)
        return np.asarray(bias + walked + white * random.standard_normal((n, 6)))


# ---- files ---------------------------------------------------------------------------------------


def write_euroc_imu(top: Path, samples: ImuSamples, settings: ImuSettings) -> None:
    """Write ``imu0`` beside ``cam0``, which is the body."""
    folder = top / "imu0"
    folder.mkdir()
    (folder / "sensor.yaml").write_text(
        "\n".join(
            [
                "%YAML:1.0",
                "sensor_type: imu",
                "comment: synthetic",
                "T_BS:",
                "  cols: 4",
                "  rows: 4",
                f"  data: [{_numbers(settings.T_ci.ravel(), ', ')}]",
                f"rate_hz: {settings.rate:g}",
                f"gyroscope_noise_density: {settings.gyro_noise!r}",
                f"gyroscope_random_walk: {settings.gyro_walk!r}",
                f"accelerometer_noise_density: {settings.accel_noise!r}",
                f"accelerometer_random_walk: {settings.accel_walk!r}",
            ]
        )
        + "\n",
        encoding="utf-8",
    )
    names = [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"]
    names += [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"]
    _write_table(folder / "data.csv", "#timestamp [ns]," + ",".join(names), samples, 10**9)


def write_imu(folder: Path, samples: ImuSamples, settings: ImuSettings) -> None:
    """Write ``imu.csv``, and ``imu.yaml`` with the keys of ORB-SLAM3."""
    names = [f"{kind}_{axis} [{unit}]" for kind, unit in _COLUMNS for axis in "xyz"]
    _write_table(folder / TABLE, "timestamp [s]," + ",".join(names), samples, 1)
    settings.save(folder / SETTINGS)


_COLUMNS = (("gyro", "rad/s"), ("accel", "m/s^2"))


def _write_table(path: Path, header: str, samples: ImuSamples, per_second: int) -> None:
    lines = [header]
    for row in samples.data:
        stamp = f"{row[0]:.9f}" if per_second == 1 else str(round(row[0] * per_second))
        lines.append(f"{stamp},{_numbers(row[1:], ',')}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _numbers(values: FloatArray, separator: str) -> str:
    return separator.join(repr(float(value) + 0.0) for value in values)
