# SPDX-License-Identifier: BSD-3-Clause
"""Every fault of an IMU, made on purpose while images are tracked, and right IMUs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from rich.console import Console

import orbslam2py as orb
from benchmarks.harness.tables import new_table
from benchmarks.inertial.cases import CHIPS, SENSORS
from orbslam2py._arrays import FloatArray
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial import ImuVerdict
from orbslam2py.slam.records import TrackingState
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import inverse_poses

#: A fault must be reported within this time after the first pose [s].
PATIENCE = 5.0
RIGHT = "none"
_FRAMES, _SIZE = 140, (320, 240)
_WORLDS = ("room", "corridor")
#: Deviation [s] of the filter by which a stabilised video is smoothed, and how far it reaches.
_SMOOTHED, _REACH = 0.4, 3.0


@dataclass
class Given:
    """Input of a run."""

    samples: FloatArray  # (n, 7)
    settings: ImuSettings
    images: list[Any]


Change = Callable[[Given, SyntheticSequence, np.random.Generator], None]


@dataclass(frozen=True)
class Fault:
    """A fault, and the kinds of findings that are correct for it."""

    name: str
    kinds: frozenset[str]
    change: Change
    sensors: tuple[str, ...] = SENSORS


@dataclass(frozen=True)
class Told:
    """Reports of a run."""

    fault: str
    sensor: str
    seed: int
    chip: str
    told: float | None  # [s] from the first pose to the first report
    kinds: tuple[str, ...]
    is_right: bool
    fits: bool  # the IMU was called right at some time
    text: str


def _columns(order: Sequence[int], signs: Sequence[float]) -> Change:
    def change(given: Given, _: SyntheticSequence, __: np.random.Generator) -> None:
        given.samples[:, 1:] = given.samples[:, 1:][:, list(order)] * np.array(signs)

    return change


def _wrong_axes(given: Given, _: SyntheticSequence, random: np.random.Generator) -> None:
    """Exchange the axes of both, as of a sensor that is mounted in another way."""
    order = [[1, 2, 0], [2, 0, 1]][int(random.integers(2))]
    given.samples[:, 1:] = given.samples[:, 1:][:, order + [3 + k for k in order]]


def _wrong_sign(given: Given, _: SyntheticSequence, random: np.random.Generator) -> None:
    given.samples[:, 1 + int(random.integers(3))] *= -1


def _inverse(given: Given, _: SyntheticSequence, __: np.random.Generator) -> None:
    given.settings = replace(given.settings, T_ci=inverse_poses(given.settings.T_ci))


def _offset(given: Given, _: SyntheticSequence, random: np.random.Generator) -> None:
    given.samples[:, 0] += random.uniform(0.02, 0.15) * random.choice([-1, 1])


def _dead(given: Given, _: SyntheticSequence, random: np.random.Generator) -> None:
    column = 1 + int(random.integers(6))
    given.samples[:, column] = given.samples[0, column]


def _saturated(given: Given, _: SyntheticSequence, random: np.random.Generator) -> None:
    column = 1 + int(random.integers(6))
    values = given.samples[:, column]
    limit = float(np.quantile(np.abs(values), 0.7))
    given.samples[:, column] = np.clip(values, -limit, limit)


def _stabilised(given: Given, sequence: SyntheticSequence, _: np.random.Generator) -> None:
    """Turn the images against the hand, as a phone does."""
    R = sequence.ground_truth().T_wc[:, :3, :3]
    camera = sequence.default_settings().camera
    K = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    t = sequence.timestamps
    for k, frame in enumerate(given.images):
        weights = np.exp(-0.5 * ((t - t[k]) / _SMOOTHED) ** 2)
        weights[np.abs(t - t[k]) > _REACH * _SMOOTHED] = 0
        U, _s, Vt = np.linalg.svd(np.einsum("n,nij->ij", weights, R))
        smooth = U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
        H = K @ smooth.T @ R[k] @ np.linalg.inv(K)
        size = frame.image.shape[1], frame.image.shape[0]
        turned = cv2.warpPerspective(frame.image, H, size, borderMode=cv2.BORDER_REPLICATE)
        given.images[k] = replace(frame, image=turned)


def _nothing(_: Given, __: SyntheticSequence, ___: np.random.Generator) -> None:
    pass


_SAME = (1.0,) * 6
FAULTS = [
    Fault(RIGHT, frozenset(), _nothing),
    Fault("axes", frozenset({"axes", "rotation"}), _wrong_axes),
    Fault("sign", frozenset({"axes"}), _wrong_sign),
    Fault("accelerometer upside down", frozenset({"sign"}),
          _columns(range(6), (1, 1, 1, -1, -1, -1))),
    Fault("inverse", frozenset({"inverse"}), _inverse),
    Fault("degrees", frozenset({"degrees"}), _columns(range(6), (180 / np.pi,) * 3 + (1.0,) * 3)),
    Fault("g", frozenset({"g"}), _columns(range(6), (1.0,) * 3 + (1 / 9.81,) * 3)),
    Fault("swapped", frozenset({"swapped"}), _columns((3, 4, 5, 0, 1, 2), _SAME)),
    Fault("time offset", frozenset({"time_offset"}), _offset),
    Fault("dead axis", frozenset({"dead"}), _dead),
    Fault("saturated", frozenset({"saturated"}), _saturated),
    Fault("stabilised", frozenset({"unrelated", "scale"}), _stabilised, ("mono",)),
]  # fmt: skip


def played(names: Sequence[str], sensors: Sequence[str], seeds: int) -> Iterator[Told]:
    """Play all faults with each seed; sensor, chip and world change with it."""
    chosen = [fault for fault in FAULTS if not names or fault.name in names]
    for seed in range(1, seeds + 1):
        made: dict[str, tuple[SyntheticSequence, list[Any]]] = {}
        for fault in chosen:
            able = [sensor for sensor in sensors if sensor in fault.sensors]
            if able:
                sensor = able[seed % len(able)]
                if sensor not in made:
                    made[sensor] = _rendered(sensor, seed)
                yield _told(fault, *made[sensor], seed)


def _rendered(sensor: str, seed: int) -> tuple[SyntheticSequence, list[Any]]:
    options = SyntheticOptions(
        world=_WORLDS[seed // 3 % 2],
        frames=_FRAMES,
        size=_SIZE,
        motion="shakes",
        sensor=sensor,
        seed=seed,
        noise=2.0,
        depth_noise=0.005 if sensor == "rgbd" else 0.0,
        imu=True,
        imu_noise=CHIPS[seed // 2 % 3],
    )
    sequence = SyntheticSequence(options)
    return sequence, [sequence.load(k) for k in range(len(sequence))]


def _told(fault: Fault, sequence: SyntheticSequence, images: Sequence[Any], seed: int) -> Told:
    samples, settings = sequence.imu(), sequence.imu_settings()
    assert samples is not None and settings is not None
    given = Given(np.array(samples.data), settings, list(images))
    fault.change(given, sequence, np.random.default_rng(seed))
    sensor = sequence.options.sensor
    system = orb.System(sequence.default_settings(), sensor, deterministic=True, imu=given.settings)
    first: float | None = None
    fits = False
    check = system.imu_check
    assert check is not None
    with system as slam:
        slam.add_imu(given.samples)
        for image, timestamp in zip(given.images, sequence.timestamps.tolist(), strict=True):
            record = slam.track(image, timestamp)
            if first is None and record.state is TrackingState.OK:
                first = timestamp
            fits |= check.verdict is ImuVerdict.FITS
            if check.verdict is ImuVerdict.HELD_BACK:
                break
        held = check.verdict is ImuVerdict.HELD_BACK
        kinds = tuple(one.kind for one in check.faults)
        text = check.reason
    seconds = None if not held else timestamp - (timestamp if first is None else first)
    is_right = not held if fault.name == RIGHT else bool(fault.kinds & {*kinds})
    return Told(
        fault.name, str(sensor), seed, str(sequence.options.imu_noise), seconds, kinds, is_right,
        fits, text,
    )  # fmt: skip


def show(rows: Sequence[Told], console: Console) -> None:
    """Print a line for each fault, then every run that was not as it should be."""
    numbers = ["runs", f"reported in {PATIENCE:.0f} s", "kind right", "latest [s]", "called right"]
    table = new_table("faults on purpose", ["fault"], numbers)
    for name in dict.fromkeys(row.fault for row in rows):
        group = [row for row in rows if row.fault == name]
        told = [row.told for row in group if row.told is not None]
        table.add_row(
            name,
            f"{len(group)}",
            f"{sum(seconds <= PATIENCE for seconds in told)}",
            f"{sum(row.is_right for row in group)}",
            f"{max(told):.1f}" if told else "-",
            f"{sum(row.fits for row in group)}",
        )
    console.print(table)
    for row in rows:
        late = row.fault != RIGHT and (row.told is None or row.told > PATIENCE)
        if late or not row.is_right:
            said = "nothing" if row.told is None else f"after {row.told:.1f} s: {row.text}"
            console.print(f"{row.fault}, {row.sensor}, {row.seed}, {row.chip}: {said}")
