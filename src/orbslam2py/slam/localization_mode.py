# SPDX-License-Identifier: BSD-3-Clause
"""Switching between mapping and localization mode."""

from __future__ import annotations

import logging
from collections.abc import Iterable

from orbslam2py import _core as core
from orbslam2py.slam.tracking import Tracking
from orbslam2py.slam.worker import PauseTicket, Worker

_log = logging.getLogger(__name__)


class LocalizationSwitch:
    """Holds the workers still while only poses are wanted.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map.
    min_keyframes : int
        How many keyframes begin a map; with fewer, mapping goes on until it has begun.
    tracking : Tracking
        Is told the mode.
    workers : iterable of Worker
        Stand still in localization mode; what waits for them is processed afterwards.
    """

    def __init__(
        self,
        world: core.Map,
        min_keyframes: int,
        tracking: Tracking,
        workers: Iterable[Worker[int]],
    ) -> None:
        self._map = world
        self._min_keyframes = min_keyframes
        self._tracking = tracking
        self._workers = tuple(workers)
        self._tickets: list[PauseTicket] = []
        #: The mode that the next track call will run in; the last assignment counts.
        self.wanted = False

    def apply(self) -> None:
        """Carry out the switch, between two frames."""
        wanted = self.wanted and self._map.n_keyframes >= self._min_keyframes
        if wanted == self._tracking.localization_only:
            return
        if wanted:
            self._tickets = [worker.pause() for worker in self._workers]
            for ticket in self._tickets:
                ticket.wait()
        else:
            self.release()
        self._tracking.localization_only = wanted
        _log.info("localization mode %s", "on" if wanted else "off")

    def release(self) -> None:
        """Let the workers go on; what waits for them is processed."""
        for ticket in self._tickets:
            ticket.release()
        self._tickets = []
