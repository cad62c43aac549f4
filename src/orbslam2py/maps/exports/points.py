# SPDX-License-Identifier: BSD-3-Clause
"""The map points as a point cloud, PLY or PCD."""

from __future__ import annotations

from pathlib import Path

from orbslam2py._arguments import path_of
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.exports.pcd import write_pcd
from orbslam2py.maps.ply import write_ply
from orbslam2py.maps.units import unit_of


def export_points(contents: MapContents, path: str | Path, file_format: str | None = None) -> None:
    """Write the points in the map's world, with colours if the map has them (`with_colours`).

    Parameters
    ----------
    contents
        The map.
    path
        The file; replaced only after everything is written.
    file_format
        ``ply`` or ``pcd``; by default the suffix of the name.

    Raises
    ------
    MapFileError
        If the format is unknown or missing, or an argument is invalid.
    OSError
        If it cannot be written; an existing file is kept then.
    """
    contents_of(contents)
    path = path_of(path, "the file of points", MapFileError)
    writers = {"ply": write_ply, "pcd": write_pcd}
    wanted = file_format or path.suffix.lower().lstrip(".")
    if wanted not in writers:
        raise MapFileError(f"{path} is no name for points; give one that ends with .ply or .pcd")
    write = writers[wanted]
    points = contents.points.positions
    colours = contents.point_colours()
    write(path, points, colours=colours, unit=unit_of(contents), frame="world of the map")
