# SPDX-License-Identifier: BSD-3-Clause
"""The map from above, as a picture. It uses plain arrays, and does not depend on a running system.

Right is x, up is z of the world: the first camera looks towards the top of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._palette import (
    CAMERA,
    COVISIBILITY,
    FAINT_TEXT,
    HALO,
    KEYFRAME,
    LOOP,
    LOST,
    MAPPED,
    PANEL,
    PATH,
    POINTS,
    TEXT,
    TRUTH,
    Colour,
)
from orbslam2py.pictures.framing import Framing
from orbslam2py.pictures.lettering import draw_text, text_width

_SHIFT = 4
#: Most points that are used for the bounding box.
_SAMPLE = 4000
#: From this number of keyframes on, they are drawn smaller.
_MANY_KEYFRAMES = 150
#: From this number of edges on, they are drawn without smoothing.
_MANY_EDGES = 2000
#: Camera seen from above: its place, then the ends of what it sees, ahead is up.
_WEDGE = np.array([(0.0, 0.0), (-0.62, 1.0), (0.62, 1.0)])


def _no_places() -> FloatArray:
    return np.zeros((0, 3))


def _no_edges() -> FloatArray:
    return np.zeros((0, 2, 3))


def _no_gaps() -> npt.NDArray[np.bool_]:
    return np.zeros(0, bool)


@dataclass(frozen=True)
class MapPicture:
    """The contents of the picture, in world coordinates [m] (one camera: the map's own units)."""

    points: npt.NDArray[np.floating] = field(default_factory=_no_places)
    """(p, 3) map points."""
    local_points: npt.NDArray[np.floating] = field(default_factory=_no_places)
    """(l, 3) the points around the camera, highlighted."""
    keyframes: npt.NDArray[np.floating] = field(default_factory=lambda: np.zeros((0, 4, 4)))
    """(k, 4, 4) camera to world."""
    covisibility: npt.NDArray[np.floating] = field(default_factory=_no_edges)
    """(e, 2, 3) both ends of every edge."""
    loop_edges: npt.NDArray[np.floating] = field(default_factory=_no_edges)
    """(c, 2, 3) both ends of every edge."""
    path: FloatArray = field(default_factory=_no_places)
    """(n, 3) camera positions so far."""
    path_gaps: npt.NDArray[np.bool_] = field(default_factory=_no_gaps)
    """(n,) whether the trajectory is interrupted before each; empty: nowhere."""
    truth: FloatArray = field(default_factory=_no_places)
    """(t, 3) true path, aligned."""


def bounds(picture: MapPicture) -> tuple[FloatArray, FloatArray]:
    """Return the box (low, high) of the visible part: the trajectory, and the points around it.

    Points that are too far away do not count, because the trajectory would become a dot.
    """
    cameras = [picture.path, picture.keyframes[:, :3, 3], picture.truth]
    places = np.concatenate([each[:, [0, 2]] for each in cameras])
    if not len(places):
        return np.array([-1.0, -0.5]), np.array([1.0, 1.5])
    low, high = places.min(axis=0), places.max(axis=0)
    if len(picture.points):
        step = max(1, len(picture.points) // _SAMPLE)
        near, far = np.quantile(picture.points[::step, [0, 2]], [0.04, 0.96], axis=0)
        middle = 0.5 * (low + high)
        distances = np.linalg.norm(picture.points[::step, [0, 2]] - middle, axis=1)
        room = 0.4 * float((high - low).max()) + 0.9 * float(np.median(distances))
        low = np.minimum(low, np.maximum(near, low - room))
        high = np.maximum(high, np.minimum(far, high + room))
    return low, high


def draw_top_view(
    scene: MapPicture,
    framing: Framing,
    *,
    T_wc: FloatArray | None = None,
    lost: bool = False,
    unit: str = "m",
    text: int = 14,
    ground: ByteArray | None = None,
) -> ByteArray:
    """Draw the map from above.

    Parameters
    ----------
    scene : MapPicture
        The recorded history.
    framing : Framing
        The visible part of the map, and its scale.
    T_wc : array of float64, (4, 4), optional
        Position of the camera, or its last position before the loss.
    lost : bool
        The present position of the camera is unknown.
    unit : str
        Unit of length, for the scale bar.
    text : int
        Height of the letters [px]; lines and marks grow with it.
    ground : array of uint8, (h, w, 3), optional
        The earlier result of `draw_ground`, with the same framing; it is not changed.

    Returns
    -------
    array of uint8, (h, w, 3)
        Red, green, blue.
    """
    size = text / 14.0
    thin = max(1, round(size))
    picture = draw_ground(scene, framing, text=text) if ground is None else ground.copy()
    _light_up(picture, scene.local_points, framing)
    _draw_path(picture, scene.path, scene.path_gaps, framing, PATH, thin + 1)
    loops = _edge_pixels(scene.loop_edges, framing)
    _lines(picture, loops, LOOP, 2 * thin)
    _lines(picture, loops.reshape(-1, 1, 2), LOOP, round(6 * size), closed=True)
    if T_wc is not None:
        _draw_camera(picture, T_wc, framing, size, lost=lost)
    if not len(scene.keyframes) and not len(scene.path):
        middle = (picture.shape[1] // 2, picture.shape[0] // 2)
        draw_text(picture, "no map yet", middle, text, FAINT_TEXT, anchor="centre")
        return picture
    _draw_scale_bar(picture, framing, unit, text)
    _draw_legend(picture, scene, text)
    return picture


def draw_ground(scene: MapPicture, framing: Framing, *, text: int = 14) -> ByteArray:
    """Draw the background: points, covisibility, ground truth and keyframes.

    It takes the most time, and changes little from image to image.
    """
    size = text / 14.0
    thin = max(1, round(size))
    picture = _draw_points(scene.points, framing)
    # Thousands of thin lines: smooth ones take five times as long.
    edges = _edge_pixels(scene.covisibility, framing)
    _lines(picture, edges, COVISIBILITY, thin, smooth=len(edges) < _MANY_EDGES)
    # Wider than the path above it, which hides it where the estimate is right.
    _draw_path(picture, scene.truth, None, framing, TRUTH, 6 * thin)
    _draw_keyframes(picture, scene.keyframes, framing, size)
    return picture


def nice_length(at_most: float) -> float:
    """Largest of 1, 2, 5, 10, 20 ... (and 0.5, 0.2 ...) that is not above a length."""
    power = 10.0 ** np.floor(np.log10(at_most))
    return float(max(factor * power for factor in (1, 2, 5) if factor * power <= at_most * 1.0001))


# ---- layers --------------------------------------------------------------------------------------
def _draw_points(points: npt.NDArray[np.floating], framing: Framing) -> ByteArray:
    """Draw the background: the density of points."""
    density = _density(points, framing)
    # A single point can be seen, and thousands on a pixel do not outshine the rest.
    return np.asarray(cv2.LUT(cv2.merge([density] * 3), _POINT_COLOURS), np.uint8)


def _light_up(picture: ByteArray, points: npt.NDArray[np.floating], framing: Framing) -> None:
    """Draw the points of the local map over the others."""
    density = _density(points, framing)
    where = np.nonzero(density)
    cover = _COVER[density[where]][:, None]
    picture[where] = picture[where] * (1 - cover) + np.array(MAPPED) * cover


def _density(points: npt.NDArray[np.floating], framing: Framing) -> ByteArray:
    """Return points per pixel, slightly blurred, in 1 / `_PER_POINT`, (h, w)."""
    width, height = framing.size
    pixels = np.rint(framing.to_pixels(points[:, [0, 2]]))
    seen = ((pixels >= 0) & (pixels < (width, height))).all(axis=1)
    x, y = pixels[seen].astype(np.intp).T
    counts = np.bincount(y * width + x, minlength=width * height).reshape(height, width)
    levels = (np.minimum(counts, 255 // _PER_POINT) * _PER_POINT).astype(np.uint8)
    return np.asarray(cv2.GaussianBlur(levels, (3, 3), 0.7), np.uint8)


#: Levels of density for each point on a pixel, and how much of the ground each level covers.
_PER_POINT = 20
_COVER = np.clip(0.2 * np.log2(1.0 + 8.0 * np.arange(256) / _PER_POINT), 0.0, 0.85)
_POINT_COLOURS = np.rint(
    np.array(PANEL) * (1 - _COVER[:, None]) + np.array(POINTS) * _COVER[:, None]
).astype(np.uint8)[None]


def _draw_keyframes(
    picture: ByteArray, T_wc: npt.NDArray[np.floating], framing: Framing, size: float
) -> None:
    many = len(T_wc) > _MANY_KEYFRAMES
    wedges = _wedges(T_wc, framing, (5.0 if many else 8.0) * size)
    smooth = len(T_wc) < _MANY_EDGES
    _lines(picture, wedges, KEYFRAME, max(1, round(size)), closed=True, smooth=smooth)


def _draw_camera(
    picture: ByteArray, T_wc: FloatArray, framing: Framing, size: float, *, lost: bool
) -> None:
    colour = LOST if lost else CAMERA
    wedge = _whole(_wedges(T_wc[None], framing, 20.0 * size))
    thick = max(2, round(2 * size))
    cv2.polylines(picture, list(wedge), True, HALO, thick + 3, cv2.LINE_AA, _SHIFT)
    if not lost:
        inside = picture.copy()
        cv2.fillPoly(inside, list(wedge), colour, cv2.LINE_AA, _SHIFT)
        picture[:] = cv2.addWeighted(inside, 0.35, picture, 0.65, 0.0)
    cv2.polylines(picture, list(wedge), True, colour, thick, cv2.LINE_AA, _SHIFT)
    if lost:
        x, y = framing.to_pixels(T_wc[[0, 2], 3])
        place = (round(float(np.clip(x, -999, 9999))), round(float(np.clip(y, -999, 9999))))
        draw_text(
            picture,
            "last seen here",
            (place[0], place[1] + round(16 * size)),
            round(13 * size),
            LOST,
            anchor="centre",
        )


def _draw_path(
    picture: ByteArray,
    positions: FloatArray,
    gaps: npt.NDArray[np.bool_] | None,
    framing: Framing,
    colour: Colour,
    thickness: int,
) -> None:
    if len(positions):
        pixels = framing.to_pixels(positions[:, [0, 2]])
        where = np.flatnonzero(gaps if gaps is not None else ())
        for part in np.split(pixels, where):
            _lines(picture, part[None], colour, thickness)


def _draw_scale_bar(picture: ByteArray, framing: Framing, unit: str, text: int) -> None:
    length = nice_length(0.3 * framing.size[0] * framing.unit_per_pixel)
    pixels = round(length / framing.unit_per_pixel)
    x, y, tick = text, picture.shape[0] - text, text // 3
    corners = np.array([(x, y - tick), (x, y), (x + pixels, y), (x + pixels, y - tick)], np.int32)
    thick = max(1, text // 8)
    cv2.polylines(picture, [corners], False, HALO, thick + 2)
    cv2.polylines(picture, [corners], False, TEXT, thick)
    said = unit.removesuffix("s") if length == 1 else unit
    draw_text(picture, f"{length:g} {said}", (x + text // 3, y - round(0.8 * text)), text, TEXT)


def _draw_legend(picture: ByteArray, scene: MapPicture, text: int) -> None:
    """Draw the legend of the existing lines, in the upper left corner."""
    names = [("keyframes", KEYFRAME), ("covisibility", COVISIBILITY), ("path", PATH)]
    if len(scene.loop_edges):
        names.append(("loops", LOOP))
    if len(scene.truth):
        names.append(("ground truth", TRUTH))
    x, y, letter = text, text, max(10, text - 2)
    for name, colour in names:
        needed = round(1.9 * letter) + text_width(name, letter)
        if x + needed > picture.shape[1] - text and x > text:
            x, y = text, y + round(1.5 * text)
        thick = max(2, text // 5)
        cv2.line(picture, (x, y), (x + letter, y), colour, thick)
        draw_text(picture, name, (x + round(1.4 * letter), y), letter, FAINT_TEXT)
        x += needed + text // 2


# ---- many lines at a time ------------------------------------------------------------------------
def _wedges(T_wc: npt.NDArray[np.floating], framing: Framing, length: float) -> FloatArray:
    """Return cameras from above, (k, 3, 2) pixels, of equal size in the picture."""
    ahead = T_wc[:, [0, 2], 2] * (1.0, -1.0)
    # One that looks up or down has no direction from above: it becomes small, not wild.
    ahead = ahead / np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 0.3)
    across = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    shape = _WEDGE[None] * length
    corners = shape[..., :1] * across[:, None] + shape[..., 1:] * ahead[:, None]
    return np.asarray(framing.to_pixels(T_wc[:, [0, 2], 3])[:, None] + corners)


def _edge_pixels(edges: npt.NDArray[np.floating], framing: Framing) -> FloatArray:
    return framing.to_pixels(edges[..., [0, 2]])


def _whole(pixels: FloatArray) -> npt.NDArray[np.int32]:
    return np.rint(np.clip(pixels, -(2.0**14), 2.0**14) * (1 << _SHIFT)).astype(np.int32)


def _lines(
    picture: ByteArray,
    pixels: FloatArray,
    colour: Colour,
    thickness: int,
    *,
    closed: bool = False,
    smooth: bool = True,
) -> None:
    if len(pixels):
        kind = cv2.LINE_AA if smooth else cv2.LINE_8
        cv2.polylines(picture, list(_whole(pixels)), closed, colour, thickness, kind, _SHIFT)
