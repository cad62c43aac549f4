# SPDX-License-Identifier: BSD-3-Clause
"""The check of an IMU while images are tracked: each fault within 5 s, no false alarm.

The poses are those of a hand-held camera with the errors of vision, the samples those of three
chips. Recordings are tracked in `test_recorded_imu`.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import cv2
import numpy as np
import pytest

from orbslam2py.slam.inertial import ImuBuffer, ImuCheck, ImuVerdict
from support.imu_check import FAULTS, FPS, made, played, record, scaled, shifted


@pytest.mark.parametrize("chip", ["mpu6050", "bmi088", "adis16448"])
@pytest.mark.parametrize("seed", range(4))
def test_right_data_raise_no_alarm(seed: int, chip: str, caplog: pytest.LogCaptureFixture) -> None:
    check, verdicts = played(made(seed, chip))
    assert ImuVerdict.HELD_BACK not in verdicts
    assert check.verdict is ImuVerdict.FITS
    assert verdicts.index(ImuVerdict.FITS) <= 5 * FPS
    assert check.report is not None and check.report.rates is not None
    assert check.report.rates.offset == pytest.approx(0, abs=3e-3)
    assert [r for r in caplog.records if r.levelno >= logging.WARNING] == []


@pytest.mark.parametrize("name", FAULTS)
def test_each_fault_is_told_within_five_seconds(
    name: str, caplog: pytest.LogCaptureFixture
) -> None:
    change, kind, said = FAULTS[name]
    given = made(1)
    change(given)
    if name == "other clock":
        # No sample lies near an image, so the buffer speaks.
        check, _ = played(given)
        assert check.verdict is ImuVerdict.UNKNOWN
        assert said in caplog.text
        return
    check, verdicts = played(given)
    assert ImuVerdict.FITS not in verdicts
    told = [r.getMessage() for r in caplog.records if "its use is held back" in r.getMessage()]
    assert sum(said in one for one in told) == 1
    n = verdicts.index(ImuVerdict.HELD_BACK)
    assert n <= 5 * FPS
    first, _ = played(replace(given, t=given.t[: n + 1]))
    assert kind in [fault.kind for fault in first.faults]
    assert said in first.reason


def test_at_rest_nothing_is_known() -> None:
    given = made(2, seconds=4.0, swing=0.0)
    check, verdicts = played(given)
    assert set(verdicts) == {ImuVerdict.UNKNOWN}
    assert check.reason == ""


def test_without_poses_the_samples_alone_are_tested() -> None:
    given = made(3, seconds=6.0)
    scaled(accel=1 / 9.81)(given)
    check, _ = played(given, lost=slice(0, None))
    assert check.verdict is ImuVerdict.HELD_BACK
    assert [fault.kind for fault in check.faults] == ["g"]


def test_what_is_corrected_fits_again(caplog: pytest.LogCaptureFixture) -> None:
    given = made(4, seconds=12.0)
    wrong = given.samples[:, 0] < given.t[60]
    given.samples[wrong, 1:4] *= 180 / np.pi
    check, verdicts = played(given)
    assert ImuVerdict.HELD_BACK in verdicts
    assert check.verdict is ImuVerdict.FITS
    assert check.reason == ""
    assert "the IMU fits the camera now" in caplog.text


def test_lost_frames_and_gaps_raise_no_alarm() -> None:
    given = made(5)
    given.samples = np.delete(given.samples, np.s_[300:340], axis=0)
    check, verdicts = played(given, lost=slice(60, 75))
    assert ImuVerdict.HELD_BACK not in verdicts
    assert check.verdict is ImuVerdict.FITS


def test_a_map_that_is_turned_and_scaled_raises_no_alarm() -> None:
    given = made(7)
    check, buffer = ImuCheck(given.settings, lambda test: test()), ImuBuffer()
    buffer.add(given.samples)
    change = np.eye(4)
    change[:3, :3] = cv2.Rodrigues(np.array([0.4, -0.3, 0.2]))[0]
    for k, (t, T_wc) in enumerate(zip(given.t.tolist(), given.T_wc, strict=True)):
        n = k // 40
        for _ in range(n):
            T_wc = change @ T_wc  # noqa: PLW2901
            T_wc[:3, 3] *= 1.3
        check.add(buffer.take(t), record(t, T_wc), n)
        assert check.verdict is not ImuVerdict.HELD_BACK
    assert check.verdict is ImuVerdict.FITS


def test_the_settings_know_the_offset() -> None:
    given = made(6)
    shifted(0.2)(given)
    given.settings = replace(given.settings, time_offset=0.2)
    check, _ = played(given)
    assert check.verdict is ImuVerdict.FITS
    assert check.report is not None and check.report.rates is not None
    assert check.report.rates.offset == pytest.approx(0.2, abs=3e-3)


def test_a_failing_test_stops_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("orbslam2py.slam.inertial.imu_check.check_imu", fail)
    check, _ = played(made(0, seconds=4.0))
    assert check.verdict is ImuVerdict.UNKNOWN
    assert "the test of the IMU failed" in caplog.text
