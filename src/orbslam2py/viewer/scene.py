# SPDX-License-Identifier: BSD-3-Clause
"""The three-dimensional part of the page: nodes of viser that show a `MapModel`.

Changes are sent page by page; the parent node hides all elements of a layer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _palette as palette
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py._palette import Colour
from orbslam2py.viewer.frusta import CORNERS, FACES, frusta, nearest_to_ray, orientations
from orbslam2py.viewer.map_model import MapModel, Stale
from orbslam2py.viewer.point_colours import PointColours

if TYPE_CHECKING:
    import viser

#: What can be seen, and what a person calls it; those that are hidden at first are in `HIDDEN`.
LAYERS = {
    "points": "Map points",
    "local": "Points of the local map",
    "keyframes": "Keyframes",
    "covisibility": "Covisibility",
    "tree": "Spanning tree",
    "loops": "Loop edges",
    "camera": "Camera",
    "path": "Path",
    "online": "Path as first tracked",
    "truth": "Ground truth",
}
HIDDEN = frozenset({"tree", "online"})

#: Half the width of a keyframe's frustum, as a part of the distance to what is seen.
_SIZE = 0.03
#: That size stays until the fitting one differs by so much: all keyframes are drawn anew then.
_SIZE_TOLERANCE = 1.6
#: Diameter of a point at size 1, in those sizes.
_POINT = 0.15
#: Of the sight of a camera that is not known better [rad].
_FOV = 0.9


@dataclass
class Selection:
    """A keyframe that a user has clicked, and its neighbours."""

    keyframe: int
    neighbours: IntArray
    """(n,) ids."""


class Scene:
    """Draws a map, a camera and its paths.

    Use it in one thread at a time.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    model : MapModel
        The map.
    colours : PointColours
        Of its points.
    on_click : callable
        Called with the id of a clicked keyframe.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        model: MapModel,
        colours: PointColours,
        on_click: Callable[[int], None],
    ) -> None:
        self._scene = server.scene
        self._model = model
        self._colours = colours
        self._on_click = on_click
        self._nodes: dict[str, Any] = {}
        self.point_size = 1.0
        #: Half the width of a keyframe's frustum, in the unit of the map.
        self.size = 0.0
        self.fov = _FOV
        #: Of keyframes: that of the map, if there are several.
        self.keyframe_colour: Colour = palette.KEYFRAME
        self._switched_on = {name for name in LAYERS if name not in HIDDEN}
        self._is_shown = True
        self._scene.set_up_direction("-y")  # that of the first camera
        self._scene.configure_environment_map(None)  # nothing here mirrors, and it takes a while
        self._scene.configure_default_lights(enabled=True, cast_shadow=False)
        self._layers = {
            name: self._scene.add_frame(f"/{name}", show_axes=False, visible=name not in HIDDEN)
            for name in LAYERS
        }
        self._selection = self._scene.add_frame("/selection", show_axes=False)

    def show(self, layer: str, visible: bool) -> None:
        """Show or hide a layer."""
        (self._switched_on.add if visible else self._switched_on.discard)(layer)
        self._layers[layer].visible = visible and self._is_shown

    def show_map(self, visible: bool) -> None:
        """Show or hide the map with all of its layers."""
        self._is_shown = visible
        for name, layer in self._layers.items():
            layer.visible = visible and name in self._switched_on
        self._selection.visible = visible

    def set_keyframe_colour(self, colour: Colour) -> bool:
        """Set the colour of keyframes; return whether all of them must be drawn again."""
        if colour == self.keyframe_colour:
            return False
        self.keyframe_colour = colour
        for name in [name for name in self._nodes if name.startswith("/keyframes/")]:
            self._remove(name)
        return True

    def clear(self) -> None:
        """Remove all but the layers themselves."""
        for node in self._nodes.values():
            node.remove()
        self._nodes = {}

    # ---- the map ---------------------------------------------------------------------------------
    def draw(self, stale: Stale) -> None:
        """Draw the changes of the map."""
        if stale.everything:
            self.clear()
        for number in sorted(stale.points):
            self.draw_points(number)
        for number in sorted(stale.keyframes):
            self._draw_keyframes(number)
        for number in sorted(stale.covisibility):
            edges = self._model.edges_in_page(self._model.covisibility, number)
            self._lines(f"/covisibility/{number}", edges, palette.COVISIBILITY, 1.0)
        for number in sorted(stale.tree):
            edges = self._model.edges_in_page(self._model.spanning_tree, number)
            self._lines(f"/tree/{number}", edges, palette.SPANNING_TREE, 1.5)
        if stale.loops:
            rows = self._model.rows_of(self._model.loop_edges)
            ends = self._model.keyframe_T_wc[rows][:, :, :3, 3]
            self._lines("/loops/all", ends, palette.LOOP, 3.0)

    def draw_points(self, number: int) -> None:
        """Draw a page of points."""
        name = f"/points/{number}"
        page = self._model.points.get(number)
        if page is None or not len(page.ids):
            self._remove(name)
            return
        self._cloud(name, page.positions, self._colours.of_page(number), self.point_diameter)

    def set_point_size(self, factor: float) -> None:
        """Draw points larger or smaller than usual."""
        self.point_size = factor
        for name, node in self._nodes.items():
            if name.startswith("/points/"):
                node.point_size = self.point_diameter

    @property
    def point_diameter(self) -> float:
        """In the unit of the map."""
        return max(1e-6, _POINT * self.size * self.point_size)

    def fit_size(self, distance: float) -> bool:
        """Adapt the sizes of cameras and points to the distance of the view.

        Returns
        -------
        bool
            Whether to draw everything again.
        """
        fitting = _SIZE * distance
        if fitting <= 0 or (self.size / _SIZE_TOLERANCE <= fitting <= self.size * _SIZE_TOLERANCE):
            return False
        self.size = fitting
        self.set_point_size(self.point_size)
        return True

    def draw_local(self, ids: IntArray) -> None:
        """Draw the points of the local map."""
        positions = self._model.positions_of(ids)
        if not len(positions):
            self._remove("/local/points")
            return
        colour = np.array(palette.LOCAL_POINTS, np.uint8)
        self._cloud("/local/points", positions, colour, 1.35 * self.point_diameter)

    def _draw_keyframes(self, number: int) -> None:
        rows = self._model.rows_in_page(number)
        T_wc = self._model.keyframe_T_wc[rows]
        lines, bodies = f"/keyframes/lines{number}", f"/keyframes/bodies{number}"
        self._lines(lines, frusta(T_wc, self.size), self.keyframe_colour, 1.5)
        if not len(T_wc):
            self._remove(bodies)
            return
        node = self._scene.add_batched_meshes_simple(
            bodies,
            vertices=(self.size * CORNERS).astype(np.float32),
            faces=FACES,
            batched_wxyzs=orientations(T_wc),
            batched_positions=T_wc[:, :3, 3],
            batched_colors=self.keyframe_colour,
            opacity=0.18,
            side="double",
            flat_shading=True,
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

        def clicked(event: viser.SceneNodePointerEvent[Any]) -> None:
            row = nearest_to_ray(
                self._model.keyframe_T_wc[:, :3, 3],
                np.array(event.ray_origin),
                np.array(event.ray_direction),
            )
            if row is not None:
                self._on_click(int(self._model.keyframe_ids[row]))

        node.on_click(clicked)
        self._nodes[bodies] = node

    # ---- the camera ------------------------------------------------------------------------------
    def draw_camera(self, T_wc: FloatArray | None, image: ByteArray | None, aspect: float) -> None:
        """Draw the present camera with its image; nothing if its pose is unknown."""
        if T_wc is None:
            self._remove("/camera/now")
            return
        wxyz, position = orientations(T_wc[None])[0], T_wc[:3, 3]
        node = self._nodes.get("/camera/now")
        if node is not None and node.aspect == aspect:
            node.wxyz, node.position, node.scale = wxyz, position, 2.6 * self.size
            if image is not None:
                node.image = image
            return
        self._nodes["/camera/now"] = self._scene.add_camera_frustum(
            "/camera/now",
            fov=self.fov,
            aspect=aspect,
            scale=2.6 * self.size,
            thickness=2.5,
            thickness_units="screen",
            color=palette.CAMERA,
            image=image,
            format="jpeg",
            wxyz=wxyz,
            position=position,
            cast_shadow=False,
            receive_shadow=False,
        )

    def draw_path(self, layer: str, lines: FloatArray) -> None:
        """Draw one of the paths: ``path``, ``online`` or ``truth``, (s, 2, 3)."""
        colour, width = {
            "path": (palette.PATH, 2.5),
            "online": (palette.ONLINE_PATH, 1.5),
            "truth": (palette.TRUTH, 3.5),
        }[layer]
        self._lines(f"/{layer}/all", lines, colour, width)

    def draw_selection(self, selection: Selection | None) -> None:
        """Mark a keyframe, with lines to its neighbours."""
        model = self._model
        row = np.zeros(0, np.int64)
        if selection is not None:
            row = np.flatnonzero(model.keyframe_ids == selection.keyframe)
        if selection is None or not len(row):
            self._remove("/selection/keyframe")
            self._remove("/selection/neighbours")
            return
        T_wc = model.keyframe_T_wc[row]
        self._lines("/selection/keyframe", frusta(T_wc, 1.3 * self.size), palette.NOW, 3.0)
        pairs = np.column_stack(
            [np.full_like(selection.neighbours, selection.keyframe), selection.neighbours]
        )
        ends = model.keyframe_T_wc[model.rows_of(pairs)][:, :, :3, 3]
        self._lines("/selection/neighbours", ends, palette.NOW, 1.5)

    # ---- nodes -----------------------------------------------------------------------------------
    def _cloud(
        self,
        name: str,
        positions: npt.NDArray[np.floating],
        colours: ByteArray,
        size: float,
    ) -> None:
        known = self._nodes.get(name)
        if known is not None:  # a new node takes several times as long
            known.points = np.asarray(positions, np.float32)
            known.colors = colours
            known.point_size = size
            return
        self._nodes[name] = self._scene.add_point_cloud(
            name,
            positions,
            colours,
            point_size=size,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _lines(self, name: str, ends: FloatArray, colour: Colour, width: float) -> None:
        if not len(ends):
            self._remove(name)
            return
        known = self._nodes.get(name)
        if known is not None:
            known.points = ends.astype(np.float32)
            return
        self._nodes[name] = self._scene.add_line_segments(
            name,
            ends.astype(np.float32),
            np.array(colour, np.uint8),
            thickness=width,
            thickness_units="screen",
        )

    def _remove(self, name: str) -> None:
        node = self._nodes.pop(name, None)
        if node is not None:
            node.remove()
