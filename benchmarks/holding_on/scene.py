# SPDX-License-Identifier: BSD-3-Clause
"""Input of a run, synthetic or recorded."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from orbslam2py.datasets import Images
from orbslam2py.inertial.samples import ImuSamples
from orbslam2py.settings import ImuSettings, Sensor, Settings

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
#: Share of the first view's points that a second must see, to have a parallax.
OVERLAP = 0.5


def median_angle(first: Floats, second: Floats) -> float:
    """Median angle [rad] between rays (n, 3)."""
    lengths = [np.linalg.norm(rays, axis=1) for rays in (first, second)]
    cosines = np.sum(first * second, axis=1) / np.prod(lengths, axis=0)
    return float(np.median(np.arccos(np.clip(cosines, -1, 1))))


class Scene(Protocol):
    """Images, and the ground truth of each.

    Attributes
    ----------
    sensor, settings
        What it is played with.
    timestamps
        Seconds, (n,).
    fps
        Usual number of images in a second.
    truth
        True poses ``T_wc`` (n, 4, 4), NaN where they are not known.
    truth_part
        (n,) which part of the truth a frame's pose is of: what lies between two parts is not known.
    truth_variance
        (6,) of its motions from frame to frame, rotation [rad^2] and translation [m^2].
    imu, samples
        The IMU beside the camera and its samples; None without.
    near
        Metres within which two views in the same direction see the same place.
    """

    sensor: Sensor
    settings: Settings
    imu: ImuSettings | None
    samples: ImuSamples | None
    timestamps: Floats
    truth_variance: Floats
    fps: float
    near: float

    def __len__(self) -> int:
        """Return the number of images."""
        ...

    def load(self, index: int) -> Images:
        """Return what the camera sees."""
        ...

    @property
    def truth(self) -> Floats: ...
    @property
    def truth_part(self) -> Integers: ...

    def covered(self, index: int) -> bool:
        """Whether a hand is over the lens."""
        ...

    def parallax(self, first: int, second: int) -> float:
        """Median angle [rad] at which two views see common points; 0 if they share too few."""
        ...


class Case(Protocol):
    """One run of a scene.

    Attributes
    ----------
    key
        Its name in the file of all runs.
    situation
        Which line of the table it counts in.
    sensor, features, seed
        Of the run.
    """

    @property
    def key(self) -> str: ...
    @property
    def situation(self) -> str: ...
    @property
    def sensor(self) -> str: ...
    @property
    def features(self) -> int: ...
    @property
    def seed(self) -> int: ...

    def scene(self) -> Scene:
        """Return what is played."""
        ...

    def described(self) -> str:
        """Return all options as text, so that it can be played again by hand."""
        ...
