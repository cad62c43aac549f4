# SPDX-License-Identifier: BSD-3-Clause
"""Inactive maps, drawn beside the active one: each in its colour, separated from the others."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._palette import Colour, map_colour
from orbslam2py.viewer.frusta import frusta
from orbslam2py.viewer.map_model import MapModel, Stale
from orbslam2py.viewer.resting_maps import RestingMaps

if TYPE_CHECKING:
    import viser

#: Points of a map whose box is looked for.
_SAMPLE = 4000
#: Room between two maps, and how far one may be from its place until it is moved, in breadths.
_ROOM, _PATIENCE = 0.15, 0.3
#: How dark points are beside keyframes.
_DIM = 0.75


@dataclass(eq=False)
class _Resting:
    """An inactive map, and its drawn parts."""

    frame: Any
    model: MapModel = field(default_factory=MapModel)
    stale: Stale = field(default_factory=Stale)
    offset: FloatArray = field(default_factory=lambda: np.zeros(3))
    nodes: dict[str, Any] = field(default_factory=dict)


class RestingScene:
    """Draws the inactive maps in a row beside the active one.

    Use it in one thread at a time.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._maps: dict[int, _Resting] = {}
        self._hidden: set[int] = set()
        self._label: Any = None

    @property
    def sizes(self) -> dict[int, tuple[int, int]]:
        """Keyframes and points of each map, by its number."""
        return {
            number: (len(one.model.keyframe_ids), one.model.n_points)
            for number, one in self._maps.items()
        }

    def apply(self, maps: RestingMaps) -> None:
        """Apply the changes."""
        for number in set(self._maps) - set(maps.there):
            self._maps.pop(number).frame.remove()  # with all that is below it
        for number in maps.there:
            if number not in self._maps:
                shown = number not in self._hidden
                frame = self._scene.add_frame(_name(number), show_axes=False, visible=shown)
                self._maps[number] = _Resting(frame)
        for changes in maps.changes:
            if changes.map_index in self._maps:
                self._maps[changes.map_index].model.apply(changes)

    def show(self, number: int, visible: bool) -> None:
        """Show or hide a map, also if it becomes inactive later."""
        (self._hidden.discard if visible else self._hidden.add)(number)
        if number in self._maps:
            self._maps[number].frame.visible = visible

    def is_shown(self, number: int) -> bool:
        """Return whether a map is shown."""
        return number not in self._hidden

    def resize(self) -> None:
        """Change the sizes of cameras and points."""
        for one in self._maps.values():
            one.stale.tree.add(0)
            one.stale.points |= set(one.model.points)

    def draw(self, size: float, point_size: float, at_most: int | None) -> None:
        """Draw what has changed.

        Parameters
        ----------
        size
            Half the width of a keyframe's frustum.
        point_size
            Diameter of a point.
        at_most
            Number of pages of points to draw at a time; None: all.
        """
        left = at_most
        for number, one in self._maps.items():
            _gather(one)
            if one.stale.everything:
                for node in one.nodes.values():
                    node.remove()
                one.nodes = {}
            pages = sorted(one.stale.points)[:left]
            for page in pages:
                self._draw_points(number, one, page, point_size)
            if left is not None:
                left -= len(pages)
            if one.stale.keyframes or one.stale.tree or one.stale.everything:
                self._draw_keyframes(number, one, size)
            one.stale = Stale(points=one.stale.points - set(pages))

    def place(self, active: int, model: MapModel) -> None:
        """Put the maps into a row to the right of the active one, with labels."""
        if not self._maps:
            self._remove_label()
            return
        low, high = box_of(model)
        self._say(active, low, high)
        edge = high[0]
        for number in sorted(self._maps):
            one = self._maps[number]
            box = box_of(one.model)
            breadth = max(float((box[1] - box[0]).max()), float((high - low).max()), 1e-6)
            wanted = np.array([edge + _ROOM * breadth - box[0][0], 0.0, 0.0])
            wanted[2] = 0.5 * (low[2] + high[2] - box[0][2] - box[1][2])
            if np.abs(wanted - one.offset).max() > _PATIENCE * breadth or not one.offset.any():
                one.offset = wanted
                one.frame.position = wanted
            edge = float(one.offset[0] + box[1][0])

    def places(self) -> FloatArray:
        """Return the corners (n, 3) of the shown maps at their drawn positions."""
        corners = [np.zeros((0, 3))]
        for number, one in self._maps.items():
            if self.is_shown(number):
                corners.append(np.stack(box_of(one.model)) + one.offset)
        return np.concatenate(corners)

    # ---- nodes -----------------------------------------------------------------------------------
    def _draw_points(self, number: int, one: _Resting, page: int, size: float) -> None:
        name = f"{_name(number)}/points/{page}"
        node, there = one.nodes.pop(name, None), one.model.points.get(page)
        if node is not None:
            node.remove()
        if there is None or not len(there.ids):
            return
        red, green, blue = map_colour(number)
        one.nodes[name] = self._scene.add_point_cloud(
            name,
            there.positions,
            (round(_DIM * red), round(_DIM * green), round(_DIM * blue)),
            point_size=max(1e-6, size),
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _draw_keyframes(self, number: int, one: _Resting, size: float) -> None:
        model, colour = one.model, map_colour(number)
        cameras = frusta(model.keyframe_T_wc, size)
        ends = model.keyframe_T_wc[model.rows_of(model.spanning_tree)][:, :, :3, 3]
        self._lines(one, f"{_name(number)}/keyframes", cameras, colour, 1.5)
        self._lines(one, f"{_name(number)}/tree", ends, colour, 2.0)
        low, high = box_of(model)
        name = f"{_name(number)}/label"
        known = one.nodes.pop(name, None)
        if known is not None:
            known.remove()
        one.nodes[name] = self._scene.add_label(
            name, f"map {number}, rests", position=_above(low, high), anchor="bottom-center"
        )

    def _lines(
        self, one: _Resting, name: str, ends: FloatArray, colour: Colour, width: float
    ) -> None:
        known = one.nodes.pop(name, None)
        if known is not None:
            known.remove()
        if len(ends):
            one.nodes[name] = self._scene.add_line_segments(
                name,
                ends.astype(np.float32),
                np.array(colour, np.uint8),
                thickness=width,
                thickness_units="screen",
            )

    def _say(self, active: int, low: FloatArray, high: FloatArray) -> None:
        text, place = f"map {active}, active", _above(low, high)
        if self._label is not None and self._label.text == text:
            self._label.position = place
            return
        self._remove_label()
        self._label = self._scene.add_label(
            "/active map", text, position=place, anchor="bottom-center"
        )

    def _remove_label(self) -> None:
        if self._label is not None:
            self._label.remove()
        self._label = None

    def show_label(self, visible: bool) -> None:
        """Show or hide the label above the active map."""
        if self._label is not None:
            self._label.visible = visible


def box_of(model: MapModel) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and highest corner (3,) of a map, without distant points."""
    places = [page.positions for page in model.points.values()]
    step = max(1, model.n_points // _SAMPLE)
    points = np.concatenate([np.zeros((0, 3)), *(part[::step] for part in places)])
    cameras = model.keyframe_T_wc[:, :3, 3]
    if not len(points) and not len(cameras):
        return np.zeros(3), np.zeros(3)
    low, high = np.percentile(points if len(points) else cameras, [3, 97], axis=0)
    if len(cameras):
        low, high = np.minimum(low, cameras.min(axis=0)), np.maximum(high, cameras.max(axis=0))
    return low, high


def _gather(one: _Resting) -> None:
    new, old = one.model.take_stale(), one.stale
    if new.everything:
        one.stale = new
        return
    one.stale = Stale(
        old.everything,
        old.points | new.points,
        old.keyframes | new.keyframes,
        old.covisibility,
        old.tree | new.tree,
    )


def _above(low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the middle above a box; y is down."""
    return np.array([0.5 * (low[0] + high[0]), low[1], 0.5 * (low[2] + high[2])])


def _name(number: int) -> str:
    return f"/resting/{number}"
