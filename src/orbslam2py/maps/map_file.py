# SPDX-License-Identifier: BSD-3-Clause
"""Map files: maps that outlive the program. The format: ``docs/reference/map_file.md``."""

from __future__ import annotations

import os

from orbslam2py.errors import MapFileError
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
from orbslam2py.maps.saved_map import SavedMap


def save_map(saved: SavedMap, path: str | os.PathLike[str]) -> None:
    """Write a map file; it appears under its name when all of it has been written.

    Parameters
    ----------
    saved
        The map, and what must be known to use it.
    path
        The file, by custom with the suffix ``.orbmap``; replaced if it exists.

    Raises
    ------
    MapFileError
        If the map has no keyframes, or the file cannot be written; a file that was there is kept.
    """
    if not len(saved.contents.keyframes):
        raise MapFileError(
            f"cannot write {path}: there are no keyframes in the map yet; save it later"
        )
    MapWriter(path, once=True).commit(all_rows(saved))
