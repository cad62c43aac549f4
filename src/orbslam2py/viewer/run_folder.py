# SPDX-License-Identifier: BSD-3-Clause
"""What the folder of a run tells of it."""

from __future__ import annotations

import csv
import json
import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.settings.sensor import Sensor
from orbslam2py.trajectory import Trajectory, read_tum
from orbslam2py.viewer.plots import STAGES

_log = logging.getLogger(__name__)

_FIGURES = ("inliers", "ms_track", *(f"ms_{stage}" for stage in STAGES))


@dataclass(frozen=True, eq=False)
class RunFolder:
    """What is shown of a run, read from its folder."""

    name: str
    sensor: Sensor
    indices: IntArray
    """(n,) number of every image in its sequence."""
    timestamps: FloatArray
    """(n,) seconds."""
    states: list[str]
    reasons: list[str]
    figures: FloatArray
    """(n, 2 + stages) inliers, milliseconds in all and by stage; 0 where there are none."""
    path: Trajectory
    """After the last optimisation; the world is the first keyframe."""
    online: Trajectory
    """As first tracked."""
    map: MapArrays | None

    @classmethod
    def read(cls, folder: Path) -> RunFolder:
        """Read the files of a run.

        Raises
        ------
        DatasetError
            If it is no folder of a run, or a file in it is not whole.
        OSError
            If a file cannot be read.
        """
        if not (folder / "report.json").is_file() or not (folder / "frames.csv").is_file():
            raise DatasetError(
                f"{folder} is no folder of a run: it has no report.json and frames.csv; "
                "give one that orbslam2py run has written"
            )
        try:
            report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
            name, sensor = f"{report['sequence']} ({report['sensor']})", Sensor(report["sensor"])
        except (ValueError, KeyError, TypeError, SettingsError) as error:
            raise DatasetError(f"{folder / 'report.json'} is no report of a run") from error
        rows = _read_frames(folder / "frames.csv")
        if not (folder / "map.npz").is_file():
            _log.warning(
                "no map.npz in %s: only the path is shown; run the sequence again to see its map",
                folder,
            )
        return cls(
            name=name,
            sensor=sensor,
            indices=np.array([int(row["index"]) for row in rows], np.int64),
            timestamps=np.array([float(row["timestamp"]) for row in rows]),
            states=[row["state"] for row in rows],
            reasons=[row["reason"] for row in rows],
            figures=np.array([[_figure(row, key) for key in _FIGURES] for row in rows]),
            path=_read_path(folder / "trajectory.txt"),
            online=_read_path(folder / "trajectory_online.txt"),
            map=MapArrays.load(folder / "map.npz") if (folder / "map.npz").is_file() else None,
        )


def _read_frames(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    if not rows or not {"index", "timestamp", "state", "reason"} <= set(rows[0]):
        raise DatasetError(f"{path} lists no frames; give the folder of a run that saw images")
    return rows


def _figure(row: dict[str, str], key: str) -> float:
    text = row.get(key)
    return float(text) if text else 0.0


def _read_path(path: Path) -> Trajectory:
    if not path.is_file():
        return Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    return read_tum(path)
