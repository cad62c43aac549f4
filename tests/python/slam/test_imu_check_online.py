# SPDX-License-Identifier: BSD-3-Clause
"""The check of an IMU while images are tracked: each fault within 5 s, no false alarm.

The poses are those of a hand-held camera with the errors of vision, the samples those of three
chips. Recordings are tracked in `test_recorded_imu`.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest

from orbslam2py._arrays import FloatArray
from orbslam2py.settings import ImuSettings, imu_noise
from orbslam2py.slam.inertial import ImuBuffer, ImuCheck, ImuVerdict
from orbslam2py.slam.records import Reason, TrackingRecord, TrackingState
from orbslam2py.synthetic.imu import T_CI
from orbslam2py.synthetic.spline import PoseSpline
from orbslam2py.trajectory.rotations import inverse_poses

FPS, RATE = 20, 200
GRAVITY = np.array([0.0, 9.81, 0.0])


@dataclass
class Made:
    """Poses and samples of one camera."""

    t: FloatArray
    T_wc: FloatArray
    samples: FloatArray
    settings: ImuSettings


def made(seed: int, chip: str = "bmi088", seconds: float = 6.0, swing: float = 1.0) -> Made:
    random = np.random.default_rng(seed)
    t = 100.0 + np.arange(0, seconds, 1 / FPS)
    sines = np.zeros((2, len(t), 3))
    for frequency in random.uniform(0.15, 0.7, 4):
        phases, sizes = random.uniform(0, 6, (2, 3)), random.uniform(0.5, 1.0, (2, 3))
        sines += sizes[:, None] * np.sin(2 * np.pi * frequency * t[:, None] + phases[:, None])
    T_wc = np.tile(np.eye(4), (len(t), 1, 1))
    for T, turn, place in zip(T_wc, *sines, strict=True):
        T[:3, :3] = cv2.Rodrigues(0.15 * swing * turn)[0]
        T[:3, 3] = 0.15 * swing * place
    path = PoseSpline(t, T_wc @ T_CI)
    at = np.arange(t[0], t[-1], 1 / RATE)
    R = path.poses(at)[:, :3, :3]
    force = np.einsum("nji,nj->ni", R, path.accelerations(at) - GRAVITY)
    noise = imu_noise(chip)
    white = np.repeat([noise.gyro_noise, noise.accel_noise], 3) * np.sqrt(RATE)
    bias = np.repeat([0.01, 0.1], 3) * random.standard_normal(6)
    readings = np.hstack([path.rates(at), force]) + bias
    readings += white * random.standard_normal(readings.shape)
    for T in T_wc:
        T[:3, :3] = T[:3, :3] @ cv2.Rodrigues(random.normal(0, 1e-3, 3))[0]
        T[:3, 3] = 0.4 * (T[:3, 3] + random.normal(0, 2e-3, 3))
    settings = ImuSettings(
        noise.gyro_noise, noise.accel_noise, noise.gyro_walk, noise.accel_walk, T_ci=T_CI
    )
    return Made(t, T_wc, np.column_stack([at, readings]), settings)


def record(t: float, T_wc: FloatArray | None, map_index: int = 0) -> TrackingRecord:
    return TrackingRecord(
        frame_id=0,
        timestamp=t,
        map_index=map_index,
        state=TrackingState.LOST if T_wc is None else TrackingState.OK,
        reason=Reason.NOT_FOUND_IN_MAP if T_wc is None else Reason.NONE,
        T_cw=None if T_wc is None else inverse_poses(T_wc),
        covariance=None,
        n_matches=0,
        n_inliers=0,
        is_keyframe=False,
        reference_keyframe=-1,
    )


def played(given: Made, lost: slice = slice(0, 0)) -> tuple[ImuCheck, list[ImuVerdict]]:
    """The check, and its verdict after every frame."""
    check, buffer = (
        ImuCheck(given.settings, lambda test: test()),
        ImuBuffer(given.settings.time_offset),
    )
    buffer.add(given.samples)
    poses: list[FloatArray | None] = list(given.T_wc)
    poses[lost] = [None] * len(poses[lost])
    verdicts = []
    for t, T_wc in zip(given.t.tolist(), poses, strict=False):
        check.add(buffer.take(t), record(t, T_wc))
        verdicts.append(check.verdict)
    return check, verdicts


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


Change = Callable[[Made], None]


def columns(*order: int, signs: tuple[float, ...] = (1,) * 6) -> Change:
    def change(given: Made) -> None:
        given.samples[:, 1:] = given.samples[:, 1:][:, order] * signs

    return change


def scaled(gyro: float = 1.0, accel: float = 1.0) -> Change:
    return columns(*range(6), signs=(*[gyro] * 3, *[accel] * 3))


def shifted(seconds: float) -> Change:
    def change(given: Made) -> None:
        given.samples[:, 0] += seconds

    return change


def clipped(column: int) -> Change:
    def change(given: Made) -> None:
        values = given.samples[:, column]
        limit = np.quantile(np.abs(values), 0.7)
        given.samples[:, column] = np.clip(values, -limit, limit)

    return change


def set_to(column: int, value: float) -> Change:
    def change(given: Made) -> None:
        given.samples[:, column] = value

    return change


def inverse(given: Made) -> None:
    given.settings = replace(given.settings, T_ci=inverse_poses(T_CI))


def turned(given: Made) -> None:
    T = T_CI.copy()
    T[:3, :3] = T[:3, :3] @ cv2.Rodrigues(np.array([0.2, -0.2, 0.2]))[0]
    given.settings = replace(given.settings, T_ci=T)


def stabilised(given: Made) -> None:
    """The camera turns slowly, whatever the hand does."""
    slow = np.clip(np.arange(len(given.t)) / 10, 0, None)
    for T, k in zip(given.T_wc, slow, strict=True):
        T[:3, :3] = cv2.Rodrigues(0.15 * np.sin(np.array([0.3, 0.4, 0.5]) * k))[0]


FAULTS: dict[str, tuple[Change, str, str]] = {
    "degrees": (scaled(gyro=180 / np.pi), "degrees", "multiply by 0.0174533"),
    "g": (scaled(accel=1 / 9.81), "g", "multiply by 9.81"),
    "late": (shifted(0.03), "time_offset", "differ by +"),
    "early": (shifted(-0.1), "time_offset", "differ by -"),
    "other clock": (shifted(1e6), "time_offset", "clock"),
    "swapped": (columns(3, 4, 5, 0, 1, 2), "swapped", "exchange the columns"),
    "inverse": (inverse, "inverse", "invert the whole matrix"),
    "turned": (turned, "rotation", "the rotation from IMU to camera that fits is"),
    "both exchanged": (columns(1, 2, 0, 4, 5, 3), "axes", "x = z, y = x, z = y"),
    "gyro z": (columns(*range(6), signs=(1, 1, -1, 1, 1, 1)), "axes", "z = -z"),
    "gyro": (scaled(gyro=-1), "axes", "x = -x, y = -y, z = -z"),
    "accelerometer": (scaled(accel=-1), "sign", "multiply its columns by -1"),
    "accelerometer z": (
        columns(*range(6), signs=(1, 1, 1, 1, 1, -1)),
        "axes",
        "of the accelerometer are",
    ),
    "dead gyro": (set_to(2, 0.0), "dead", "axis y of the gyro"),
    "dead accelerometer": (set_to(6, 9.81), "dead", "axis z of the accelerometer"),
    "clipped gyro": (clipped(1), "saturated", "axis x of the gyro is saturated"),
    "clipped accelerometer": (clipped(5), "saturated", "of the accelerometer is saturated"),
    "stabilised": (stabilised, "unrelated", "stabilis"),
}


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
