# SPDX-License-Identifier: BSD-3-Clause
"""Reading of image files to arrays, with errors that name the file."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray
from orbslam2py._files import kind_of_special, utf8_path
from orbslam2py._sixteen_bits import REMEDY
from orbslam2py.errors import DatasetError, ImageError, OrbSlamError

_PNG, _PNG_END = b"\x89PNG", b"IEND"
_JPEG, _JPEG_END = b"\xff\xd8", b"\xff\xd9"
_SILENT = 0  # OpenCV's LOG_LEVEL_SILENT
_TAIL = 4096  # where the end mark must be; some cameras append a few bytes after it
#: Pixels that OpenCV converts without its pool: it cuts images into parts of 65536.
_PIXELS = 1 << 15


class _Silence:
    """The number of users that silence OpenCV's log, and its level before."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.n = self.level = 0


_silence = _Silence()


@contextlib.contextmanager
def quiet_opencv() -> Iterator[None]:
    """Silence OpenCV's warnings: errors are reported by exceptions.

    The log belongs to the whole process: of overlapping threads, the last one restores its level.
    """
    logging: Any = getattr(cv2.utils, "logging", cv2)  # cv2 4 has its functions itself
    with _silence.lock:
        if _silence.n == 0:
            _silence.level = logging.getLogLevel()
            logging.setLogLevel(_SILENT)
        _silence.n += 1
    try:
        yield
    finally:
        with _silence.lock:
            _silence.n -= 1
            if _silence.n == 0:
                logging.setLogLevel(_silence.level)


def open_video(path: Path, error: type[OrbSlamError] = DatasetError) -> cv2.VideoCapture:
    """Open a video without warnings; the result says whether it worked.

    Parameters
    ----------
    path
        The file.
    error
        Raised if its path is not UTF-8.
    """
    # In the present folder the name alone would do, but FFmpeg takes what stands before a colon
    # for the name of a protocol. An absolute path would need a folder whose own is UTF-8.
    named = utf8_path(path, error)
    with quiet_opencv():
        return cv2.VideoCapture(named if path.is_absolute() else f"./{named}")


#: Makes 8 bits of an image of 16 bits; takes the file as well.
To8Bits = Callable[[NDArray[np.generic], Path], ByteArray]


def read_image(path: Path, *, rgb: bool, to_8_bits: To8Bits | None = None) -> ByteArray:
    """Read a grey or colour image.

    Parameters
    ----------
    path
        An image file of any format OpenCV reads.
    rgb
        Whether the order of colours is RGB (True) or BGR.
    to_8_bits
        Scaling of 16 bits per channel; None if they are refused.

    Returns
    -------
    ByteArray
        (h, w), (h, w, 3) or (h, w, 4).

    Raises
    ------
    DatasetError
        If there is no such file.
    ImageError
        If it is no complete image of 8 bits (or 16, see `to_8_bits`).
    """
    decoded = read_any(path)
    if decoded.dtype == np.uint16 and to_8_bits is not None:
        decoded = to_8_bits(decoded, path)
    if decoded.dtype != np.uint8:
        remedy = f"; {REMEDY}" if decoded.dtype == np.uint16 else ""
        raise ImageError(
            f"{path} has {decoded.dtype} pixels; images must be 8 bits per channel{remedy}"
        )
    image = decoded.astype(np.uint8, copy=False)
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if rgb and image.ndim == 3:
        return _swap_red_and_blue(image)
    return np.ascontiguousarray(image)


def _swap_red_and_blue(image: ByteArray) -> ByteArray:
    """BGR to RGB, with alpha or without.

    Convert few rows at a time, so that OpenCV works in this thread: waiting threads of its pool
    would delay the tracking threads more than they help.
    """
    code = cv2.COLOR_BGR2RGB if image.shape[2] == 3 else cv2.COLOR_BGRA2RGBA
    swapped = np.empty_like(image)
    n_rows = max(1, _PIXELS // image.shape[1])
    for row in range(0, len(image), n_rows):
        part = slice(row, row + n_rows)
        cv2.cvtColor(image[part], code, dst=swapped[part])
    return swapped


def read_depth(path: Path) -> NDArray[np.generic]:
    """Read a depth image unchanged, single channel (h, w), usually uint16.

    Raises
    ------
    DatasetError
        If there is no such file.
    ImageError
        If it is no complete image with one channel.
    """
    depth = read_any(path)
    if depth.ndim == 3 and depth.shape[2] == 1:
        depth = depth[:, :, 0]
    if depth.ndim != 2:
        raise ImageError(f"{path} has {depth.shape[2]} channels; depth images have one")
    return depth


def read_any(path: Path) -> NDArray[np.generic]:
    """Read an image of any depth and number of channels, unconverted.

    Raises
    ------
    DatasetError
        If there is no such file.
    ImageError
        If it is no complete image, or no file: pipes and devices are not opened.
    """
    try:
        _check_regular(path)
        content = path.read_bytes()
    except FileNotFoundError:
        raise DatasetError(f"image {path} is listed but missing") from None
    except OSError as error:
        raise ImageError(f"cannot read image {path}: {error.strerror or error}") from error
    return decode_any(content, path)


def _check_regular(path: Path) -> None:
    """Raise `ImageError` if a path is no file or folder: opening a pipe would wait for a writer."""
    kind = kind_of_special(path)
    if kind is not None:
        raise ImageError(f"image {path} is a {kind}, not a file; replace it, or leave it out")


def decode_any(content: bytes, what: object) -> NDArray[np.generic]:
    """Decode the content of an image file of any depth and number of channels, unchanged.

    Parameters
    ----------
    content
        The bytes of the file.
    what
        Its name for messages.

    Raises
    ------
    ImageError
        If it is no complete image.
    """
    # What cameras and data sets write, in a third of the time.
    plain = core.decode_png(content)
    if plain is not None:
        return np.asarray(plain)
    # Some versions of OpenCV fill the rest of a truncated image with grey, without an error.
    for begin, end in ((_PNG, _PNG_END), (_JPEG, _JPEG_END)):
        if content.startswith(begin) and end not in content[-_TAIL:]:
            raise ImageError(f"image {what} is truncated ({len(content)} bytes)")
    image = None
    if content:
        try:
            image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error as error:
            raise ImageError(f"cannot decode image {what}: {error}") from error
    if image is None or image.size == 0:
        raise ImageError(
            f"{what} is no readable image ({len(content)} bytes); replace it, or leave it out"
        )
    return np.asarray(image)
