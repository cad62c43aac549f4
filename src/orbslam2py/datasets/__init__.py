# SPDX-License-Identifier: BSD-3-Clause
"""Images: TUM RGB-D, KITTI odometry, EuRoC, bags, folders of images, videos."""

from __future__ import annotations

import importlib
from typing import Any

from orbslam2py.datasets.bags import BagSequence
from orbslam2py.datasets.base import (
    Frame,
    FrameTimes,
    Images,
    IterableSequence,
    Layout,
    LiveFrame,
    LiveSource,
    Sequence,
    Source,
)
from orbslam2py.datasets.depth_folders import DepthFolders
from orbslam2py.datasets.euroc import EurocSequence
from orbslam2py.datasets.frames import FramesInOrder
from orbslam2py.datasets.gopro import read_gopro_imu
from orbslam2py.datasets.image_folder import ImageFolder
from orbslam2py.datasets.imu import ImuSamples, imu_of, imu_settings_of
from orbslam2py.datasets.imu_csv import AccelUnit, GyroUnit, read_imu_csv
from orbslam2py.datasets.imu_streams import read_imu_streams
from orbslam2py.datasets.kitti import KittiSequence
from orbslam2py.datasets.layouts import (
    BonnSequence,
    IclNuimSequence,
    KittiRawSequence,
    Loader,
    OpenLorisSequence,
    ReplicaSequence,
    SevenScenesSequence,
)
from orbslam2py.datasets.masks import MaskedCamera, MaskedSequence
from orbslam2py.datasets.recognise import is_recording, open_sequence, recognise
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.datasets.recorded_input import open_recorded
from orbslam2py.datasets.stereo_folders import StereoFolders
from orbslam2py.datasets.tum import TumSequence
from orbslam2py.datasets.video import VideoReader, VideoSequence

__all__ = [
    "AccelUnit",
    "BagSequence",
    "BonnSequence",
    "DepthFolders",
    "EurocSequence",
    "Frame",
    "FrameTimes",
    "FramesInOrder",
    "GyroUnit",
    "IclNuimSequence",
    "ImageFolder",
    "Images",
    "ImuSamples",
    "IterableSequence",
    "KittiRawSequence",
    "KittiSequence",
    "Layout",
    "LiveFrame",
    "LiveSource",
    "Loader",
    "MaskedCamera",
    "MaskedSequence",
    "OpenLorisSequence",
    "RecordedSequence",
    "ReplicaSequence",
    "Sequence",
    "SevenScenesSequence",
    "Source",
    "StereoFolders",
    "TumSequence",
    "VideoReader",
    "VideoSequence",
    "imu_of",
    "imu_settings_of",
    "is_recording",
    "open_recorded",
    "open_sequence",
    "read_gopro_imu",
    "read_imu_csv",
    "read_imu_streams",
    "recognise",
]

#: Names of this room that moved to `orbslam2py.live`, and what they are called there.
_MOVED = {"LiveCamera": "LiveCamera", "open_input": "open_source"}


def __getattr__(name: str) -> Any:
    """Give the names that moved: what opens cameras is a room above this one."""
    if name in _MOVED:
        return getattr(importlib.import_module("orbslam2py.live"), _MOVED[name])
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
