# SPDX-License-Identifier: BSD-3-Clause
"""Inactive maps for watchers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from orbslam2py import _core as core
from orbslam2py.maps.changes import MapChanges
from orbslam2py.viewer.level_map import LevelMapFollower


@dataclass(frozen=True, eq=False)
class RestingMaps:
    """The inactive maps, and their changes since the last notification.

    Each map has a separate world: positions in two of them are not related.
    """

    active: int
    """Number of the active map, as in `TrackingRecord.map_index`."""
    there: tuple[int, ...]
    """Numbers of the inactive maps, ascending. A map that was reported before and is missing here
    is now active, merged, or dropped."""
    changes: tuple[MapChanges, ...]
    """Changes of each changed map; the first for a map contains all of it."""


@runtime_checkable
class RestingMapsWatcher(Protocol):
    """A watcher that also gets the inactive maps; others see only the active one."""

    def on_resting_maps(self, maps: RestingMaps) -> None:
        """Called when the set of inactive maps or one of them has changed."""
        ...


class RestingMapsFollower:
    """Returns the changes of inactive maps.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The maps; other threads may change them.
    """

    def __init__(self, slam_map: core.Map) -> None:
        self._map = slam_map
        self._epoch = slam_map.epoch
        self._followers: dict[int, LevelMapFollower] = {}
        self._told: tuple[int, tuple[int, ...]] = (int(slam_map.active_map), ())

    def update(self) -> RestingMaps | None:
        """Look at them.

        Returns
        -------
        RestingMaps or None
            The changes; None if there are none, and as long as there is only one map.
        """
        active, numbers = int(self._map.active_map), self._map.maps
        there = tuple(int(number) for number in numbers if number != active)
        if not there and not self._followers:
            self._told = active, ()
            return None
        if self._map.epoch != self._epoch:
            self._epoch, self._followers = self._map.epoch, {}
        self._followers = {
            number: self._followers.get(number) or LevelMapFollower(self._map, map_index=number)
            for number in there
        }
        changes = [follower.update() for follower in self._followers.values()]
        changes = [one for one in changes if one]
        if not changes and self._told == (active, there):
            return None
        self._told = active, there
        return RestingMaps(active, there, tuple(changes))
