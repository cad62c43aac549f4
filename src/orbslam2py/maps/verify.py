# SPDX-License-Identifier: BSD-3-Clause
"""All checks of a map file."""

from __future__ import annotations

import contextlib
import os
import sqlite3
from pathlib import Path

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py.errors import MapFileError
from orbslam2py.maps.map_copies import restore_contents
from orbslam2py.maps.map_reader import load_map
from orbslam2py.maps.map_writer import connect
from orbslam2py.maps.saved_map import SavedMap

_COPY = "the file is damaged, use a copy of it"


def verify_map_file(path: str | os.PathLike[str]) -> SavedMap:
    """Read a map file as `load_map` does, and check what `load_map` does not check.

    `load_map` checks header, tables, checksums, sizes, ids and ranges of numbers. Further checks:
    the pages, indices and foreign keys of the database, the invariants of its map
    (``docs/method/map.md#invariants``), and that its images are images.

    Parameters
    ----------
    path
        The file; it is only read.

    Returns
    -------
    SavedMap
        The contents of the file.

    Raises
    ------
    MapFileError
        The message names the file and the first fault.
    """
    saved = load_map(path, images=True)
    try:
        with contextlib.closing(connect(Path(path), "ro")) as connection:
            (said,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
            broken = connection.execute("PRAGMA foreign_key_check").fetchone()
    except sqlite3.Error as error:
        raise MapFileError(f"{path} cannot be read: {error}; {_COPY}") from error
    if said != "ok":
        raise MapFileError(f"{path}: {said}; {_COPY}")
    if broken is not None:
        table, row, parent, _ = broken
        raise MapFileError(
            f"{path}: row {row} of the table {table} refers to nothing in {parent}; {_COPY}"
        )
    violated = core.check_invariants(restore_contents(saved.contents), require_words=False)
    if violated:
        more = f" (and {len(violated) - 1} more)" if len(violated) > 1 else ""
        raise MapFileError(f"{path}: {violated[0]}{more}; {_COPY}")
    for number, image in saved.images.items():
        if cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_GRAYSCALE) is None:
            raise MapFileError(f"{path}: the image of keyframe {number} is none; {_COPY}")
    return saved
