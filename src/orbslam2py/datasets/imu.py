# SPDX-License-Identifier: BSD-3-Clause
"""Sequences that have samples of an IMU."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol, runtime_checkable

from orbslam2py.inertial.samples import ImuSamples, joined_streams, make_samples
from orbslam2py.settings import ImuSettings

__all__ = [
    "ImuSamples",
    "WithImu",
    "imu_of",
    "imu_settings_of",
    "joined_streams",
    "make_samples",
]


@runtime_checkable
class WithImu(Protocol):
    """A sequence that may have samples of an IMU."""

    def imu(self) -> ImuSamples | None:
        """Read the samples of the IMU; None if there are none."""
        ...


def imu_of(sequence: object) -> ImuSamples | None:
    """Read the samples of the IMU of a sequence.

    Parameters
    ----------
    sequence
        A sequence of this package, or any other object: those without ``imu()`` have no samples.

    Returns
    -------
    ImuSamples or None
        None if there are no samples.

    Raises
    ------
    DatasetError
        If there are samples that cannot be read.
    """
    return sequence.imu() if isinstance(sequence, WithImu) else None


def imu_settings_of(sequence: object) -> ImuSettings | None:
    """Read the IMU data that come with a sequence; None if nothing does.

    Raises
    ------
    SettingsError
        If there are settings that are wrong.
    """
    read = getattr(sequence, "imu_settings", None)
    found = read() if callable(read) else read  # a camera has them already
    return found if isinstance(found, ImuSettings) else None


def first_file(paths: Iterable[Path]) -> Path | None:
    """Return the first of these files that exists."""
    return next((path for path in paths if path.is_file()), None)
