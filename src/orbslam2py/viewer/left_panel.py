# SPDX-License-Identifier: BSD-3-Clause
"""The image side of the page: the image, the state, a selected keyframe."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray
from orbslam2py._palette import HALO, MAPPED, UNMATCHED, VISUAL_ODOMETRY, Colour
from orbslam2py.pictures.album import KeyframePicture
from orbslam2py.pictures.overlay import Marks, Status, draw_marks, fit_size, to_rgb
from orbslam2py.viewer.plots import Plots
from orbslam2py.viewer.watching import FrameView

if TYPE_CHECKING:
    import viser

#: Pictures are sent at most so large [px].
_ROOM = (640, 480)
_QUALITY = 82
_WIDTH = 460

# Shapes of marks, as offsets in pixels.
_X, _Y = (axis.ravel() for axis in np.meshgrid(np.arange(-6, 7), np.arange(-6, 7)))
_OFFSETS = np.column_stack([_X, _Y])
_ACROSS, _AROUND = np.maximum(abs(_X), abs(_Y)), abs(_X) + abs(_Y)
_DOT = _OFFSETS[(_ACROSS == 0) | ((_AROUND == 1) & (_X + _Y > 0))]
_SQUARE = _OFFSETS[(_ACROSS == 4) | (_ACROSS <= 1)]
_SQUARE_RIM = _OFFSETS[(_ACROSS >= 2) & (_ACROSS <= 5)]
_DIAMOND = _OFFSETS[(_AROUND == 5) | (_AROUND == 4)]
_DIAMOND_RIM = _OFFSETS[(_AROUND == 6) | (_AROUND == 3)]


def overlaid(view: FrameView) -> ByteArray:
    """Return the image with its keypoints for sending, red, green, blue.

    It is drawn ten times a second during tracking, by array operations and without anti-aliasing,
    in a tenth of the time of `orbslam2py.pictures.draw_overlay`.
    """
    height, width = view.image.shape[:2]
    size = fit_size((width, height), _ROOM)
    small = cv2.resize(view.image, size, interpolation=cv2.INTER_LINEAR)
    picture = to_rgb(np.asarray(small, np.uint8))
    scale = np.array(size) / (width, height)
    places = np.rint((view.pixels + 0.5) * scale - 0.5).astype(np.int64)
    unmatched = ~view.features.inliers
    _stamp(picture, places[unmatched], _DOT, UNMATCHED)
    for chosen, shape, rim, colour in (
        (view.matched, _SQUARE, _SQUARE_RIM, MAPPED),
        (view.visual_odometry, _DIAMOND, _DIAMOND_RIM, VISUAL_ODOMETRY),
    ):
        # Dark around bright: marks are seen on a white wall and in the night.
        _stamp(picture, places[chosen], rim, HALO)
        _stamp(picture, places[chosen], shape, colour)
    if view.start_lines is not None:
        draw_marks(picture, Marks(start_lines=view.start_lines), scale)
    return picture


def _stamp(
    picture: ByteArray, places: npt.NDArray[np.int64], shape: npt.NDArray[np.int64], colour: Colour
) -> None:
    """Colour the pixels of a shape (s, 2) around each of the positions (n, 2), x and y."""
    height, width = picture.shape[:2]
    columns = (places[:, :1] + shape[:, 0]).ravel()
    rows = (places[:, 1:] + shape[:, 1]).ravel()
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    picture[rows[inside], columns[inside]] = colour


def status_of(view: FrameView, n_keyframes: int, n_points: int, n_dropped: int) -> Status:
    """Return the text of the status line."""
    queue, record = view.queue, view.record
    return Status(
        state=record.state,
        reason=str(record.reason),
        localization=view.localization,
        n_keyframes=n_keyframes,
        n_points=n_points,
        n_matches=int(np.count_nonzero(view.matched)),
        n_visual_odometry=int(np.count_nonzero(view.visual_odometry)),
        frames_per_second=queue.frames_per_second,
        n_dropped=n_dropped,
    )


class LeftPanel:
    """Image, status line, plots and keyframe, docked to the left.

    Parameters
    ----------
    server : viser.ViserServer
        The page.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        gui = server.gui
        panel = gui.add_panel()
        empty = np.full((240, 320, 3), 24, np.uint8)
        with panel.add_tab("Camera"):
            self._image = gui.add_image(empty, format="jpeg", jpeg_quality=_QUALITY)
            self._status = gui.add_html(_status_html(None, ""))
            self.plots = Plots(server)
        with panel.add_tab("Keyframe"):
            self._keyframe_text = gui.add_html(_text("Click a keyframe in the map."))
            self._keyframe_image = gui.add_image(
                empty, format="jpeg", jpeg_quality=_QUALITY, visible=False
            )
        panel.dock_left()
        panel.set_width(_WIDTH)
        panel.expand()  # on a telephone it is a section of the sheet below, closed by itself

    def show_image(self, picture: ByteArray) -> None:
        """Show the camera image, red, green, blue."""
        self._image.image = picture

    def show_status(self, status: Status | None, note: str = "") -> None:
        """Show the state, and one further text."""
        self._status.content = _status_html(status, note)

    def show_keyframe(self, lines: list[str], picture: KeyframePicture | None) -> None:
        """Show the data of a keyframe."""
        self._keyframe_text.content = _text("\n".join(lines))
        self._keyframe_image.visible = picture is not None
        if picture is not None:
            self._keyframe_image.image = picture.image


def thumbnail(picture: ByteArray, width: int = 200) -> ByteArray:
    """A small image, for the image plane of the camera."""
    size = (width, max(1, round(picture.shape[0] * width / picture.shape[1])))
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _status_html(status: Status | None, note: str) -> str:
    if status is None:
        mode, words, numbers, colour = "", "waiting for images", "", (150, 158, 170)
    else:
        mode, words, numbers, colour = status.mode, status.words, status.numbers, status.colour
    style = "padding:0.3em 0.9em 0.1em;font-size:0.85em;line-height:1.5"
    chip = f"border-left:0.4em solid rgb{colour};padding-left:0.6em"
    more = "".join(
        f'<div style="opacity:0.8">{html.escape(line)}</div>' for line in note.splitlines()
    )
    return (
        f'<div style="{style}"><div style="{chip}"><b>{html.escape(mode)}</b> '
        f"{html.escape(words)}</div>"
        f'<div style="opacity:0.8">{html.escape(numbers)}</div>{more}</div>'
    )


def _text(text: str) -> str:
    style = "padding:0.5em 0.9em;font-size:0.85em;line-height:1.5;white-space:pre-wrap"
    return f'<div style="{style}">{html.escape(text)}</div>'
