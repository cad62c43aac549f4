# SPDX-License-Identifier: BSD-3-Clause
"""The pose of a camera on the body of the ground truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings.opencv_yaml import read_matrix, scan
from orbslam2py.trajectory.rotations import nearest_rotations, poses_from

_WANTED = (
    "give EuRoC's sensor.yaml with T_BS, or a text file with the 3 x 4 or 4 x 4 matrix that maps "
    "the camera's coordinates into the body's"
)
_LAST_ROW = np.array([0.0, 0.0, 0.0, 1.0])


def read_extrinsics(path: Path) -> FloatArray:
    """Read the pose of a camera in its body.

    Parameters
    ----------
    path
        A YAML file with ``T_BS`` as EuRoC has it, or 12 or 16 numbers row by row.

    Returns
    -------
    FloatArray
        ``T_body_camera``, float64 (4, 4), metres.

    Raises
    ------
    DatasetError
        If the file cannot be read or contains no rigid transform.
    """
    T = _from_yaml(path) if path.suffix.lower() in (".yaml", ".yml") else _from_numbers(path)
    R = T[:3, :3]
    is_rotation = np.abs(R @ R.T - np.eye(3)).max() < 1e-3 and np.linalg.det(R) > 0
    if not is_rotation or (len(T) == 4 and (T[3] != _LAST_ROW).any()):
        raise DatasetError(f"{path}: the matrix is no rotation and shift; {_WANTED}")
    T_body_camera: FloatArray = poses_from(nearest_rotations(R[None]), T[None, :3, 3])[0]
    return T_body_camera


def _from_yaml(path: Path) -> FloatArray:
    try:
        document = scan(path.read_text(encoding="utf-8", errors="replace"))
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    if "T_BS" not in document.entries:
        raise DatasetError(f"{path} has no T_BS; {_WANTED}")
    entry = document.entries["T_BS"]
    try:
        T = np.asarray(read_matrix(entry), np.float64)
    except (SettingsError, ValueError) as error:
        raise DatasetError(f"{path}:{entry.line}: {error}; {_WANTED}") from error
    if T.shape not in ((3, 4), (4, 4)) or not np.isfinite(T).all():
        raise DatasetError(f"{path}:{entry.line}: T_BS is no 4 x 4 matrix of numbers; {_WANTED}")
    return T


def _from_numbers(path: Path) -> FloatArray:
    fields = [field for line in content_lines(path) for field in line.fields]
    try:
        numbers = np.array([float(field.strip("[],;")) for field in fields])
    except ValueError:
        numbers = np.zeros(0)
    if numbers.size not in (12, 16) or not np.isfinite(numbers).all():
        raise DatasetError(f"{path} does not hold 12 or 16 numbers; {_WANTED}")
    return numbers.reshape(-1, 4)
