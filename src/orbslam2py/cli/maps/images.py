# SPDX-License-Identifier: BSD-3-Clause
"""The sequence of a map, opened for its images."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.datasets import Sequence
from orbslam2py.errors import DatasetError
from orbslam2py.live import open_source
from orbslam2py.maps import SavedMap
from orbslam2py.runs.feeds import is_sequence


def open_images(
    saved: SavedMap, images: str, fps: float | None, times: Path | None, split: bool
) -> Sequence:
    """Open the sequence of ``--images``, with the settings of the map.

    Raises
    ------
    DatasetError
        If it is no recorded sequence.
    """
    sequence = open_source(
        images, saved.sensor, settings=saved.settings, fps=fps, times=times, split=split
    )
    if not is_sequence(sequence):
        raise DatasetError(f"--images {images} is a camera; give its recording")
    return sequence
