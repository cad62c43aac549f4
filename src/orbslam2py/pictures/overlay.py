# SPDX-License-Identifier: BSD-3-Clause
"""The image with its keypoints, and a line with the state of the system.

It uses plain arrays, and does not depend on a running system.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray
from orbslam2py._palette import (
    FAINT_TEXT,
    HALO,
    LOST,
    MAPPED,
    NOT_TRACKED,
    PANEL,
    STARTING,
    TEXT,
    UNMATCHED,
    VISUAL_ODOMETRY,
    Colour,
)
from orbslam2py.pictures.lettering import draw_text, text_width
from orbslam2py.slam.records import TrackingState

Pixels = npt.NDArray[np.floating]

#: Pixels are given to OpenCV in parts of 1/16, for lines without steps.
_SHIFT = 4
#: Corners of a square and of a diamond of half width 1.
_SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
_DIAMOND = 1.3 * np.array([(0, -1), (1, 0), (0, 1), (-1, 0)], np.float64)


def _no_keypoints() -> Pixels:
    return np.zeros((0, 2), np.float32)


def _no_lines() -> Pixels:
    return np.zeros((0, 4), np.float32)


@dataclass(frozen=True)
class Marks:
    """Marks in an image, in its pixels; the centre of the first is (0, 0)."""

    mapped: Pixels = field(default_factory=_no_keypoints)
    """(n, 2) keypoints that are matched to the map: squares with a dot."""
    visual_odometry: Pixels = field(default_factory=_no_keypoints)
    """(m, 2) keypoints that are only matched to the frame before: diamonds."""
    unmatched: Pixels = field(default_factory=_no_keypoints)
    """(k, 2) other keypoints: faint dots."""
    start_lines: Pixels = field(default_factory=_no_lines)
    """(s, 4) x, y in the first view, then in the present image, while a single camera starts."""


@dataclass(frozen=True)
class Status:
    """Return the text of the status line."""

    state: TrackingState
    """After the image."""
    reason: str = ""
    """Why there is no pose."""
    localization: bool = False
    """Localization mode: the map is fixed."""
    n_keyframes: int = 0
    """In the map."""
    n_points: int = 0
    """In the map."""
    n_matches: int = 0
    """Keypoints matched to the map."""
    n_visual_odometry: int = 0
    """Keypoints that are only matched to the frame before."""
    frames_per_second: float | None = None
    """Images tracked per second; None to leave it out."""
    n_dropped: int | None = None
    """Number of images that were dropped for lack of time; None if none can be."""
    skipped: bool = False
    """The image could not be used, or there was no time for it; `reason` says which."""

    @property
    def mode(self) -> str:
        """Return the mode: mapping, or localization in a fixed map."""
        return "LOCALIZATION" if self.localization else "SLAM"

    @property
    def words(self) -> str:
        """Return the state in words, and the reason if there is no pose."""
        if self.skipped:
            words = "image not used"
        elif self.state is TrackingState.OK:
            return "tracking by visual odometry" if self._wanders else "tracking"
        elif self.state is TrackingState.LOST:
            words = "track lost, trying to relocalize"
        elif self.state is TrackingState.NOT_INITIALIZED:
            words = "trying to initialize"
        else:
            return "waiting for images"
        return f"{words}: {self.reason}" if self.reason else words

    @property
    def colour(self) -> Colour:
        """Return the colour of the state."""
        return state_colour(self.state, skipped=self.skipped, visual_odometry=self._wanders)

    @property
    def numbers(self) -> str:
        """Sizes and speed."""
        parts = [
            _counted(self.n_keyframes, "keyframe", "keyframes"),
            _counted(self.n_points, "point", "points"),
            _counted(self.n_matches, "match", "matches"),
        ]
        if self.n_visual_odometry:
            parts.append(f"{_thousands(self.n_visual_odometry)} visual odometry")
        if self.frames_per_second is not None:
            parts.append(_counted(round(self.frames_per_second), "frame", "frames") + "/s")
        if self.n_dropped is not None:
            parts.append(f"{_thousands(self.n_dropped)} dropped")
        return "  ·  ".join(parts)

    def __str__(self) -> str:
        return f"{self.mode}  ·  {self.words}  ·  {self.numbers}"

    @property
    def _wanders(self) -> bool:
        """Outside the map, which is possible in localization mode."""
        return self.n_visual_odometry > self.n_matches


def state_colour(
    state: TrackingState, *, skipped: bool = False, visual_odometry: bool = False
) -> Colour:
    """Return the colour of a tracking state, the same in every picture."""
    if skipped:
        return NOT_TRACKED
    if state is TrackingState.OK:
        return VISUAL_ODOMETRY if visual_odometry else MAPPED
    return {TrackingState.LOST: LOST, TrackingState.NOT_INITIALIZED: STARTING}.get(
        state, NOT_TRACKED
    )


def to_rgb(image: ByteArray, *, rgb: bool = True) -> ByteArray:
    """Copy an image as red, green, blue.

    Parameters
    ----------
    image : array of uint8, (h, w), (h, w, 3) or (h, w, 4)
        Grey or colour.
    rgb : bool
        The order of its channels: RGB, or BGR.

    Returns
    -------
    array of uint8, (h, w, 3)
    """
    if image.ndim == 2:
        code = cv2.COLOR_GRAY2RGB
    elif image.shape[2] == 4:
        code = cv2.COLOR_RGBA2RGB if rgb else cv2.COLOR_BGRA2RGB
    elif rgb:
        return np.array(image)
    else:
        code = cv2.COLOR_BGR2RGB
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(image), code), np.uint8)


def fit_size(image_size: tuple[int, int], room: tuple[int, int]) -> tuple[int, int]:
    """Return the largest size with the ratio of an image within a space; at least one pixel.

    Parameters
    ----------
    image_size, room : (int, int)
        Width and height [px].
    """
    scale = min(room[0] / image_size[0], room[1] / image_size[1])
    width, height = (max(1, round(side * scale)) for side in image_size)
    return min(width, room[0]), min(height, room[1])


def draw_overlay(
    image: ByteArray,
    marks: Marks,
    status: Status | None = None,
    *,
    size: tuple[int, int] | None = None,
    rgb: bool = True,
) -> ByteArray:
    """Draw an image with its keypoints and, optionally, its status line below.

    Parameters
    ----------
    image : array of uint8, (h, w), (h, w, 3) or (h, w, 4)
        Grey or colour; it is not changed.
    marks : Marks
        Marks in the image.
    status : Status, optional
        Contents of the status line; None: no line.
    size : (int, int), optional
        Width and height of the image in the picture [px]; by default those of the image.
    rgb : bool
        The order of the image's channels: RGB, or BGR.

    Returns
    -------
    array of uint8, (h, w, 3)
        Red, green, blue; with a status line higher by `status_height`.
    """
    picture = to_rgb(image, rgb=rgb)
    height, width = picture.shape[:2]
    if size is not None and size != (width, height):
        shrink = size[0] < width
        method = cv2.INTER_AREA if shrink else cv2.INTER_CUBIC
        picture = np.asarray(cv2.resize(picture, size, interpolation=method), np.uint8)
    scale = np.array(picture.shape[1::-1]) / (width, height)
    draw_marks(picture, marks, scale)
    if status is None:
        return picture
    return np.vstack([picture, draw_status(picture.shape[1], status)])


def draw_marks(
    picture: ByteArray,
    marks: Marks,
    scale: npt.ArrayLike = (1.0, 1.0),
    *,
    unit: float | None = None,
) -> None:
    """Draw keypoints into a picture.

    Parameters
    ----------
    picture : array of uint8, (h, w, 3)
        Changed.
    marks : Marks
        Pixels in the image before scaling.
    scale : (float, float)
        Pixels of the picture per pixel of the image, along x and y.
    unit : float, optional
        Size of the marks relative to those in a picture 640 pixels wide; by default it grows with
        the picture.
    """
    if unit is None:
        unit = float(np.clip(max(picture.shape[:2]) / 640.0, 0.6, 3.0))
    thin, thick = max(1, round(unit)), max(1, round(unit)) + 2
    lines = _in_picture(marks.start_lines, scale)
    _polylines(picture, lines, HALO, thick)
    _polylines(picture, lines, STARTING, thin)
    _dots(picture, lines[:, 1:], STARTING, 2.0 * unit)
    _dots(picture, _in_picture(marks.unmatched, scale), UNMATCHED, 1.1 * unit)
    for keypoints, shape, colour in (
        (marks.visual_odometry, _DIAMOND, VISUAL_ODOMETRY),
        (marks.mapped, _SQUARE, MAPPED),
    ):
        places = _in_picture(keypoints, scale)
        outlines = places + 3.5 * unit * shape
        # Dark below bright: marks are seen on a white wall and in the night.
        _polylines(picture, outlines, HALO, thick, closed=True)
        _polylines(picture, outlines, colour, thin, closed=True)
        if shape is _SQUARE:
            _dots(picture, places, colour, 1.1 * unit)


def status_height(width: int) -> int:
    """Height of the status line below a picture [px]."""
    return 2 * _status_size(width) + 18


def draw_status(width: int, status: Status) -> ByteArray:
    """Draw the status line: mode, state and reason above, sizes and speed below.

    Parameters
    ----------
    width : int
        Height of the strip [px].
    status : Status
        The text.

    Returns
    -------
    array of uint8, (h, w, 3)
        Red, green, blue.
    """
    size, height = _status_size(width), status_height(width)
    strip = np.empty((height, width, 3), np.uint8)
    strip[:] = PANEL
    upper, lower = round(0.30 * height), round(0.74 * height)
    strip[:, :4] = status.colour
    x = 4 + size // 2
    draw_text(strip, status.mode, (x, upper), size, status.colour, bold=True)
    x += text_width(status.mode, size, bold=True) + size
    room = width - x - size // 2
    draw_text(strip, _shortened(status.words, room, size), (x, upper), size, TEXT)
    numbers = _shortened(status.numbers, width - 4 - size, size)
    draw_text(strip, numbers, (4 + size // 2, lower), size, FAINT_TEXT)
    return strip


def _status_size(width: int) -> int:
    return int(np.clip(round(width / 50), 11, 30))


def _shortened(text: str, room: int, size: int) -> str:
    """The text, shortened at the end if it is too wide."""
    if text_width(text, size) <= room:
        return text
    while text and text_width(text + "…", size) > room:
        text = text[:-1]
    return text.rstrip() + "…"


def _counted(number: int, one: str, many: str) -> str:
    return f"{_thousands(number)} {one if number == 1 else many}"


def _thousands(number: int) -> str:
    return f"{number:,}".replace(",", "\N{THIN SPACE}")


# ---- many marks at a time ------------------------------------------------------------------------
def _in_picture(places: Pixels, scale: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Pixels of the picture, (n, k, 2); each row has one point (2) or the two of a line (4)."""
    rows = np.asarray(places, np.float64)
    split = rows.reshape(len(rows), rows.shape[1] // 2, 2)
    split = split[np.isfinite(split).all(axis=(1, 2))]
    # The centre of the first pixel is (0, 0), however large it has become.
    return np.asarray((split + 0.5) * np.asarray(scale, np.float64) - 0.5)


def _polylines(
    picture: ByteArray,
    corners: npt.NDArray[np.float64],
    colour: Colour,
    thickness: int,
    *,
    closed: bool = False,
) -> None:
    if len(corners):
        limit = 2.0**14  # OpenCV's coordinates end at 2^15
        whole = np.rint(np.clip(corners, -limit, limit) * (1 << _SHIFT)).astype(np.int32)
        cv2.polylines(picture, list(whole), closed, colour, thickness, cv2.LINE_AA, _SHIFT)


def _dots(
    picture: ByteArray, places: npt.NDArray[np.float64], colour: Colour, radius: float
) -> None:
    """Draw a disc at each point (n, 1, 2), as a thick line of length 0 with round ends."""
    _polylines(picture, places, colour, max(2, round(2 * radius)), closed=True)
