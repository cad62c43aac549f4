# SPDX-License-Identifier: BSD-3-Clause
"""Several maps in one picture: each in its own colour and world."""

from orbslam2py.runs.several_maps.drawn_map import DrawnMap, maps_of_file, maps_of_run
from orbslam2py.runs.several_maps.panels import draw_maps

__all__ = ["DrawnMap", "draw_maps", "maps_of_file", "maps_of_run"]
