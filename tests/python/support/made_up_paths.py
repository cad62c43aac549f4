# SPDX-License-Identifier: BSD-3-Clause
"""Paths that somebody made up, and files of them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from orbslam2py import Trajectory


def made_up(n: int, seed: int = 0) -> Trajectory:
    generator = np.random.default_rng(seed)
    T_wc = np.tile(np.eye(4), (n, 1, 1))
    T_wc[:, :3, :3] = Rotation.random(n, random_state=generator).as_matrix()
    T_wc[:, :3, 3] = generator.normal(size=(n, 3)) * 10
    return Trajectory(np.arange(n) * 0.1, T_wc)


def wander(n: int, seed: int = 0, rate: float = 10.0) -> Trajectory:
    """A smooth walk with turning."""
    generator = np.random.default_rng(seed)
    T_wc = np.tile(np.eye(4), (n, 1, 1))
    turns = np.cumsum(generator.normal(scale=0.02, size=(n, 3)), axis=0)
    T_wc[:, :3, :3] = Rotation.from_rotvec(turns).as_matrix()
    velocity = np.cumsum(generator.normal(scale=0.05, size=(n, 3)), axis=0) + np.array([0.5, 0, 0])
    T_wc[:, :3, 3] = np.cumsum(velocity, axis=0) / rate
    return Trajectory(100.0 + np.arange(n) / rate, T_wc)


def straight(n: int, step: float) -> Trajectory:
    T_wc = np.tile(np.eye(4), (n, 1, 1))
    T_wc[:, 2, 3] = np.arange(n) * step
    return Trajectory(np.arange(n) * 0.1, T_wc)
