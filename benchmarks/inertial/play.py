# SPDX-License-Identifier: BSD-3-Clause
"""Runs of one sequence: without the IMU, and with each chip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

import orbslam2py as orb
from benchmarks.inertial.cases import Case
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.settings import imu_noise
from orbslam2py.slam.records import PoseMethod, TrackingRecord
from orbslam2py.synthetic import SyntheticSequence
from orbslam2py.trajectory import align

_STREAM = 0x1A55  # of the random numbers of `orbslam2py.synthetic.imu`
_UP = np.array([0.0, -1.0, 0.0])  # in the synthetic worlds


@dataclass
class Run:
    """A run.

    Attributes
    ----------
    centres
        (n, 3) of the camera, final; NaN without a pose.
    map_index
        (n,) map of the final pose; -1 without one.
    led
        (n,) frames that the IMU led.
    started
        Seconds of the first image with the IMU in use; None: never.
    up_error
        Degrees between the map's third axis and the vertical at the end; None without an IMU.
    scale_error
        Share by which lengths are wrong at the end; None without an IMU.
    bias_errors
        Errors of the biases at the end in standard deviations (6,).
    nees
        (k, 3) of velocity, gyro bias and accelerometer bias, once a second after 10 s.
    fault
        Reason why the IMU was held back; empty.
    """

    centres: FloatArray
    map_index: IntArray
    led: NDArray[np.bool_]
    started: float | None = None
    up_error: float | None = None
    scale_error: float | None = None
    bias_errors: FloatArray | None = None
    nees: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    fault: str = ""


def true_biases(sequence: SyntheticSequence) -> FloatArray:
    """Biases (n, 6) of the samples, as the sequence drew them."""
    samples, options = sequence.imu(), sequence.options
    assert samples is not None
    noise = imu_noise(options.imu_noise or "adis16448")
    random = np.random.default_rng([options.seed, _STREAM])
    rate = 1 / float(np.median(np.diff(samples.timestamps)))
    walk = np.repeat([noise.gyro_walk, noise.accel_walk], 3) / np.sqrt(rate)
    first = np.repeat((0.01, 0.1), 3) * random.standard_normal(6)
    steps = random.standard_normal((len(samples.timestamps), 6))
    return np.asarray(first + np.cumsum(walk * steps, axis=0))


def play(case: Case, chips: Sequence[str], config: Mapping[str, Any] | None = None) -> list[Run]:
    """Run a case without the IMU, then with each chip."""
    sequences = [SyntheticSequence(case.options(chip)) for chip in chips]
    images = [sequences[0].load(i) for i in range(len(sequences[0]))]
    runs = [_run(sequences[0], images, case, config, with_imu=False)]
    return runs + [_run(one, images, case, config, with_imu=True) for one in sequences]


def _run(
    sequence: SyntheticSequence,
    images: Sequence[Any],
    case: Case,
    config: Mapping[str, Any] | None,
    *,
    with_imu: bool,
) -> Run:
    times, samples = sequence.timestamps, sequence.imu()
    imu = sequence.imu_settings() if with_imu else None
    records: list[TrackingRecord] = []
    states: list[tuple[int, Any]] = []
    system = orb.System(
        sequence.default_settings(), case.sensor, deterministic=True, imu=imu, config=config
    )
    with system as slam:
        before = None
        for i, (image, timestamp) in enumerate(zip(images, times, strict=True)):
            part = samples.since(before, timestamp) if with_imu and samples is not None else None
            records.append(slam.track(image, float(timestamp), imu=part))
            before = timestamp
            tracker = slam.pipeline.inertial_tracker
            if tracker is not None and tracker.filter is not None and i % 20 == 0:
                states.append((i, _state(tracker.filter, len(slam.loops))))
        last = None if not with_imu else _last_state(slam)
    run = _final(system, records, len(times))
    if with_imu:
        check = system.imu_check
        run.fault = "" if check is None else check.reason
        started = [r.timestamp - times[0] for r in records if r.inertial is not None]
        run.started = started[0] if started else None
        _judge_state(run, sequence, records, states, last)
    return run


def _state(f: Any, n_loops: int) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    return np.array(f.velocity), np.array(f.bias), np.array(f.covariance), n_loops


def _last_state(slam: orb.System) -> tuple[FloatArray, FloatArray] | None:
    tracker = slam.pipeline.inertial_tracker
    if tracker is None or tracker.filter is None:
        return None
    return np.array(tracker.filter.bias), np.array(tracker.filter.covariance)


def _final(system: orb.System, records: Sequence[TrackingRecord], n: int) -> Run:
    centres, maps = np.full((n, 3), np.nan), np.full(n, -1)
    for number, path in enumerate(system.trajectories()):
        rows = np.flatnonzero(~path.lost)
        centres[path.indices[rows]] = path.positions[rows]
        maps[path.indices[rows]] = number
    led = np.array([r.method is PoseMethod.IMU for r in records])
    return Run(centres, maps, led)


def _judge_state(
    run: Run,
    sequence: SyntheticSequence,
    records: Sequence[TrackingRecord],
    states: Sequence[tuple[int, Any]],
    last: tuple[FloatArray, FloatArray] | None,
) -> None:
    if run.started is None:
        return
    truth = sequence.ground_truth().T_wc[:, :3, 3]
    newest = run.map_index.max()
    rows = np.flatnonzero(run.map_index == newest)
    if len(rows) < 10:
        return
    found = align(run.centres[rows], truth[rows], with_scale=True)
    run.scale_error = abs(1 / found.scale - 1)
    cosine = float(found.R[:, 2] @ _UP)
    run.up_error = float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
    biases = true_biases(sequence)
    samples = sequence.imu()
    assert samples is not None
    if last is not None:
        deviations = np.sqrt(np.diag(last[1])[9:15])
        run.bias_errors = (last[0] - biases[-1]) / deviations
    run.nees = _nees(run, sequence, states, found.R, biases)


def _nees(
    run: Run,
    sequence: SyntheticSequence,
    states: Sequence[tuple[int, Any]],
    rotation: FloatArray,
    biases: FloatArray,
) -> FloatArray:
    """Normalised squared errors over their degrees of freedom; 1 is expected."""
    times, samples = sequence.timestamps, sequence.imu()
    assert samples is not None
    rows = []
    path, step = sequence._imu_path, 1e-4
    for i, (velocity, bias, covariance, _) in states:
        if times[i] - times[0] < 10 or run.led[i]:
            continue
        ends = path.poses(np.array([times[i] - step, times[i] + step]))[:, :3, 3]
        true = (ends[1] - ends[0]) / (2 * step)
        at = min(len(biases) - 1, int(np.searchsorted(samples.timestamps, times[i])))
        errors = [
            (rotation @ velocity - true, slice(3, 6)),
            (bias[:3] - biases[at, :3], slice(9, 12)),
        ]
        errors.append((bias[3:] - biases[at, 3:], slice(12, 15)))
        row = []
        for k, (error, part) in enumerate(errors):
            P = covariance[part, part]
            P = rotation @ P @ rotation.T if k == 0 else P
            row.append(float(error @ np.linalg.solve(P, error)) / 3)
        rows.append(row)
    return np.array(rows).reshape(-1, 3)
