# SPDX-License-Identifier: BSD-3-Clause
"""Maps that rest beside the active one, as watchers see them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from orbslam2py import _core as core
from orbslam2py.maps.changes import MapChanges, MapFollower


@dataclass(frozen=True, eq=False)
class RestingMaps:
    """The maps that rest, and what has changed in them since the last notification.

    Each map is a world of its own: positions in two of them have nothing to do with each other.
    """

    active: int
    """Number of the map that is tracked in, as in `TrackingRecord.map_index`."""
    there: tuple[int, ...]
    """Numbers of those that rest, ascending. One that was reported before and is not named here
    is the active one now, or part of another, or no more."""
    changes: tuple[MapChanges, ...]
    """Of those that have changed; in the first for a map, all of it."""


@runtime_checkable
class RestingMapsWatcher(Protocol):
    """A watcher that also gets the maps that rest; others see the active one only."""

    def on_resting_maps(self, maps: RestingMaps) -> None:
        """Other maps rest than at the last call, or one of them has changed."""
        ...


class RestingMapsFollower:
    """Tells what has changed in the maps that rest.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The maps; other threads may change them.
    """

    def __init__(self, slam_map: core.Map) -> None:
        self._map = slam_map
        self._epoch = slam_map.epoch
        self._followers: dict[int, MapFollower] = {}
        self._told: tuple[int, tuple[int, ...]] = (int(slam_map.active_map), ())

    def update(self) -> RestingMaps | None:
        """Look at them.

        Returns
        -------
        RestingMaps or None
            None if nothing has changed; always, as long as there is one map.
        """
        active, numbers = int(self._map.active_map), self._map.maps
        there = tuple(int(number) for number in numbers if number != active)
        if not there and not self._followers:
            self._told = active, ()
            return None
        if self._map.epoch != self._epoch:
            self._epoch, self._followers = self._map.epoch, {}
        self._followers = {
            number: self._followers.get(number) or MapFollower(self._map, map_index=number)
            for number in there
        }
        changes = [follower.update() for follower in self._followers.values()]
        changes = [one for one in changes if one]
        if not changes and self._told == (active, there):
            return None
        self._told = active, there
        return RestingMaps(active, there, tuple(changes))
