# SPDX-License-Identifier: BSD-3-Clause
"""Settings for one's own camera: from a chessboard, or from other programs' files."""

from orbslam2py.calibration.calibration import Calibration, calibrate
from orbslam2py.calibration.camera_files import CameraFileFormat, read_camera_file
from orbslam2py.calibration.chessboard import Board, BoardView, BoardViews, choose_views, find_views

__all__ = [
    "Board",
    "BoardView",
    "BoardViews",
    "Calibration",
    "CameraFileFormat",
    "calibrate",
    "choose_views",
    "find_views",
    "read_camera_file",
]
