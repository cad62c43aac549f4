# SPDX-License-Identifier: BSD-3-Clause
"""Motions of a camera along its path: uniform, or hard to track."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray


class SyntheticMotion(str, Enum):
    """The motions there are. Their random numbers come from the sequence's seed."""

    SMOOTH = "smooth"
    """Evenly along the way."""
    TURNS_AT_ONCE = "turns-at-once"
    """Looks aside and back, with sudden turns of 1 to 6 degrees a frame."""
    STOPS = "stops"
    """Starts and stops within one frame."""
    SHAKES = "shakes"
    """Shakes by up to 2 degrees and 2 cm, in bursts."""
    STAIRS = "stairs"
    """Up and down four steps of 17 cm, with a shock at each."""
    TURN_ON_THE_SPOT = "turn-on-the-spot"
    """Stops, turns by up to 180 degrees at 40 to 120 degrees a second, and turns back."""

    def __str__(self) -> str:
        return self.value


_ROUNDS = 64  # of a schedule, after which it comes again


@dataclass(frozen=True)
class Schedule:
    """Position of a camera on its path and its yaw, piecewise linear over time.

    Attributes
    ----------
    seconds
        Times of the knots, (k,), from 0; the motion repeats after the last one.
    on_way
        Time in seconds of a uniform motion to the same position, (k,).
    yaw
        Radians to the right, (k,); 0 at both ends.
    """

    seconds: FloatArray
    on_way: FloatArray
    yaw: FloatArray

    def at(self, seconds: float) -> tuple[float, float]:
        """Return path time [s] and yaw [rad] at a time [s]."""
        rounds, rest = divmod(seconds, float(self.seconds[-1]))
        on_way = rounds * self.on_way[-1] + np.interp(rest, self.seconds, self.on_way)
        return float(on_way), float(np.interp(rest, self.seconds, self.yaw))

    def duration(self, on_way: float) -> float:
        """Return the time [s] at which a path time [s] is reached."""
        rounds, rest = divmod(on_way, float(self.on_way[-1]))
        return float(rounds * self.seconds[-1] + np.interp(rest, self.on_way, self.seconds))


class Motion:
    """A motion of one sequence.

    Parameters
    ----------
    kind
        Options of the workers.
    fps
        Frames per second: they determine the speed of sudden turns.
    seed
        Seed of the random numbers.
    """

    def __init__(self, kind: SyntheticMotion, fps: float, seed: int) -> None:
        self._kind = kind
        random = np.random.default_rng([seed, list(SyntheticMotion).index(kind)])
        self._schedule = _schedule(kind, fps, random)
        # Tremor: frequency [1/s] and phase of three waves for each of six axes.
        self._frequencies = random.uniform(3.0, 8.0, (3, 6))
        self._phases = random.uniform(0.0, 2 * np.pi, (3, 6))

    def on_way(self, seconds: float) -> float:
        """Return the time in seconds of a uniform motion to the camera's position."""
        return seconds if self._schedule is None else self._schedule.at(seconds)[0]

    def duration(self, on_way: float) -> float:
        """Return the duration [s] of this motion for `on_way` seconds of uniform motion."""
        return on_way if self._schedule is None else self._schedule.duration(on_way)

    def applied(self, T_wc: FloatArray, seconds: float) -> FloatArray:
        """Return the pose on the path with this motion, camera to world (4, 4)."""
        if self._kind is SyntheticMotion.SHAKES:
            return np.asarray(T_wc @ self._tremor(seconds))
        if self._kind is SyntheticMotion.STAIRS:
            return _on_stairs(T_wc, seconds)
        yaw = 0.0 if self._schedule is None else self._schedule.at(seconds)[1]
        return T_wc if yaw == 0.0 else np.asarray(T_wc @ _turned([0.0, yaw, 0.0]))

    def _tremor(self, seconds: float) -> FloatArray:
        burst = 0.5 - 0.5 * math.cos(2 * math.pi * seconds / 3.0)
        waves = np.sin(2 * np.pi * self._frequencies * seconds + self._phases).sum(axis=0) / 3
        T = _turned(burst * math.radians(2.0) * waves[:3])
        T[:3, 3] = burst * 0.02 * waves[3:]
        return T


def _schedule(kind: SyntheticMotion, fps: float, random: np.random.Generator) -> Schedule | None:
    if kind is SyntheticMotion.STOPS:
        going, standing = random.uniform(1.5, 3.0, _ROUNDS), random.uniform(0.7, 2.0, _ROUNDS)
        parts = np.stack([going, standing], axis=1)
        return _from_parts(parts, np.stack([going, 0 * standing], axis=1), np.zeros_like(parts))
    if kind is SyntheticMotion.TURNS_AT_ONCE:
        going, held = random.uniform(1.2, 2.5, _ROUNDS), random.uniform(0.3, 1.0, _ROUNDS)
        rates = np.radians(random.uniform(1.0, 6.0, (2, _ROUNDS))) * fps
        angles = np.radians(random.uniform(10.0, 45.0, _ROUNDS))
        goes_on = True
    elif kind is SyntheticMotion.TURN_ON_THE_SPOT:
        going, held = random.uniform(1.5, 2.5, _ROUNDS), random.uniform(0.2, 0.8, _ROUNDS)
        rates = np.radians(random.uniform(40.0, 120.0, (2, _ROUNDS)))
        angles = np.radians(random.uniform(60.0, 180.0, _ROUNDS))
        goes_on = False
    else:
        return None
    parts = np.stack([going, angles / rates[0], held, angles / rates[1]], axis=1)
    on_way = parts if goes_on else parts * [1.0, 0.0, 0.0, 0.0]
    aside = random.choice([-1.0, 1.0], _ROUNDS) * angles
    zero = np.zeros(_ROUNDS)
    return _from_parts(parts, on_way, np.stack([zero, aside, aside, zero], axis=1))


def _from_parts(seconds: FloatArray, on_way: FloatArray, yaw: FloatArray) -> Schedule:
    """Join durations, path times and final yaws of parts, (rounds, parts)."""

    def summed(values: FloatArray) -> FloatArray:
        return np.concatenate([[0.0], np.cumsum(values)])

    return Schedule(summed(seconds), summed(on_way), np.concatenate([[0.0], yaw.ravel()]))


_STEP = 0.17  # metres
_STEPS = 4  # up, then as many down
_PER_STEP = 0.55  # seconds
_LIFTED = 0.25  # seconds in which the camera rises at a step


def _on_stairs(T_wc: FloatArray, seconds: float) -> FloatArray:
    """Return the pose raised by the steps climbed so far, with a nod at each."""
    step, since = divmod(seconds, _PER_STEP)
    share = min(1.0, since / _LIFTED)
    climbed = (step + 0.5 - 0.5 * math.cos(math.pi * share)) % (2 * _STEPS)
    height = _STEP * min(climbed, 2 * _STEPS - climbed)
    strength = 0.0 if step == 0 else math.radians(1.5)  # the first step begins from standing
    nod = strength * math.exp(-since / 0.15) * math.cos(2 * math.pi * since / 0.3)
    raised = T_wc @ _turned([nod - strength, 0.0, 0.0])
    raised[1, 3] -= height  # y points down
    return np.asarray(raised)


def _turned(vector: FloatArray | list[float]) -> FloatArray:
    """Pose (4, 4) of a rotation vector [rad]."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.asarray(vector, dtype=np.float64))[0]
    return T
