# SPDX-License-Identifier: BSD-3-Clause
"""Name and modes of a webcam, asked of its driver (Video4Linux, ``linux/videodev2.h``)."""

from __future__ import annotations

import contextlib
import os
import struct
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

#: Calls of the driver: read and write a structure of a size, type ``V``, number.
_CAPTURE = 1  # V4L2_BUF_TYPE_VIDEO_CAPTURE
_DISCRETE = 1  # V4L2_FRMSIZE_TYPE_DISCRETE, V4L2_FRMIVAL_TYPE_DISCRETE
_MOST_ENTRIES = 64
_FORMAT = struct.Struct("<III32sI4I")  # v4l2_fmtdesc: index, type, flags, text, pixels, ...
_SIZE = struct.Struct("<III6I2I")  # v4l2_frmsizeenum: index, pixels, type, width, height, ...
_STEP = struct.Struct("<IIIII6I2I")  # v4l2_frmivalenum: index, pixels, width, height, type, ...

#: Makes a call of the driver with a buffer; returns what it wrote.
Call = Callable[[int, bytes], bytes]


def _number(size: int, call: int) -> int:
    return (3 << 30) | (size << 16) | (ord("V") << 8) | call


_ENUM_FORMATS, _ENUM_SIZES, _ENUM_STEPS = (
    _number(_FORMAT.size, 2),
    _number(_SIZE.size, 74),
    _number(_STEP.size, 75),
)


def name_of(number: int) -> str:
    """Return the name of the product; empty if the system does not give it."""
    with contextlib.suppress(OSError):
        path = Path(f"/sys/class/video4linux/video{number}/name")
        return path.read_text(encoding="utf-8", errors="replace").strip()
    return ""


def modes_of(device: Path) -> tuple[str, ...] | None:
    """List pixels, sizes and rates of a camera; None if the device captures no images.

    A device that may not be opened gives an empty list with the reason.
    """
    if sys.platform != "linux":
        return ()
    import fcntl  # noqa: PLC0415  # there is none on Windows

    try:
        handle = os.open(device, os.O_RDWR | os.O_NONBLOCK)
    except OSError as error:
        return (f"its modes cannot be read: {error.strerror}",)
    try:
        return read_modes(lambda number, buffer: fcntl.ioctl(handle, number, buffer))
    finally:
        os.close(handle)


def read_modes(call: Call) -> tuple[str, ...] | None:
    """List modes by the calls of the driver; None if there is no format of images."""
    modes, n_formats = [], 0
    for _, _, _, _, pixels, *_ in _entries(call, _ENUM_FORMATS, _FORMAT, (_CAPTURE,)):
        n_formats += 1
        name = struct.pack("<I", pixels).decode("ascii", "replace").strip()
        for _, _, kind, *size in _entries(call, _ENUM_SIZES, _SIZE, (pixels,)):
            if kind != _DISCRETE:  # least and largest size, with steps
                modes.append(f"{name} {size[0]} x {size[3]} to {size[1]} x {size[4]}")
                break
            width, height = size[0], size[1]
            steps = _entries(call, _ENUM_STEPS, _STEP, (pixels, width, height))
            rates = {
                f"{step[6] / step[5]:.3g}" for step in steps if step[4] == _DISCRETE and step[5]
            }
            shown = ", ".join(sorted(rates, key=float, reverse=True))
            modes.append(f"{name} {width} x {height}" + (f", {shown} fps" if shown else ""))
    return tuple(modes) if n_formats else None


def _entries(
    call: Call, number: int, layout: struct.Struct, what: tuple[int, ...]
) -> Iterator[tuple[int, ...]]:
    """Ask for the entries of a list until the driver has no more."""
    for index in range(_MOST_ENTRIES):
        asked = struct.pack(f"<{1 + len(what)}I", index, *what).ljust(layout.size, b"\0")
        try:
            yield layout.unpack(call(number, asked))
        except OSError:
            return
