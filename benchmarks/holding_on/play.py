# SPDX-License-Identifier: BSD-3-Clause
"""A run, with the data of every frame."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import orbslam2py as orb
from benchmarks.holding_on.scene import Case, Floats, Integers, Scene
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory.rotations import inverse_poses

Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Played:
    """A run.

    Attributes
    ----------
    scene
        The scene of the run.
    truth
        ``T_cw`` of every frame, (n, 4, 4); NaN where not known.
    truth_part
        (n,) see `Scene.truth_part`.
    posed
        Frames with a pose, (n,).
    T_cw
        Poses as they were returned for each image, before later corrections, (n, 4, 4); NaN without
        one.
    motion
        Motion from the frame before, by its pose in the map at this image, (n, 4, 4); NaN where
        unknown.
    covariance
        (n, 6, 6) rotation, translation; NaN without one.
    keyframe
        Frames that became keyframes, (n,).
    map_index
        (n,) which map the pose is in.
    changed
        Frames before which a loop had moved the map, (n,).
    with_imu
        Frames of which the IMU had a state, (n,).
    covered
        Frames with a hand over the lens, (n,).
    path
        Final pose ``T_wc`` of every frame of the last map, (n, 4, 4); NaN without one.
    loops, seconds
        Loops closed, and wall-clock time of it all.
    """

    scene: Scene
    truth: Floats
    truth_part: Integers
    posed: Flags
    T_cw: Floats
    motion: Floats
    covariance: Floats
    keyframe: Flags
    map_index: Integers
    changed: Flags
    with_imu: Flags
    covered: Flags
    path: Floats
    loops: int
    seconds: float


def play(case: Case, config: Mapping[str, Any] | None = None) -> Played:
    """Run a case with changes of the configuration; two runs give the same."""
    began = time.perf_counter()
    scene = case.scene()
    n = len(scene)
    records: list[TrackingRecord] = []
    changes = np.zeros(n, np.int64)
    nowhere, unknown = np.full((4, 4), np.nan), np.full((6, 6), np.nan)
    motion = np.tile(nowhere, (n, 1, 1))
    system = orb.System(
        scene.settings,
        scene.sensor,
        deterministic=True,
        seed=case.seed,
        imu=scene.imu,
        config=config,
    )
    with system as slam:
        before = None
        for i, timestamp in enumerate(scene.timestamps):
            samples = None if scene.samples is None else scene.samples.since(before, timestamp)
            records.append(slam.track(scene.load(i), float(timestamp), imu=samples))
            before = timestamp
            changes[i] = slam.pipeline.back_end.map.big_change_index
            velocity = slam.pipeline.tracking.motion.velocity
            if velocity is not None:
                motion[i] = velocity.step.matrix
    path = np.full((n, 4, 4), np.nan)
    last = system.trajectory()
    path[_indices(scene, last.timestamps)] = last.T_wc
    path[_indices(scene, last.timestamps[last.lost])] = np.nan
    return Played(
        scene=scene,
        truth=inverse_poses(scene.truth),
        truth_part=scene.truth_part,
        posed=np.array([r.T_cw is not None for r in records]),
        T_cw=np.stack([nowhere if r.T_cw is None else r.T_cw for r in records]),
        motion=motion,
        covariance=np.stack([unknown if r.covariance is None else r.covariance for r in records]),
        keyframe=np.array([r.is_keyframe for r in records]),
        map_index=np.array([r.map_index for r in records]),
        changed=np.diff(changes, prepend=0) != 0,
        with_imu=np.array([r.inertial is not None for r in records]),
        covered=np.array([scene.covered(i) for i in range(n)]),
        path=path,
        loops=system.n_loops_closed,
        seconds=time.perf_counter() - began,
    )


def _indices(scene: Scene, timestamps: Floats) -> Integers:
    found: Integers = np.searchsorted(scene.timestamps, timestamps - 1e-6)
    return found
