# SPDX-License-Identifier: BSD-3-Clause
"""Recorded sequences: TUM RGB-D, KITTI odometry, EuRoC; recognised by their files."""

from orbslam2py.datasets.base import Images, Layout, Sequence
from orbslam2py.datasets.euroc import EurocSequence
from orbslam2py.datasets.kitti import KittiSequence
from orbslam2py.datasets.recognise import open_sequence, recognise
from orbslam2py.datasets.tum import TumSequence

__all__ = [
    "EurocSequence",
    "Images",
    "KittiSequence",
    "Layout",
    "Sequence",
    "TumSequence",
    "open_sequence",
    "recognise",
]
