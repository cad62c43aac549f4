# SPDX-License-Identifier: BSD-3-Clause
"""Layouts of further data sets, recognised by their files, and those of other packages."""

from orbslam2py.datasets.layouts.bonn import BonnSequence
from orbslam2py.datasets.layouts.icl_nuim import IclNuimSequence
from orbslam2py.datasets.layouts.kitti_raw import KittiRawSequence
from orbslam2py.datasets.layouts.loaders import ENTRY_POINTS, Loader, find_loaders, loader_of
from orbslam2py.datasets.layouts.openloris import OpenLorisSequence
from orbslam2py.datasets.layouts.replica import ReplicaSequence
from orbslam2py.datasets.layouts.seven_scenes import SevenScenesSequence

__all__ = [
    "ENTRY_POINTS",
    "BonnSequence",
    "IclNuimSequence",
    "KittiRawSequence",
    "Loader",
    "OpenLorisSequence",
    "ReplicaSequence",
    "SevenScenesSequence",
    "find_loaders",
    "loader_of",
]
