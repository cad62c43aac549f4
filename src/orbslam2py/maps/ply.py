# SPDX-License-Identifier: BSD-3-Clause
"""Points of a map as a PLY file (Stanford polygon format)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import array_of
from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write


def write_ply(path: str | Path, points: FloatArray, *, unit: str = "m") -> None:
    """Write points as a binary PLY file that common viewers open.

    Parameters
    ----------
    path
        The file; replaced only when everything was written.
    points
        Positions (p, 3) in the frame of keyframe 0's camera; written as float32.
    unit
        Of the positions, for the comment in the file: metres, or ``units`` for one camera, whose
        unit of length is its own.

    Raises
    ------
    OSError
        If the file cannot be written; an existing file is kept then.
    DatasetError
        If the points are no such array.
    """
    positions = array_of(points, "points", (-1, 3), finite=False)
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment camera frame of keyframe 0: "
        f"x right, y down, z forward [{unit}]\nelement vertex {len(positions)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    with atomic_write(path, binary=True) as stream:
        stream.write(header.encode())
        stream.write(np.ascontiguousarray(positions, dtype="<f4").tobytes())
