# SPDX-License-Identifier: BSD-3-Clause
"""Points of a map as a PLY file (Stanford polygon format)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import atomic_write

_FRAME = "camera frame of keyframe 0: x right, y down, z forward"


def write_ply(
    path: str | Path,
    points: FloatArray,
    *,
    colours: ByteArray | None = None,
    unit: str = "m",
    frame: str = _FRAME,
) -> None:
    """Write points as a binary PLY file that common viewers open.

    Parameters
    ----------
    path
        The file; replaced only when everything was written.
    points
        Positions (p, 3) in the frame of keyframe 0's camera; written as float32.
    colours
        Red, green and blue of every point, uint8 (p, 3); none are written if None.
    unit
        Of the positions, for the comment in the file: metres, or ``units`` for one camera, whose
        unit of length is its own.
    frame
        What the axes are, for the comment in the file.

    Raises
    ------
    OSError
        If the file cannot be written; an existing file is kept then.
    ValueError
        If there is not one colour per point.
    """
    fields = [(name, "<f4") for name in "xyz"]
    if colours is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue")]
        if len(colours) != len(points):
            raise ValueError(f"{len(points)} points, but {len(colours)} colours")
    vertices = np.zeros(len(points), fields)
    for column, name in enumerate("xyz"):
        vertices[name] = points[:, column]
    if colours is not None:
        for column, name in enumerate(("red", "green", "blue")):
            vertices[name] = colours[:, column]
    words = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {words[kind]} {name}\n" for name, kind in fields)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {frame} [{unit}]\n"
        f"element vertex {len(points)}\n{properties}end_header\n"
    )
    with atomic_write(path, binary=True) as stream:
        stream.write(header.encode())
        stream.write(vertices.tobytes())
