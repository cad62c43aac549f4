# SPDX-License-Identifier: BSD-3-Clause
"""Modes of webcams, as their drivers tell them; `linux/videodev2.h` describes the structures."""

from __future__ import annotations

import struct

from orbslam2py.live.v4l_modes import read_modes

# Sizes of v4l2_fmtdesc, v4l2_frmsizeenum and v4l2_frmivalenum, and their calls on x86-64 and ARM.
ENUM_FORMATS, ENUM_SIZES, ENUM_STEPS = 0xC0405602, 0xC02C564A, 0xC034564B
PIXELS = {b"YUYV": [(640, 480, (30, 15)), (1280, 720, (10,))], b"MJPG": [(1280, 720, (30,))]}


def driver(number: int, asked: bytes) -> bytes:
    """Answer as a driver does: the structure that was asked for, filled in."""
    index = struct.unpack_from("<I", asked)[0]
    if number == ENUM_FORMATS:
        assert struct.unpack_from("<I", asked, 4)[0] == 1  # images, no metadata
        if index >= len(PIXELS):
            raise OSError(22, "Invalid argument")
        return struct.pack("<3I32s4s4I", index, 1, 0, b"pixels", list(PIXELS)[index], *[0] * 4)
    sizes = PIXELS[asked[4:8]]
    if number == ENUM_SIZES:
        if index >= len(sizes):
            raise OSError(22, "Invalid argument")
        width, height, _ = sizes[index]
        return struct.pack("<I4s9I", index, asked[4:8], 1, width, height, *[0] * 6)
    assert number == ENUM_STEPS
    width, height = struct.unpack_from("<2I", asked, 8)
    rates = next(rates for w, h, rates in sizes if (w, h) == (width, height))
    if index >= len(rates):
        raise OSError(22, "Invalid argument")
    return struct.pack("<I4s3I8I", index, asked[4:8], width, height, 1, 1, rates[index], *[0] * 6)


def test_modes() -> None:
    assert read_modes(driver) == (
        "YUYV 640 x 480, 30, 15 fps",
        "YUYV 1280 x 720, 10 fps",
        "MJPG 1280 x 720, 30 fps",
    )


def test_a_device_of_metadata_has_none() -> None:
    def none(number: int, asked: bytes) -> bytes:
        raise OSError(22, "Invalid argument")

    assert read_modes(none) is None
