# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of images, maps and times from plain arrays, without a running system."""

from orbslam2py.pictures.composition import Composition, compose
from orbslam2py.pictures.framing import Framing, frame_all
from orbslam2py.pictures.lettering import draw_text, text_width
from orbslam2py.pictures.overlay import (
    Marks,
    Status,
    draw_marks,
    draw_overlay,
    draw_status,
    fit_size,
    status_height,
)
from orbslam2py.pictures.time_line import GrowingHistory, History, draw_time_line
from orbslam2py.pictures.top_view import MapPicture, bounds, draw_ground, draw_top_view

__all__ = [
    "Composition",
    "Framing",
    "GrowingHistory",
    "History",
    "MapPicture",
    "Marks",
    "Status",
    "bounds",
    "compose",
    "draw_ground",
    "draw_marks",
    "draw_overlay",
    "draw_status",
    "draw_text",
    "draw_time_line",
    "draw_top_view",
    "fit_size",
    "frame_all",
    "status_height",
    "text_width",
]
