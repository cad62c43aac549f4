# SPDX-License-Identifier: BSD-3-Clause
"""Settings for one's own camera: from a board, or from other programs' files."""

from orbslam2py.calibration.board_text import parse_board
from orbslam2py.calibration.boards import AprilGrid, BoardCorners, CharucoBoard, Target
from orbslam2py.calibration.calibration import Calibration, calibrate
from orbslam2py.calibration.camera_files import CameraFileFormat, read_camera_file
from orbslam2py.calibration.chessboard import Board, BoardView, BoardViews, choose_views, find_views
from orbslam2py.calibration.rig import RigCalibration, calibrate_rig
from orbslam2py.calibration.rig_files import camchain_text, pair_settings_text
from orbslam2py.calibration.selection import FamilyScore

__all__ = [
    "AprilGrid",
    "Board",
    "BoardCorners",
    "BoardView",
    "BoardViews",
    "Calibration",
    "CameraFileFormat",
    "CharucoBoard",
    "FamilyScore",
    "RigCalibration",
    "Target",
    "calibrate",
    "calibrate_rig",
    "camchain_text",
    "choose_views",
    "find_views",
    "pair_settings_text",
    "parse_board",
    "read_camera_file",
]
