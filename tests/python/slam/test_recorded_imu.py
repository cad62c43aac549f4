# SPDX-License-Identifier: BSD-3-Clause
"""The check of an IMU on recordings of a drone: no false alarm, and faults are told in time."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import System
from orbslam2py.datasets import EurocSequence
from orbslam2py.slam.inertial import ImuVerdict
from support.imu_check import FAULTS, Made, played

pytestmark = [pytest.mark.shared, pytest.mark.watchdog(170)]

#: Motion does not show it in this recording, or the messages depend on the mounting.
_NOT_HERE = {"other clock", "stabilised"}


def tracked(folder: Path, n: int) -> Made:
    """Poses of one camera as tracking gives them, without the IMU."""
    sequence = EurocSequence(folder, "mono", settings="euroc")
    with System(
        sequence.settings, "mono", deterministic=True, loop_closing=False, check_calibration=False
    ) as slam:
        records = slam.run(islice(sequence, n))
    samples, settings = sequence.imu(), sequence.imu_settings()
    assert samples is not None and settings is not None
    T_wc = [np.full((4, 4), np.nan) if one.T_wc is None else one.T_wc for one in records]
    return Made(
        np.array([one.timestamp for one in records]), np.stack(T_wc), samples.data.copy(), settings
    )


@pytest.fixture(scope="module")
def flight(shared_data: Path) -> Made:
    """Four and a half seconds of flight."""
    return tracked(shared_data / "sequences" / "euroc_MH_01_first170", 90)


def test_right_samples_fit(flight: Made) -> None:
    check, verdicts = played(flight)
    assert ImuVerdict.HELD_BACK not in verdicts
    assert check.verdict is ImuVerdict.FITS
    assert check.report is not None and check.report.rates is not None
    assert check.report.rates.bias[2] == pytest.approx(0.079, abs=0.01)


@pytest.mark.parametrize("name", sorted(set(FAULTS) - _NOT_HERE))
def test_faults_are_told(flight: Made, name: str) -> None:
    change, kind, _ = FAULTS[name]
    given = replace(flight, samples=flight.samples.copy())
    change(given)
    check, verdicts = played(given)
    assert ImuVerdict.FITS not in verdicts
    assert check.verdict is ImuVerdict.HELD_BACK
    assert kind in [fault.kind for fault in check.faults]


@pytest.mark.parametrize("name", ["euroc_V1_01_flight90", "euroc_V1_01_rest40"])
def test_other_recordings_raise_no_alarm(shared_data: Path, name: str) -> None:
    _, verdicts = played(tracked(shared_data / "sequences" / name, 60))
    assert ImuVerdict.HELD_BACK not in verdicts
