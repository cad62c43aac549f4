# SPDX-License-Identifier: BSD-3-Clause
"""Where the samples of an IMU come into the pipeline."""

from __future__ import annotations

import logging

from orbslam2py.inertial.samples import imu_rows
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial.imu_buffer import ImuBuffer, ImuInterval
from orbslam2py.slam.inertial.imu_check import ImuCheck, Run
from orbslam2py.slam.records import TrackingRecord

_log = logging.getLogger(__name__)


class InertialInput:
    """The samples of an IMU, by image.

    Parameters
    ----------
    settings
        The IMU beside the camera that is tracked (rectified, if pairs are rectified); None: samples
        are not used, and a warning says so when the first ones come.
    run
        Runs a test of the IMU, at once or in another thread.

    Attributes
    ----------
    settings
        As given.
    buffer
        The samples that wait for their images.
    check
        Whether the IMU fits the camera; None without settings. Ask `ImuCheck.verdict`.
    interval
        Samples between the last two images; None before the second one.
    """

    def __init__(self, settings: ImuSettings | None, run: Run) -> None:
        self.settings = settings
        self.check = None if settings is None else ImuCheck(settings, run)
        self.buffer = ImuBuffer(0.0 if settings is None else settings.time_offset)
        self.interval: ImuInterval | None = None
        self._told = False

    def add(self, samples: object) -> None:
        """Add samples; see `ImuBuffer.add`."""
        if self.settings is not None:
            self.buffer.add(samples)
        elif len(imu_rows(samples)) and not self._told:
            self._told = True
            _log.warning(
                "the samples of the IMU are not used, because nothing is known of the IMU; make "
                "the system with System(..., imu=read_imu_settings('imu.yaml'))"
            )

    @property
    def n_samples(self) -> int:
        """Samples that came so far, also those that were left out."""
        return self.buffer.n_samples

    def take(self, timestamp: float) -> ImuInterval | None:
        """Take the samples from the image before to this one; None without IMU settings."""
        return None if self.settings is None else self.buffer.take(timestamp)

    def look(self, interval: ImuInterval | None, record: TrackingRecord, n_changes: int) -> None:
        """See what tracking made of an image, and of the samples since the image before.

        Parameters
        ----------
        interval
            As `take` gave it.
        record
            The image's pose.
        n_changes
            Number of motions of the whole map.
        """
        self.interval = interval
        if self.check is not None:
            self.check.add(interval, record, n_changes)

    def restart(self) -> None:
        """Restart: the next image has no image before it."""
        self.buffer.restart()
        if self.check is not None:
            self.check.restart()
