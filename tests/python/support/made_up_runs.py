# SPDX-License-Identifier: BSD-3-Clause
"""Folders of runs that never were, with everything a page has to show."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from orbslam2py import Sensor, Settings, Trajectory
from orbslam2py.datasets.base import Images
from orbslam2py.maps import MapSnapshot
from orbslam2py.runs import RunOptions, RunResult
from orbslam2py.runs.frame_table import STAGES
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.report import evaluate_run, make_report
from orbslam2py.settings import CameraSettings, settings_for_camera
from orbslam2py.slam.events import LoopClosed
from support.made_up_rows import FPS, rows_of


class MadeUpSequence:
    """A camera that goes around in a circle; its images are noise."""

    layout = "synthetic"

    def __init__(self, n: int, sensor: Sensor, name: str, *, has_truth: bool) -> None:
        self.name, self.sensor, self._has_truth = name, sensor, has_truth
        camera = CameraSettings(fx=60, fy=60, cx=40, cy=30, width=80, height=60)
        given = {"rgbd": {"depth_factor": 1000.0}, "stereo": {"baseline": 0.1}, "mono": {}}
        self.settings = settings_for_camera(camera, sensor, **given[sensor.value])
        self.timestamps = np.arange(n) / FPS

    def __len__(self) -> int:
        return len(self.timestamps)

    def timestamp_text(self, index: int) -> str:
        return f"{index / FPS:.3f}"

    def default_settings(self) -> Settings:
        return self.settings

    def load(self, index: int) -> Images:
        image = np.random.default_rng(index).integers(0, 256, (60, 80, 3), np.uint8)
        return Images(image)

    def true_path(self) -> Trajectory:
        angle = 2 * np.pi * self.timestamps / max(1.0, self.timestamps[-1:].sum())
        T_wc = np.tile(np.eye(4), (len(self), 1, 1))
        T_wc[:, 0, 3], T_wc[:, 2, 3] = 2 * np.cos(angle) - 2, 2 * np.sin(angle)
        T_wc[:, 1, 3] = 0.1 * np.sin(3 * angle)
        return Trajectory(self.timestamps, T_wc)

    def ground_truth(self) -> Trajectory | None:
        return self.true_path() if self._has_truth else None


def made_up_run(
    folder: Path,
    states: str = "k" * 40,
    *,
    sensor: str = "rgbd",
    maps: str = "",
    has_truth: bool = True,
    name: str = "circle",
    noise: float = 0.01,
    loop: bool = True,
    command: str | None = "orbslam2py run circle",
) -> Path:
    """Write the folder of a run.

    The letters of `states` are those of `rows_of`, the digits of `maps` the map of each frame
    (all in map 0 by default). Every fifth tracked frame is a keyframe.
    """
    sequence = MadeUpSequence(len(states), Sensor(sensor), name, has_truth=has_truth)
    result = result_of(sequence, states, maps or "0" * len(states), noise)
    result.command = command
    if loop and len(result.keyframes) > 3:
        result.loops = [_loop(result)]
        ids = result.snapshot.keyframe_ids
        edges = np.array([[ids[0], ids[-1]]], np.int64)
        result.snapshot = replace(result.snapshot, loop_edges=edges)
    folder.mkdir(parents=True, exist_ok=True)
    evaluation = evaluate_run(result)
    writer = OutputWriter(folder)
    writer.write_all(result, make_report(result, evaluation), evaluation)
    assert writer.problems == []
    return folder


def result_of(sequence: MadeUpSequence, states: str, maps: str, noise: float) -> RunResult:
    generator = np.random.default_rng(len(states))
    path = sequence.true_path()
    T_wc = path.T_wc.copy()
    T_wc[:, :3, 3] += noise * generator.normal(size=(len(path), 3))
    result = RunResult(
        sequence,
        sequence.settings,
        RunOptions(sequence.sensor),
        len(path),
        started="2026-01-02T03:04:05+00:00",
    )
    for k, row in enumerate(rows_of(states)):
        record = row.record
        if record is not None:
            is_ok = states[k] in "kw"
            record = replace(
                record,
                map_index=int(maps[k]),
                T_cw=np.linalg.inv(T_wc[k]) if is_ok else None,
                n_inliers=int(generator.integers(50, 300)) if is_ok else 0,
                is_keyframe=is_ok and k % 5 == 0,
                milliseconds=dict(zip(STAGES, generator.uniform(1, 9, len(STAGES)), strict=True)),
            )
        result.rows.append(replace(row, record=record))
    for number in range(max(map(int, maps), default=0) + 1):
        chosen = np.array([states[k] in "kw" and int(maps[k]) == number for k in range(len(maps))])
        which = np.flatnonzero(chosen)
        result.trajectories.append(
            Trajectory(path.timestamps[which], T_wc[which], indices=which.astype(np.int64))
        )
    result.main_map = len(result.trajectories) - 1
    last = result.trajectories[-1]
    result.keyframes = last.select(last.indices % 5 == 0)
    ids = np.arange(len(result.keyframes))
    points = generator.normal(size=(50 if len(ids) else 0, 3)) * [2, 0.5, 2]
    result.snapshot = MapSnapshot(
        ids, result.keyframes.timestamps, result.keyframes.T_wc,
        np.arange(len(points)), points, np.zeros((0, 2), np.int64),
    )  # fmt: skip
    result.sightings = np.array(
        [(p, k) for k in ids for p in range(len(points))], np.int64
    ).reshape(-1, 2)
    result.stages = {
        "track": {"median": 5.0, "mean": 5.5, "p99": 9.0, "count": len(maps)},
        "mapping": {"median": 90.0, "mean": 95.0, "p99": 190.0, "count": 8},
    }
    result.seconds = result.slam_seconds = 2.0
    return result


def _loop(result: RunResult) -> LoopClosed:
    first, last = result.keyframes.timestamps[[0, -1]].tolist()
    n = len(result.keyframes)
    values = {
        "map_index": len(result.trajectories) - 1,
        "matched_keyframe": 0, "current_keyframe": n - 1,
        "matched_timestamp": first, "current_timestamp": last,
        "n_inliers": 40, "n_matches": 60, "n_fused": 12, "scale": 1.0, "S_cm": np.eye(4),
        "translation": 0.05, "rotation_deg": 0.4, "milliseconds": {"total": 12.0},
    }  # fmt: skip
    return LoopClosed(**values)
