# SPDX-License-Identifier: BSD-3-Clause
"""The IMU of a run: its settings and its samples, or why there are none."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from typing import Any

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.imu import ImuSamples, imu_of, imu_settings_of
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial import ImuCheck

_log = logging.getLogger(__name__)

_NO_SETTINGS = (
    "nothing is known of the IMU of {name}; give --imu-settings FILE (imu_settings), or add "
    "imu.yaml beside the images"
)
_NO_SAMPLES = (
    "{name} has no samples of an IMU; give a table with --imu-samples FILE (imu_samples), or add "
    "imu.csv beside the images"
)


@dataclass(frozen=True)
class ImuOfRun:
    """An IMU that a run uses.

    Attributes
    ----------
    settings
        For the unrectified (left) camera.
    samples
        All samples of a recording; None for a camera, whose frames bring them.
    """

    settings: ImuSettings
    samples: ImuSamples | None

    def since(self, before: float | None, timestamp: float) -> FloatArray | None:
        """Samples from one frame [s] to the next one; see `ImuSamples.since`."""
        if self.samples is None:
            return None
        offset = self.settings.time_offset
        return self.samples.since(None if before is None else before + offset, timestamp + offset)


def find_imu(
    source: object,
    wanted: bool | None,
    settings: ImuSettings | None,
    samples: ImuSamples | None,
    *,
    is_live: bool,
) -> ImuOfRun | None:
    """Find settings and samples of the IMU beside a camera.

    Parameters
    ----------
    source
        A sequence or a camera.
    wanted
        True: it must be there. None: if there are both, settings and samples. False: none.
    settings, samples
        Given by the user; by default those of the source.
    is_live
        Whether the source is a camera.

    Returns
    -------
    ImuOfRun or None
        None if the run uses no IMU.

    Raises
    ------
    DatasetError, SettingsError
        If a required input is missing, or an input is invalid.
    """
    if wanted is False:
        return None
    name = str(getattr(source, "name", "the source"))
    must = wanted or settings is not None or samples is not None
    try:
        if settings is None:
            settings = imu_settings_of(source)
        if settings is None:
            problem = _NO_SETTINGS.format(name=name)
            if must and not is_live:
                raise SettingsError(problem)
            if must:  # its samples can be recorded all the same
                _log.warning("the IMU is not used: %s", problem)
            return None
        if is_live:
            return ImuOfRun(settings, None)
        if samples is None:
            samples = imu_of(source)
        if samples is None:
            if must:
                raise DatasetError(_NO_SAMPLES.format(name=name))
            return None
    except (DatasetError, SettingsError) as error:
        if must:
            raise
        _log.warning("the IMU is not used: %s", error)
        return None
    return ImuOfRun(settings, samples)


def imu_entry(check: ImuCheck, n_samples: int, *, metric: bool) -> dict[str, Any]:
    """Return the entry of ``report.json``: whether the IMU fits the camera, and its measurements.

    `metric`: the IMU has turned the main map upright and, with one camera, scaled it to metres.

    Time offset in seconds, rotation from IMU to camera (3, 3), bias of the gyro in rad/s, gravity
    in m/s^2; None if the motion did not determine them.
    """
    report = check.report
    rates = None if report is None else report.rates
    gravity = None if report is None else report.gravity
    return {
        "samples": n_samples,
        "verdict": str(check.verdict),
        "metric": metric,
        "faults": [{"kind": fault.kind, "text": fault.text} for fault in check.faults],
        "time_offset": None if rates is None else rates.offset,
        "time_offset_deviation": None if rates is None else rates.offset_deviation,
        "rotation": None if rates is None else rates.R.tolist(),
        "gyro_bias": None if rates is None else rates.bias.tolist(),
        "gravity": None if gravity is None else gravity.magnitude,
    }
