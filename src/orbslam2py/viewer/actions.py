# SPDX-License-Identifier: BSD-3-Clause
"""Actions of the page's buttons on a system."""

from __future__ import annotations

import logging
import time
from pathlib import Path

from orbslam2py._files import describe_error
from orbslam2py.errors import OrbSlamError
from orbslam2py.slam.system import System

#: Ids of keyframes, and how many points they share with one; None if nobody knows.
Neighbours = list[tuple[int, int | None]]

_log = logging.getLogger(__name__)


class ActionsOnSystem:
    """Performs the user's requests on a system, and returns a message about each.

    Parameters
    ----------
    system : System
        The system.
    folder : Path
        The folder of saved maps.
    """

    def __init__(self, system: System, folder: Path) -> None:
        self._system = system
        self._folder = folder

    def set_localization(self, wanted: bool) -> str | None:
        """Switch localization mode, with the next image."""
        self._system.localization_mode = wanted
        return None

    def reset(self) -> str | None:
        """Begin a new map with the next image."""
        self._system.reset()
        return "A new map begins with the next image."

    def optimize(self) -> str | None:
        """Run full bundle adjustment of the whole map; returns at its end."""
        try:
            record = self._system.optimize()
        except OrbSlamError as error:
            return describe_error(error)
        if not record.used:
            return "The optimization was given up; the map is as it was."
        return f"Optimized: {record.n_keyframes} keyframes, {record.n_points} points."

    def save(self) -> str | None:
        """Write the map to a new file."""
        path = self._folder / time.strftime("map-%Y%m%d-%H%M%S.orbmap")
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._system.save_map(path)
        except (OrbSlamError, OSError) as error:
            return f"The map was not saved: {describe_error(error)}"
        return f"The map is in {path}."

    def neighbours(self, keyframe: int) -> Neighbours:
        """Return keyframes that share points with one, and the numbers of points, largest first."""
        slam_map = self._system.pipeline.back_end.map
        try:
            found = [int(i) for i in slam_map.neighbours(keyframe)]
            weights = [(int(slam_map.weight(keyframe, i)), i) for i in found]
        except (OrbSlamError, KeyError, IndexError, ValueError):
            return []  # it was culled meanwhile
        return [(i, weight) for weight, i in sorted(weights, reverse=True)]
