# SPDX-License-Identifier: BSD-3-Clause
"""An IMU beside a camera, with every fault made on purpose, and its check frame by frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np

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
    poses: list[FloatArray | None] = [None if np.isnan(T[0, 0]) else T for T in given.T_wc]
    poses[lost] = [None] * len(poses[lost])
    verdicts = []
    for t, T_wc in zip(given.t.tolist(), poses, strict=False):
        check.add(buffer.take(t), record(t, T_wc))
        verdicts.append(check.verdict)
    return check, verdicts


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
    given.settings = replace(given.settings, T_ci=inverse_poses(given.settings.T_ci))


def turned(given: Made) -> None:
    T = given.settings.T_ci.copy()
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
