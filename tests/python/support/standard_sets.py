# SPDX-License-Identifier: BSD-3-Clause
"""Small roots in the layouts of the standard data sets."""

from __future__ import annotations

from pathlib import Path

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

#: Where the archives of each data set put a sequence, and what it has images for.
PLACES = {
    "tum": ("rgbd_dataset_freiburg1_desk", "rgbd"),
    "kitti": ("dataset/sequences/06", "stereo"),
    "euroc": ("machine_hall/MH_01_easy", "stereo"),
}


def make_root(folder: Path, kind: str, frames: int = 20) -> Path:
    """Write a sequence of a data set where its archives have it; returns the root."""
    place, sensor = PLACES[kind]
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=frames, size=(320, 240))
    path = folder / place
    path.parent.mkdir(parents=True, exist_ok=True)
    SyntheticSequence(options).write(path, kind)
    return folder
