# SPDX-License-Identifier: BSD-3-Clause
"""A viewer's copy of the map: pages of points, keyframes, edges, and which of them are stale.

A page contains elements with neighbouring ids. Mapping changes new elements, so most pages do not
change; only changed ones are sent to browsers.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.maps.changes import MapChanges

#: Ids of points in a page; a third of them or so are alive.
POINT_IDS = 8192
#: Ids of keyframes in a page, and of edges by the higher of their keyframes.
KEYFRAME_IDS = 128


def _no_ids() -> IntArray:
    return np.zeros(0, np.int64)


def _no_pairs() -> IntArray:
    return np.zeros((0, 2), np.int64)


@dataclass
class PointPage:
    """Points with neighbouring ids."""

    ids: IntArray = field(default_factory=_no_ids)
    """(p,) ascending."""
    positions: npt.NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    """(p, 3) world."""
    observations: npt.NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, np.int32))
    """(p,) see `PointsSet.observation_counts`."""


@dataclass
class Stale:
    """The parts to draw again."""

    everything: bool = False
    """Whether earlier drawings are invalid."""
    points: set[int] = field(default_factory=set)
    """Pages of points."""
    keyframes: set[int] = field(default_factory=set)
    """Pages of keyframes."""
    covisibility: set[int] = field(default_factory=set)
    """Pages of edges."""
    tree: set[int] = field(default_factory=set)
    loops: bool = False


class MapModel:
    """Follows a map by its changes.

    Attributes
    ----------
    points : dict of int to PointPage
        By page.
    keyframe_ids : array (k,)
        Ascending.
    keyframe_T_wc : array (k, 4, 4)
        Camera to world.
    keyframe_timestamps : array (k,)
        Seconds.
    covisibility, spanning_tree, loop_edges : array (e, 2)
        Pairs of ids of keyframes.
    stale : Stale
        Changes since the owner last emptied it.
    """

    def __init__(self) -> None:
        self.stale = Stale()
        self._clear()

    def _clear(self) -> None:
        self.points: dict[int, PointPage] = {}
        self._colours: dict[int, tuple[ByteArray, npt.NDArray[np.bool_]]] = {}
        self.keyframe_ids = _no_ids()
        self.keyframe_T_wc: FloatArray = np.zeros((0, 4, 4))
        self.keyframe_timestamps: FloatArray = np.zeros(0)
        self.covisibility, self.spanning_tree, self.loop_edges = (_no_pairs() for _ in range(3))

    @property
    def n_points(self) -> int:
        """Points in the map."""
        return sum(len(page.ids) for page in self.points.values())

    def take_stale(self) -> Stale:
        """Return the changes since the last call."""
        stale, self.stale = self.stale, Stale()
        return stale

    # ---- changes ---------------------------------------------------------------------------------
    def apply(self, changes: MapChanges) -> None:
        """Update the model."""
        if changes.restarted:
            self._clear()
            self.stale = Stale(everything=True)
        self._apply_points(changes)
        moved = self._apply_keyframes(changes)
        self._apply_edges(changes, moved)

    def _apply_points(self, changes: MapChanges) -> None:
        new, removed = changes.points_set, changes.points_removed
        pages_new, pages_removed = new.ids // POINT_IDS, removed // POINT_IDS
        for number in np.union1d(pages_new, pages_removed).tolist():
            page = self.points.get(number, PointPage())
            here = slice(*np.searchsorted(pages_new, [number, number + 1]))
            gone = slice(*np.searchsorted(pages_removed, [number, number + 1]))
            ids = new.ids[here]
            kept = ~np.isin(page.ids, np.concatenate([removed[gone], ids]))
            merged = np.concatenate([page.ids[kept], ids])
            order = np.argsort(merged, kind="stable")
            positions = new.positions[here].astype(np.float32)
            counts = new.observation_counts[here].astype(np.int32)
            self.points[number] = PointPage(
                merged[order],
                np.concatenate([page.positions[kept], positions])[order],
                np.concatenate([page.observations[kept], counts])[order],
            )
            self.stale.points.add(number)

    def _apply_keyframes(self, changes: MapChanges) -> IntArray:
        """Return the ids of new, moved or removed keyframes."""
        new, removed = changes.keyframes_set, changes.keyframes_removed
        changed = np.union1d(new.ids, removed)
        if len(changed):
            kept = ~np.isin(self.keyframe_ids, changed)
            ids = np.concatenate([self.keyframe_ids[kept], new.ids])
            order = np.argsort(ids, kind="stable")
            self.keyframe_ids = ids[order]
            self.keyframe_T_wc = np.concatenate([self.keyframe_T_wc[kept], new.T_wc])[order]
            times = np.concatenate([self.keyframe_timestamps[kept], new.timestamps])
            self.keyframe_timestamps = times[order]
            self.stale.keyframes.update(np.unique(changed // KEYFRAME_IDS).tolist())
        return changed

    def _apply_edges(self, changes: MapChanges, moved: IntArray) -> None:
        self.stale.covisibility |= _stale_pages(self.covisibility, changes.covisibility, moved)
        self.stale.tree |= _stale_pages(self.spanning_tree, changes.spanning_tree, moved)
        loops_moved = bool(np.isin(self.loop_edges, moved).any())
        self.stale.loops |= changes.loop_edges is not None or loops_moved
        if changes.covisibility is not None:
            self.covisibility = changes.covisibility
        if changes.spanning_tree is not None:
            self.spanning_tree = changes.spanning_tree
        if changes.loop_edges is not None:
            self.loop_edges = changes.loop_edges

    # ---- colours of the scene --------------------------------------------------------------------
    def colour_points(self, ids: IntArray, colours: ByteArray) -> set[int]:
        """Store the image colours (n, 3) of points; the first one is kept.

        Returns
        -------
        set of int
            Pages of points without earlier colours.
        """
        changed: set[int] = set()
        for number in np.unique(ids // POINT_IDS).tolist():
            if number not in self._colours:
                empty = np.zeros((POINT_IDS, 3), np.uint8), np.zeros(POINT_IDS, np.bool_)
                self._colours[number] = empty
            table, known = self._colours[number]
            here = ids // POINT_IDS == number
            rows = ids[here] % POINT_IDS
            fresh = ~known[rows]
            if fresh.any():
                table[rows[fresh]] = colours[here][fresh]
                known[rows] = True
                changed.add(number)
        return changed

    def colours_of(self, number: int, default: tuple[int, int, int]) -> ByteArray:
        """Return the image colours of the points of a page, (p, 3)."""
        ids = self.points[number].ids
        colours = np.empty((len(ids), 3), np.uint8)
        colours[:] = default
        if number in self._colours:
            table, known = self._colours[number]
            rows = ids % POINT_IDS
            colours[known[rows]] = table[rows[known[rows]]]
        return colours

    # ---- questions -------------------------------------------------------------------------------
    def positions_of(self, ids: IntArray) -> npt.NDArray[np.float32]:
        """Return positions (n, 3) of the known ones of the points."""
        found = [np.zeros((0, 3), np.float32)]
        for number in np.unique(ids // POINT_IDS).tolist():
            page = self.points.get(number)
            if page is not None:
                found.append(page.positions[np.isin(page.ids, ids)])
        return np.concatenate(found)

    def rows_of(self, pairs: IntArray) -> IntArray:
        """Return rows (e, 2) of pairs of keyframes, if both are known."""
        if not len(self.keyframe_ids) or not len(pairs):
            return _no_pairs()
        rows = np.searchsorted(self.keyframe_ids, pairs)
        rows = np.minimum(rows, len(self.keyframe_ids) - 1)
        known = (self.keyframe_ids[rows] == pairs).all(axis=1)
        found: IntArray = rows[known]
        return found

    def rows_in_page(self, number: int) -> slice:
        """Return the rows of the keyframes of a page."""
        ends = np.searchsorted(
            self.keyframe_ids, [number * KEYFRAME_IDS, (number + 1) * KEYFRAME_IDS]
        )
        return slice(int(ends[0]), int(ends[1]))

    def edges_in_page(self, pairs: IntArray, number: int) -> FloatArray:
        """Return the ends (e, 2, 3) of the edges of a page, world."""
        rows = self.rows_of(pairs[edge_pages(pairs) == number])
        return np.asarray(self.keyframe_T_wc[rows][:, :, :3, 3])


def edge_pages(pairs: IntArray) -> IntArray:
    """Return the page of an edge."""
    return pairs.max(axis=1) // KEYFRAME_IDS if len(pairs) else _no_ids()


def _stale_pages(before: IntArray, now: IntArray | None, moved: IntArray) -> set[int]:
    stale: set[int] = set()
    if now is not None:
        # Pairs as single numbers: ids are below 2^31.
        old, new = (pairs[:, 0] * (1 << 31) + pairs[:, 1] for pairs in (before, now))
        stale |= set(edge_pages(now[~np.isin(new, old)]).tolist())
        stale |= set(edge_pages(before[~np.isin(old, new)]).tolist())
    pairs = before if now is None else now
    if len(moved) and len(pairs):
        stale |= set(edge_pages(pairs[np.isin(pairs, moved).any(axis=1)]).tolist())
    return stale
