# SPDX-License-Identifier: BSD-3-Clause
"""Noise of IMUs by the name of the chip, for IMUs that were not measured.

Noise densities are the typical values of the makers' data sheets, whose numbers stand beside them.
They were not compared with the current revisions: check yours. Makers do not state random walks of
the bias. The values here are guesses for the class of the chip. A calibration of your IMU is better
than a preset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from orbslam2py.errors import SettingsError

_DEGREE = math.pi / 180
_MICRO_G = 9.80665e-6

#: Walks of the bias of consumer chips and of industrial modules: gyro [rad/s^2/sqrt(Hz)],
#: accelerometer [m/s^3/sqrt(Hz)].
_CONSUMER = (2e-5, 1e-3)
_INDUSTRIAL = (5e-6, 3e-4)


@dataclass(frozen=True)
class ImuNoise:
    """Noise of an IMU.

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
    source
        Where the densities are from.
    """

    gyro_noise: float
    accel_noise: float
    gyro_walk: float
    accel_walk: float
    source: str


def _chip(gyro: float, accel: float, walks: tuple[float, float], source: str) -> ImuNoise:
    """Convert the units of data sheets: degrees/s/sqrt(Hz) and micro-g/sqrt(Hz)."""
    return ImuNoise(
        gyro * _DEGREE,
        accel * _MICRO_G,
        *walks,
        f"typical value of the data sheet, revision not checked: {source}",
    )


#: By the name of the chip in lower case.
IMU_NOISE = {
    "mpu6050": _chip(0.005, 400, _CONSUMER, "InvenSense MPU-6000/6050 (PS-MPU-6000A-00)"),
    "mpu9250": _chip(0.01, 300, _CONSUMER, "InvenSense MPU-9250 (PS-MPU-9250A-01)"),
    "icm20602": _chip(0.004, 100, _CONSUMER, "TDK InvenSense ICM-20602 (DS-000176)"),
    "icm20948": _chip(0.015, 230, _CONSUMER, "TDK InvenSense ICM-20948 (DS-000189)"),
    "icm42688": _chip(0.0028, 70, _CONSUMER, "TDK InvenSense ICM-42688-P (DS-000347)"),
    "bmi055": _chip(0.014, 150, _CONSUMER, "Bosch BMI055 (BST-BMI055-DS000)"),
    "bmi085": _chip(0.014, 135, _CONSUMER, "Bosch BMI085 (BST-BMI085-DS001)"),
    "bmi088": _chip(0.014, 175, _CONSUMER, "Bosch BMI088 (BST-BMI088-DS001)"),
    "bmi160": _chip(0.007, 180, _CONSUMER, "Bosch BMI160 (BST-BMI160-DS000)"),
    "bmi270": _chip(0.007, 160, _CONSUMER, "Bosch BMI270 (BST-BMI270-DS000)"),
    "lsm6ds3": _chip(0.007, 90, _CONSUMER, "ST LSM6DS3 (DocID026899)"),
    "lsm6dsl": _chip(0.004, 90, _CONSUMER, "ST LSM6DSL (DocID028475)"),
    "lsm6dso": _chip(0.0038, 70, _CONSUMER, "ST LSM6DSO (DS12140)"),
    "adis16448": _chip(0.0135, 230, _INDUSTRIAL, "Analog Devices ADIS16448"),
    "adis16470": _chip(0.008, 100, _INDUSTRIAL, "Analog Devices ADIS16470"),
}


def imu_noise(chip: str) -> ImuNoise:
    """Return the noise of a chip.

    Parameters
    ----------
    chip
        Its name, such as ``bmi088``; case, blanks and hyphens do not matter.

    Raises
    ------
    SettingsError
        If it is not known, with all names there are.
    """
    plain = str(chip).lower().replace("-", "").replace("_", "").replace(" ", "")
    if plain not in IMU_NOISE:
        raise SettingsError(
            f"no noise is known of the IMU '{chip}'; there are {', '.join(sorted(IMU_NOISE))}: "
            "take the most similar one, or give the figures in a file"
        )
    return IMU_NOISE[plain]
