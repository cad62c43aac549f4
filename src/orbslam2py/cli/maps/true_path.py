# SPDX-License-Identifier: BSD-3-Clause
"""Ground truth with time stamps, from a file or a sequence."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.datasets import is_recording, open_sequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor
from orbslam2py.trajectory import Trajectory, TrajectoryFormat, read_trajectory


def read_true_path(path: Path, sensor: Sensor) -> Trajectory:
    """Read true poses of the camera.

    Parameters
    ----------
    path
        A file in TUM's format, the folder of a sequence, or a bag.
    sensor
        The sensor that the sequence is opened for.

    Raises
    ------
    DatasetError
        If there are none, if they have no time stamps, or if they are not of the camera.
    """
    if path.is_dir() or is_recording(path):
        truth = open_sequence(path, sensor).ground_truth()
        if truth is None:
            raise DatasetError(
                f"the sequence {path} comes without ground truth; give a file with it instead"
            )
        return truth
    truth, file_format = read_trajectory(path)
    if file_format is TrajectoryFormat.KITTI:
        raise DatasetError(
            f"{path} has no time stamps; give the folder of the sequence, or a file in TUM's format"
        )
    if file_format is TrajectoryFormat.EUROC:
        raise DatasetError(
            f"{path} holds poses of the body, not of the camera; give the folder of the sequence, "
            "which knows where the camera is"
        )
    return truth
