# SPDX-License-Identifier: BSD-3-Clause
"""ORB-SLAM2 for Python people.

Feed images of one camera, a stereo pair or an RGB-D camera, get the camera's path and a map:

>>> import orbslam2py
>>> with orbslam2py.System("tum1", "rgbd") as slam:  # doctest: +SKIP
...     for image, depth, timestamp in camera:
...         record = slam.track_rgbd(image, depth, timestamp)

Poses are named by frames: ``T_cw`` maps world to camera, ``T_wc`` camera to world. Cameras look
along +z, x points right, y down. Lengths are metres, times seconds, angles radians. One
camera alone cannot see metres: its unit of length is the median depth of the first view.
"""

from typing import TYPE_CHECKING

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

if TYPE_CHECKING:
    from orbslam2py.datasets import open_sequence
    from orbslam2py.events import (
        Callbacks,
        KeyframeAdded,
        LoopClosed,
        MapChangeCause,
        MapChanged,
        Relocalized,
        TrackingLost,
    )
    from orbslam2py.full_adjustment import FullAdjustmentRecord
    from orbslam2py.map_views import MapSnapshot
    from orbslam2py.records import FrameFeatures, Reason, TrackingRecord, TrackingState
    from orbslam2py.sensor import Sensor
    from orbslam2py.settings import Settings
    from orbslam2py.system import System
    from orbslam2py.trajectory import Trajectory
    from orbslam2py.vocabulary import load_vocabulary

    __version__: str

__all__ = [
    "Callbacks",
    "DatasetError",
    "FrameFeatures",
    "FullAdjustmentRecord",
    "ImageError",
    "KeyframeAdded",
    "LoopClosed",
    "MapChangeCause",
    "MapChanged",
    "MapFileError",
    "MapSnapshot",
    "OrbSlamError",
    "Reason",
    "Relocalized",
    "Sensor",
    "Settings",
    "SettingsError",
    "StateError",
    "System",
    "TrackingLost",
    "TrackingRecord",
    "TrackingState",
    "Trajectory",
    "VocabularyError",
    "WorkerError",
    "__version__",
    "load_vocabulary",
    "open_sequence",
]


_MODULES = {
    "Callbacks": "events",
    "FrameFeatures": "records",
    "FullAdjustmentRecord": "full_adjustment",
    "KeyframeAdded": "events",
    "LoopClosed": "events",
    "MapChangeCause": "events",
    "MapChanged": "events",
    "MapSnapshot": "map_views",
    "Reason": "records",
    "Relocalized": "events",
    "Sensor": "sensor",
    "Settings": "settings",
    "System": "system",
    "TrackingLost": "events",
    "TrackingRecord": "records",
    "TrackingState": "records",
    "Trajectory": "trajectory",
    "load_vocabulary": "vocabulary",
    "open_sequence": "datasets",
}


def __getattr__(name: str) -> object:
    # The C++ extension imports orbslam2py.errors while it is being loaded, and the command line
    # wants to be in charge before libraries are loaded: everything else comes on first use.
    import importlib  # noqa: PLC0415

    if name == "__version__":
        import importlib.metadata  # noqa: PLC0415

        return importlib.metadata.version("orbslam2py")
    if name in _MODULES:
        return getattr(importlib.import_module(f"orbslam2py.{_MODULES[name]}"), name)
    raise AttributeError(f"module 'orbslam2py' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
