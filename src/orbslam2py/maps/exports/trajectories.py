# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory of the keyframes in the map's world as a file."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from orbslam2py._arguments import instance_of, number_of, path_of
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.trajectory import (
    Trajectory,
    TrajectoryFormat,
    write_euroc,
    write_kitti,
    write_tum,
)

_log = logging.getLogger(__name__)


def keyframe_path(contents: MapContents) -> Trajectory:
    """Return the keyframes' poses in the map's world, in the order of their ids."""
    keyframes = contents_of(contents).keyframes
    return Trajectory(keyframes.timestamps, keyframes.T_wc)


def export_trajectory(
    trajectory: Trajectory, path: str | Path, file_format: TrajectoryFormat | str
) -> None:
    """Write a trajectory in the format of TUM, KITTI or EuRoC.

    Parameters
    ----------
    trajectory
        Poses camera to world, such as `keyframe_path` gives. They are written in the order of their
        time stamps, which merged maps do not have; poses of equal time keep their order, with a
        warning. Lost poses are left out. KITTI's format has no time stamps; it gets one line for
        each remaining pose.
    path
        The file; replaced only after everything is written.
    file_format
        One of `TrajectoryFormat`, or its name.

    Raises
    ------
    DatasetError
        For ``auto``, an unknown format, or an invalid trajectory or path.
    OSError
        If it cannot be written; an existing file is kept then.
    """
    remedy = "an orbslam2py.Trajectory, such as keyframe_path(contents)"
    instance_of(trajectory, Trajectory, "the trajectory", remedy, DatasetError)
    path = path_of(path, "the file of the trajectory")
    kept = trajectory.select(~trajectory.lost)
    order = np.argsort(kept.timestamps, kind="stable")
    kept = Trajectory(kept.timestamps[order], kept.T_wc[order])
    file_format = TrajectoryFormat.of(file_format)
    if file_format is TrajectoryFormat.TUM:
        write_tum(path, kept)
    elif file_format is TrajectoryFormat.KITTI:
        write_kitti(path, kept)
    elif file_format is TrajectoryFormat.EUROC:
        write_euroc(path, kept)
    else:
        raise DatasetError("a file to be written needs a format: tum, kitti or euroc")
    _warn_of_equal_times(path, kept.timestamps)


def _warn_of_equal_times(path: Path, timestamps: FloatArray) -> None:
    counts = np.unique(timestamps, return_counts=True)[1]
    if (counts > 1).any():
        _log.warning(
            "%s has several poses at %s: the map is of runs whose times overlap, and programs that "
            "pair poses by time take one of each",
            path,
            number_of(int((counts > 1).sum()), "time stamp"),
        )
