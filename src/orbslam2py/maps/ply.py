# SPDX-License-Identifier: BSD-3-Clause
"""Points of a map as a PLY file (Stanford polygon format)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import array_of, path_of, shown
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.errors import DatasetError

#: Names of types in a header, and NumPy's.
_TYPES = {
    **{"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2"},
    **{"ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4"},
    **{"uint32": "<u4", "float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8"},
}

#: Default axes of positions.
FIRST_KEYFRAME_AXES = "camera frame of keyframe 0: x right, y down, z forward"


def write_ply(
    path: str | Path,
    points: FloatArray,
    *,
    colours: ByteArray | None = None,
    unit: str = "m",
    frame: str = FIRST_KEYFRAME_AXES,
) -> None:
    """Write points as a binary PLY file for common viewers.

    Parameters
    ----------
    path
        The file; replaced only after everything is written.
    points
        Positions (p, 3) in the frame of keyframe 0's camera; written as float32.
    colours
        Red, green and blue of every point, uint8 (p, 3); None: no colours.
    unit
        Unit of the positions, for the comment in the file: metres, or ``units`` for one camera,
        whose map has its own unit.
    frame
        Description of the axes, for the comment in the file.

    Raises
    ------
    OSError
        If the file cannot be written; an existing file is kept then.
    DatasetError
        If the arrays are invalid, if the numbers of colours and points differ, or if the path is
        invalid.
    """
    path = path_of(path, "the file of points")
    positions = array_of(points, "points", (-1, 3), finite=False)
    fields = [(name, "<f4") for name in "xyz"]
    if colours is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue")]
        colours = colours_of(colours, len(positions))
    vertices = np.zeros(len(positions), fields)
    for column, name in enumerate("xyz"):
        vertices[name] = positions[:, column]
    if colours is not None:
        for column, name in enumerate(("red", "green", "blue")):
            vertices[name] = colours[:, column]
    words = {"<f4": "float", "u1": "uchar"}
    properties = "".join(f"property {words[kind]} {name}\n" for name, kind in fields)
    header = (
        f"ply\nformat binary_little_endian 1.0\ncomment {frame} [{unit}]\n"
        f"element vertex {len(positions)}\n{properties}end_header\n"
    )
    with atomic_write(path, binary=True) as stream:
        stream.write(header.encode())
        stream.write(vertices.tobytes())


def colours_of(value: Any, n_points: int) -> ByteArray:
    """Check that there is one colour for each point.

    Raises
    ------
    DatasetError
        For anything but uint8 (p, 3): numbers from 0 to 1 would all become black.
    """
    wanted = f"give red, green and blue from 0 to 255, uint8 ({n_points}, 3)"
    if not isinstance(value, np.ndarray):
        raise DatasetError(f"colours is {shown(value)}; {wanted}")
    if value.dtype != np.uint8 or value.shape[1:] != (3,):
        raise DatasetError(f"colours is of {value.dtype} and shape {value.shape}; {wanted}")
    if len(value) != n_points:
        raise DatasetError(f"{n_points} points, but {len(value)} colours; give one per point")
    return value


def read_points(path: str | Path) -> FloatArray:
    """Read the positions of a binary PLY file, of `write_ply` or with more columns.

    Returns
    -------
    FloatArray
        Positions (p, 3).

    Raises
    ------
    DatasetError
        If it is no such file or is incomplete; the message names the file.
    OSError
        If it cannot be read.
    """
    header, _, body = path_of(path, "the file of points").read_bytes().partition(b"end_header\n")
    lines = header.decode("ascii", "replace").splitlines()
    if not lines or lines[0] != "ply" or "format binary_little_endian 1.0" not in lines:
        raise DatasetError(f"{path} is no binary PLY file (little-endian)")
    first = [k for k, line in enumerate(lines) if line.startswith("element ")]
    if not first or not lines[first[0]].startswith("element vertex "):
        raise DatasetError(f"{path} has no points first")
    words = [line.split() for line in lines[first[0] + 1 : [*first, len(lines)][1]]]
    words = [word for word in words if word and word[0] == "property"]
    try:
        count = int(lines[first[0]].split()[2])
        kind = np.dtype([(word[2], _TYPES[word[1]]) for word in words])
        points = np.frombuffer(body, kind, count)
        return np.stack([points[axis].astype(np.float64) for axis in "xyz"], axis=1)
    except (KeyError, IndexError, ValueError) as error:
        raise DatasetError(f"{path} is not whole, or has no positions x, y, z") from error
