# SPDX-License-Identifier: BSD-3-Clause
"""The registry of calibration files: every format of `settings.foreign` with its reader."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from orbslam2py.calibration.foreign_cameras import CalibrationSource, CameraFile
from orbslam2py.calibration.readers.colmap import read_colmap
from orbslam2py.calibration.readers.devices import read_oak, read_zed
from orbslam2py.calibration.readers.fitted import read_aria, read_woodscape
from orbslam2py.calibration.readers.kalibr import read_kalibr
from orbslam2py.calibration.readers.kitti import read_kitti
from orbslam2py.calibration.readers.opencv import read_opencv
from orbslam2py.calibration.readers.realsense import read_realsense
from orbslam2py.calibration.readers.ros import read_camera_info, read_ost
from orbslam2py.calibration.readers.scans import (
    read_nerfstudio,
    read_numbers,
    read_open3d,
    read_polycam,
    read_record3d,
    read_replica,
)
from orbslam2py.calibration.readers.slam_systems import (
    read_basalt,
    read_euroc,
    read_fca,
    read_stella,
    read_vins,
)

Reader = Callable[[CalibrationSource], CameraFile]

#: By the names of `orbslam2py.settings.foreign.FORMATS`, which describes them.
READERS: Mapping[str, Reader] = {
    "kalibr": read_kalibr,
    "vins": read_vins,
    "opencv": read_opencv,
    "ros": read_camera_info,
    "ost": read_ost,
    "colmap": read_colmap,
    "kitti": read_kitti,
    "euroc": read_euroc,
    "stella_vslam": read_stella,
    "zed": read_zed,
    "oak": read_oak,
    "basalt": read_basalt,
    "nerfstudio": read_nerfstudio,
    "open3d": read_open3d,
    "replica": read_replica,
    "record3d": read_record3d,
    "polycam": read_polycam,
    "fca": read_fca,
    "woodscape": read_woodscape,
    "aria": read_aria,
    "realsense": read_realsense,
    "numbers": read_numbers,
}
