# SPDX-License-Identifier: BSD-3-Clause
"""Localization mode: poses in a fixed map.

Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-F;
``docs/method/tracking.md#localization-mode``.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable

from orbslam2py import _core as core
from orbslam2py._worker import PauseTicket, Worker

_log = logging.getLogger(__name__)


class LocalizationSwitch:
    """Pauses the workers in localization mode.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    min_keyframes : int
        Number of keyframes at which a map has begun; with fewer, mapping continues until then.
    workers : iterable of Worker
        Pause in localization mode; waiting keyframes are processed afterwards.
    """

    def __init__(
        self, slam_map: core.Map, min_keyframes: int, workers: Iterable[Worker[int]]
    ) -> None:
        self._map = slam_map
        self._min_keyframes = min_keyframes
        self._workers = tuple(workers)
        self._tickets: list[PauseTicket] = []
        #: The mode that the next image will be tracked in; the last assignment counts.
        self.wanted = False
        #: The mode in force.
        self.on = False

    @property
    def _n_keyframes(self) -> int:
        return int(self._map.n_active_keyframes)

    def apply(self) -> None:
        """Carry out the switch, between two frames."""
        wanted = self.wanted and self._n_keyframes >= self._min_keyframes
        if wanted == self.on:
            return
        if wanted:
            self._hold()
        else:
            self.release()
        self.on = wanted
        _log.info("localization mode %s", "on" if wanted else "off")

    def _hold(self) -> None:
        self._tickets = [worker.pause() for worker in self._workers]
        try:
            for ticket in self._tickets:
                ticket.wait()
        except BaseException:
            # A Ctrl-C: the mode is not in force, and the next image tries again.
            self.release()
            raise

    def release(self) -> None:
        """Resume the workers; they process the waiting keyframes."""
        for ticket in self._tickets:
            ticket.release()
        self._tickets = []
