# SPDX-License-Identifier: BSD-3-Clause
"""ORB-SLAM2 for Python people.

Feed images of a stereo pair or an RGB-D camera, get the camera's path and a map:

>>> import orbslam2py
>>> with orbslam2py.System("tum1", "rgbd") as slam:  # doctest: +SKIP
...     for image, depth, timestamp in camera:
...         record = slam.track_rgbd(image, depth, timestamp)

Poses are named by frames: ``T_cw`` maps world to camera, ``T_wc`` camera to world. Cameras look
along +z, x points right, y down. Lengths are metres, times seconds, angles radians.
"""

from importlib.metadata import version as _version

from orbslam2py.errors import (
    DatasetError,
    ImageError,
    MapFileError,
    OrbSlamError,
    SettingsError,
    StateError,
    VocabularyError,
    WorkerError,
)
from orbslam2py.records import FrameFeatures, Reason, TrackingRecord, TrackingState
from orbslam2py.sensor import Sensor
from orbslam2py.settings import Settings

__version__ = _version("orbslam2py")

__all__ = [
    "DatasetError",
    "FrameFeatures",
    "ImageError",
    "MapFileError",
    "MapSnapshot",
    "OrbSlamError",
    "Reason",
    "Sensor",
    "Settings",
    "SettingsError",
    "StateError",
    "System",
    "TrackingRecord",
    "TrackingState",
    "Trajectory",
    "VocabularyError",
    "WorkerError",
    "__version__",
    "load_vocabulary",
    "open_sequence",
]


def __getattr__(name: str) -> object:
    # The C++ extension imports orbslam2py.errors while it is being loaded, and the command line
    # should show its help without it: what needs the extension is imported on first use.
    import importlib  # noqa: PLC0415

    modules = {
        "MapSnapshot": "system",
        "System": "system",
        "Trajectory": "trajectory",
        "load_vocabulary": "vocabulary",
        "open_sequence": "datasets",
    }
    if name in modules:
        return getattr(importlib.import_module(f"orbslam2py.{modules[name]}"), name)
    raise AttributeError(f"module 'orbslam2py' has no attribute '{name}'")
