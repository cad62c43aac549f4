# SPDX-License-Identifier: BSD-3-Clause
"""The IMU that a command is given: its settings and a table of its samples."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.datasets import AccelUnit, GyroUnit, ImuSamples, read_imu_csv, read_imu_streams
from orbslam2py.errors import SettingsError
from orbslam2py.settings import ImuSettings, imu_noise, read_imu_settings
from orbslam2py.settings.imu_files import imu_of_settings_file


def imu_settings_given(
    settings: str | None, files: list[str] | None, chip: str | None
) -> ImuSettings | None:
    """Read the IMU settings that the user gave; None if there are none.

    Parameters
    ----------
    settings
        Of the camera: a file may describe the IMU, too.
    files
        Of ``--imu-settings``.
    chip
        Name of the chip, for noise that is in no file.

    Raises
    ------
    SettingsError
        If they are wrong or incomplete.
    """
    noise = None if chip is None else imu_noise(chip)
    if files:
        return read_imu_settings(*files, noise=noise)
    return None if settings is None else imu_of_settings_file(Path(settings), noise)


def check_units(
    tables: list[Path] | None, gyro_unit: GyroUnit | None, accel_unit: AccelUnit | None
) -> None:
    """See that units are given for tables only, and at most two of these.

    Raises
    ------
    SettingsError
        If there is none, or one too many.
    """
    if not tables and (gyro_unit or accel_unit):
        raise SettingsError(
            "--gyro-unit and --accel-unit are for the table of --imu-samples; give it, or leave "
            "them out"
        )
    if len(tables or ()) > 2:
        raise SettingsError(
            f"--imu-samples is given {len(tables or ())} times; give one table, or one of the gyro "
            "and one of the accelerometer"
        )


def read_tables(
    tables: list[Path] | None, gyro_unit: GyroUnit | None, accel_unit: AccelUnit | None
) -> ImuSamples | None:
    """Read the tables of ``--imu-samples``; None if none was given."""
    if not tables:
        return None
    read = read_imu_csv if len(tables) == 1 else read_imu_streams
    return read(*tables, gyro_unit=gyro_unit, accel_unit=accel_unit)
