# SPDX-License-Identifier: BSD-3-Clause
"""Points of a map as a PCD file (Point Cloud Library)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from orbslam2py._arguments import array_of, path_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.maps.ply import FIRST_KEYFRAME_AXES, colours_of

_HEADER = """\
# .PCD v0.7 - Point Cloud Data file format
# {comment}
VERSION 0.7
FIELDS {fields}
SIZE {fours}
TYPE {types}
COUNT {ones}
WIDTH {n}
HEIGHT 1
VIEWPOINT 0 0 0 1 0 0 0
POINTS {n}
DATA binary
"""


def write_pcd(
    path: str | Path,
    points: FloatArray,
    *,
    colours: ByteArray | None = None,
    unit: str = "m",
    frame: str = FIRST_KEYFRAME_AXES,
) -> None:
    """Write points as a binary PCD file, version 0.7, an unordered cloud.

    The colour is the field ``rgb`` as the Point Cloud Library packs it: 0x00RRGGBB in the bits of a
    float32 (R. B. Rusu, S. Cousins, "3D is here: Point Cloud Library", ICRA 2011; "The PCD file
    format" in its documentation).

    Parameters
    ----------
    path
        The file; replaced only after everything is written.
    points
        Positions (p, 3) in the frame of keyframe 0's camera; written as float32.
    colours
        Red, green and blue of every point, uint8 (p, 3); no such field if None.
    unit
        Unit of the positions, for the comment in the file.
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
    names = ["x", "y", "z"]
    table = array_of(points, "points", (-1, 3), finite=False).astype("<f4")
    if colours is not None:
        names.append("rgb")
        red, green, blue = colours_of(colours, len(table)).astype("<u4").T
        packed = (red << 16 | green << 8 | blue).astype("<u4").view("<f4")
        table = np.column_stack([table, packed])
    count = len(names)
    header = _HEADER.format(
        comment=f"{frame} [{unit}]",
        fields=" ".join(names),
        fours=" ".join(["4"] * count),
        types=" ".join(["F"] * count),
        ones=" ".join(["1"] * count),
        n=len(table),
    )
    with atomic_write(path, binary=True) as stream:
        stream.write(header.encode())
        stream.write(np.ascontiguousarray(table, "<f4").tobytes())
