# SPDX-License-Identifier: BSD-3-Clause
"""The page: a scene, a panel with the image, switches; shared by all browsers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py._palette import KEYFRAME, map_colour
from orbslam2py.pictures.album import Album, KeyframePicture
from orbslam2py.viewer.actions import Neighbours
from orbslam2py.viewer.controls import add_view_controls
from orbslam2py.viewer.follow import Follow, Follower, whole_view
from orbslam2py.viewer.left_panel import LeftPanel
from orbslam2py.viewer.map_model import KEYFRAME_IDS, MapModel, Stale
from orbslam2py.viewer.maps_panel import MapLine, MapsPanel
from orbslam2py.viewer.point_colours import ColourBy, PointColours
from orbslam2py.viewer.resting_maps import RestingMaps
from orbslam2py.viewer.resting_scene import RestingScene
from orbslam2py.viewer.scene import Scene, Selection
from orbslam2py.viewer.server import address_of, start_server, stop_server

if TYPE_CHECKING:
    import viser

#: Pages of points that are sent at a time; after a loop all of them are stale.
_PAGES = 24
#: Neighbours of a keyframe that are named.
_NAMED = 12


class Page:
    """The contents of all browsers, from any source.

    Parameters
    ----------
    host : str
        Address of the page.
    port : int, optional
        See `start_server`.
    title : str
        Title of the page.
    on_client : callable
        Called for each new browser, in a separate thread.

    Attributes
    ----------
    lock : threading.RLock
        Lock that must be held for drawing.
    model : MapModel
        The shown map.
    scene, resting, left
        The parts.
    neighbours : callable
        Returns which keyframes share points with one, and how many.
    """

    def __init__(
        self, *, host: str, port: int | None, title: str, on_client: Callable[[], None]
    ) -> None:
        self.server = start_server(host, port)
        self.address = address_of(self.server)
        self.lock = threading.RLock()
        self.model = MapModel()
        self._colours = PointColours(self.model)
        self._follower = Follower()
        self._album = Album()
        self._stale = Stale()
        self._selected: int | None = None
        self._T_wc: FloatArray | None = None
        self._on_client = on_client
        self.neighbours: Callable[[int], Neighbours] = lambda keyframe: []
        gui = self.server.gui
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        gui.set_panel_label(title)
        gui.main_panel.dock_right()
        gui.main_panel.set_width(300)
        self.left = LeftPanel(self.server)
        self.scene = Scene(self.server, self.model, self._colours, self._select)
        self.resting = RestingScene(self.server)
        self._active_map = 0
        self._maps_panel = MapsPanel(self.server, self.show_map)
        add_view_controls(self.server, self)
        self.server.on_client_connect(self._connected)

    @property
    def is_watched(self) -> bool:
        """Return whether a browser shows it."""
        return bool(self.server.get_clients())

    def _connected(self, client: viser.ClientHandle) -> None:
        with self.lock:
            self._on_client()
            if self._T_wc is not None and self._follower.mode is not Follow.FREE:
                self._follower.move(client, self._T_wc, self.scene.size)
            else:
                self.show_all(client)

    def tell(self, title: str, text: str) -> None:
        """Show a message in all browsers, for some seconds."""
        for client in self.server.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=8.0)

    def stop(self) -> None:
        """Close the page; browsers show that the connection is lost."""
        stop_server(self.server)
        with self.lock:
            self._album.close()

    # ---- drawing, with the lock held -------------------------------------------------------------
    def restart(self) -> None:
        """Another map has begun."""
        self._album.clear()
        self._selected = None
        self.scene.draw_selection(None)
        for path in ("path", "online", "truth"):
            self.scene.draw_path(path, np.zeros((0, 2, 3)))

    def take_resting_maps(self, maps: RestingMaps) -> None:
        """Get the inactive maps and their changes."""
        self._active_map = maps.active
        self.resting.apply(maps)
        colour = map_colour(maps.active) if maps.there else KEYFRAME
        if self.scene.set_keyframe_colour(colour):
            self._stale.keyframes |= set((self.model.keyframe_ids // KEYFRAME_IDS).tolist())
        if self._colours.map_colour != colour:
            self._colours.map_colour = colour
            if self._colours.by is ColourBy.MAP:
                self._stale.points |= set(self.model.points)
        self.scene.show_map(self.resting.is_shown(maps.active) or not maps.there)

    def _draw_resting_maps(self, at_most: int | None) -> None:
        sizes = self.resting.sizes
        if sizes:
            self.resting.draw(self.scene.size, self.scene.point_diameter, at_most)
        self.resting.place(self._active_map, self.model)
        lines = [MapLine(number, False, *size) for number, size in sizes.items()]
        own = MapLine(self._active_map, True, len(self.model.keyframe_ids), self.model.n_points)
        self._maps_panel.show(sorted([*lines, own], key=lambda line: line.number))

    def draw_map(self, at_most: int | None = _PAGES) -> None:
        """Draw the changes of the map; large changes in several parts."""
        self._gather_stale()
        if self._colours.update_span():
            self._stale.points |= set(self.model.points)
        late = set(sorted(self._stale.points, reverse=True)[at_most:]) if at_most else set()
        moved = bool(self._stale.keyframes)
        self._stale.points -= late
        with self.server.atomic():
            self.scene.draw(self._stale)
            self._draw_resting_maps(at_most)
            if moved and self._selected is not None:
                self._draw_selected()
        self._stale = Stale(points=late)

    def _gather_stale(self) -> None:
        new = self.model.take_stale()
        if new.everything:
            self._stale = new
            return
        old = self._stale
        self._stale = Stale(
            old.everything,
            old.points | new.points,
            old.keyframes | new.keyframes,
            old.covisibility | new.covisibility,
            old.tree | new.tree,
            old.loops or new.loops,
        )

    def colour_points(self, ids: IntArray, colours: ByteArray) -> None:
        """Store the image colours (n, 3) of points."""
        changed = self.model.colour_points(ids, colours)
        if self._colours.by is ColourBy.IMAGE:
            self._stale.points |= changed & set(self.model.points)

    def fit_size(self, local_points: IntArray, T_wc: FloatArray | None) -> None:
        """Adapt the sizes of cameras and points to the distance of the view."""
        places = self.model.positions_of(local_points)
        if not len(places):  # as in the first image
            pages = self.model.points.values()
            places = np.concatenate([places, *(page.positions for page in pages)])
        if T_wc is None or not len(places):
            return
        distance = float(np.median(np.linalg.norm(places - T_wc[:3, 3], axis=1)))
        if self.scene.fit_size(distance):
            self.resting.resize()
            self._stale.keyframes |= set((self.model.keyframe_ids // KEYFRAME_IDS).tolist())

    def show_camera(self, T_wc: FloatArray | None, image: ByteArray | None, aspect: float) -> None:
        """Show the pose of the camera, and let the views follow."""
        self.scene.draw_camera(T_wc, image, aspect)
        if T_wc is None:
            return
        self._T_wc = T_wc
        self._follower.turn(T_wc)
        self._move_views()

    def keep_keyframe(
        self, keyframe: int, image: ByteArray, n_keypoints: int, n_matched: int
    ) -> None:
        """Store the picture of a keyframe, to be shown after a click."""
        self._album.add(keyframe, KeyframePicture(image, n_keypoints, n_matched))

    # ---- what a person asks for, in threads of the server ----------------------------------------
    def show_layer(self, layer: str, visible: bool) -> None:
        """Show or hide a layer."""
        with self.lock:
            self.scene.show(layer, visible)

    def show_map(self, number: int, visible: bool) -> None:
        """Show or hide one of several maps."""
        with self.lock:
            self.resting.show(number, visible)
            if number == self._active_map:
                self.scene.show_map(visible)
                self.resting.show_label(visible)

    def follow(self, mode: Follow) -> None:
        """Move the views with the camera, or not."""
        with self.lock:
            self._follower.mode = mode
            for client in self.server.get_clients().values():
                if mode is Follow.FREE:
                    client.camera.up_direction = (0.0, -1.0, 0.0)
            self._move_views()

    def set_distance(self, factor: float) -> None:
        """Follow from a larger or smaller distance."""
        with self.lock:
            self._follower.distance = factor
            self._move_views()

    def _move_views(self) -> None:
        if self._T_wc is not None:
            for client in self.server.get_clients().values():
                self._follower.move(client, self._T_wc, self.scene.size)

    def show_all(self, client: viser.ClientHandle) -> None:
        """Show the whole map in a browser."""
        with self.lock:
            places = [page.positions for page in self.model.points.values() if len(page.ids)]
            if not places:
                return
            whole = whole_view(np.concatenate(places).astype(np.float64), self.resting.places())
            _look(client, *whole)

    def look_from(self, eye: FloatArray, target: FloatArray) -> None:
        """Move the view of all browsers to a position, looking at another, and keep it there."""
        with self.lock:
            self._follower.mode = Follow.FREE
            for client in self.server.get_clients().values():
                _look(client, eye, target)

    def set_point_size(self, factor: float) -> None:
        """Draw points larger or smaller."""
        with self.lock:
            self.scene.set_point_size(factor)

    def colour_by(self, what: ColourBy) -> None:
        """Choose the colours of points."""
        with self.lock:
            self._colours.by = what
            self._stale.points |= set(self.model.points)
            self.draw_map(at_most=None)

    def _select(self, keyframe: int) -> None:
        with self.lock:
            self._selected = keyframe
            self._draw_selected()

    def _draw_selected(self) -> None:
        assert self._selected is not None
        keyframe = self._selected
        near = self.neighbours(keyframe)
        ids = np.array([other for other, _ in near], np.int64)
        self.scene.draw_selection(Selection(keyframe, ids))
        picture = self._album.find(keyframe)
        self.left.show_keyframe(self._describe(keyframe, near, picture), picture)

    def _describe(
        self, keyframe: int, near: Neighbours, picture: KeyframePicture | None
    ) -> list[str]:
        row = np.flatnonzero(self.model.keyframe_ids == keyframe)
        if not len(row):
            return [f"Keyframe {keyframe} has been removed: others see the same."]
        seconds = float(self.model.keyframe_timestamps[row[0]])
        lines = [f"Keyframe {keyframe}, taken at {seconds:.3f} s"]
        if picture is not None:
            lines.append(
                f"{picture.n_keypoints} keypoints, {picture.n_matched} matched to the map then"
            )
        if near:
            named = ", ".join(
                f"{other}" if weight is None else f"{other} ({weight})"
                for other, weight in near[:_NAMED]
            )
            more = f" and {len(near) - _NAMED} more" if len(near) > _NAMED else ""
            lines.append(f"Neighbours (points shared): {named}{more}")
        return lines


def _look(client: viser.ClientHandle, eye: FloatArray, target: FloatArray) -> None:
    with client.atomic():
        client.camera.up_direction = (0.0, -1.0, 0.0)
        client.camera.position = eye
        client.camera.look_at = target
