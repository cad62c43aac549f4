# SPDX-License-Identifier: BSD-3-Clause
"""Samples of the IMU in videos of GoPro cameras: the track GPMF of an MP4 file.

By the public description of the format, https://github.com/gopro/gpmf-parser, and ISO 14496-12.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.imu import ImuSamples, joined_streams
from orbslam2py.errors import DatasetError

_log = logging.getLogger(__name__)

#: Boxes of an MP4 file that hold other boxes.
_PARENTS = (b"moov", b"trak", b"mdia", b"minf", b"stbl")
#: NumPy's name of the types of GPMF that readings have.
_NUMBERS = {
    b"b": ">i1",
    b"B": ">u1",
    b"s": ">i2",
    b"S": ">u2",
    b"l": ">i4",
    b"L": ">u4",
    b"f": ">f4",
    b"d": ">f8",
    b"j": ">i8",
    b"J": ">u8",
}
_NESTED = 0
#: Bytes of a table of a track, beyond which the file is damaged.
_LARGEST_TABLE = 1 << 26


@dataclass(frozen=True)
class _Payload:
    """One sample of the track: its place in the file and its time [s]."""

    place: int
    size: int
    begin: float
    end: float


def read_gopro_imu(path: str | Path) -> ImuSamples | None:
    """Read the samples of gyro and accelerometer of a GoPro video.

    The times begin with the first image, as those of the images do. Axes are put in the order x, y,
    z if the video contains their order (``ORIN``, since HERO6); else a warning says that they are
    as recorded. The accelerometer is interpolated at the times of the gyro.

    Parameters
    ----------
    path
        An MP4 file.

    Returns
    -------
    ImuSamples or None
        None if the file has no such track, or no gyro and accelerometer in it.

    Raises
    ------
    DatasetError
        If the track is damaged.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            payloads = _payloads(stream)
            streams: dict[bytes, list[FloatArray]] = {b"GYRO": [], b"ACCL": []}
            ordered = True
            for payload in payloads:
                stream.seek(payload.place)
                for name, readings, has_order in _readings(stream.read(payload.size)):
                    # The readings of a payload are spread evenly over its time.
                    share = (np.arange(len(readings)) + 0.5) / max(1, len(readings))
                    t = payload.begin + share * (payload.end - payload.begin)
                    streams[name].append(np.column_stack([t, readings]))
                    ordered &= has_order
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
    except (struct.error, ValueError, IndexError, OverflowError, MemoryError) as error:
        raise DatasetError(
            f"{path}: the track with the samples of the IMU is damaged ({error}); copy the video "
            "from the camera again, or run without the IMU (--no-imu)"
        ) from error
    if not streams[b"GYRO"] or not streams[b"ACCL"]:
        return None
    if not ordered:
        _log.warning(
            "%s does not contain the order of the axes of its IMU; they are used as recorded: "
            "check them with 'orbslam2py check-imu'",
            path,
        )
    gyro, accel = (np.concatenate(streams[name]) for name in (b"GYRO", b"ACCL"))
    return joined_streams(str(path), gyro, accel)


# ---- MP4 -----------------------------------------------------------------------------------------


def _boxes(stream: BinaryIO, begin: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Names of the boxes in a part of the file, and where their contents begin and end."""
    while begin + 8 <= end:
        stream.seek(begin)
        size, name = struct.unpack(">I4s", stream.read(8))
        head = 8
        if size == 1:
            (size,) = struct.unpack(">Q", stream.read(8))
            head = 16
        elif size == 0:
            size = end - begin
        if size < head or begin + size > end:
            return  # what was cut off has no track either
        yield name, begin + head, begin + size
        begin += size


def _tracks(stream: BinaryIO) -> Iterator[dict[bytes, tuple[int, int]]]:
    """Places of the boxes inside each track."""
    length = stream.seek(0, 2)
    for name, begin, end in _boxes(stream, 0, length):
        if name != b"moov":
            continue
        for inner, first, last in _boxes(stream, begin, end):
            if inner == b"trak":
                yield dict(_inside(stream, first, last))


def _inside(stream: BinaryIO, begin: int, end: int) -> Iterator[tuple[bytes, tuple[int, int]]]:
    for name, first, last in _boxes(stream, begin, end):
        if name in _PARENTS:
            yield from _inside(stream, first, last)
        else:
            yield name, (first, last)


def _payloads(stream: BinaryIO) -> list[_Payload]:
    """Samples of the track of the type ``gpmd``; none if there is no such track."""
    for boxes in _tracks(stream):
        if b"stsd" not in boxes or _content(stream, boxes[b"stsd"])[12:16] != b"gpmd":
            continue
        head = _content(stream, boxes[b"mdhd"])
        (scale,) = struct.unpack(">I", head[20:24] if head[0] == 1 else head[12:16])
        sizes = _sizes(_content(stream, boxes[b"stsz"]))
        places = _places(stream, boxes, sizes)
        times = np.cumsum([0, *_durations(_content(stream, boxes[b"stts"]))]) / max(1, scale)
        return [
            _Payload(place, size, begin, end)
            for place, size, begin, end in zip(
                places, sizes, times[:-1].tolist(), times[1:].tolist(), strict=False
            )
        ]
    return []


def _content(stream: BinaryIO, place: tuple[int, int]) -> bytes:
    begin, end = place
    if end - begin > _LARGEST_TABLE:
        raise ValueError(f"a table of {end - begin} bytes")
    stream.seek(begin)
    return stream.read(end - begin)


def _table(content: bytes, columns: int, at: int = 4) -> list[tuple[int, ...]]:
    """Rows of 32-bit numbers after their count."""
    (n,) = struct.unpack_from(">I", content, at)
    width = 4 * columns
    if at + 4 + n * width > len(content):
        raise ValueError(f"a table of {n} rows in {len(content)} bytes")
    return [struct.unpack_from(f">{columns}I", content, at + 4 + k * width) for k in range(n)]


def _sizes(content: bytes) -> list[int]:
    same, n = struct.unpack_from(">II", content, 4)
    if same:
        if n > _LARGEST_TABLE // 4:
            raise ValueError(f"a track of {n} samples")
        return [same] * n
    return [size for (size,) in _table(content, 1, at=8)]


def _durations(content: bytes) -> list[int]:
    rows = _table(content, 2)
    if sum(n for n, _ in rows) > _LARGEST_TABLE // 4:
        raise ValueError("a track of too many samples")
    return [duration for n, duration in rows for _ in range(n)]


def _places(stream: BinaryIO, boxes: dict[bytes, tuple[int, int]], sizes: list[int]) -> list[int]:
    """Place of each sample: chunks hold several of them."""
    if b"co64" in boxes:
        rows = _table(_content(stream, boxes[b"co64"]), 2)
        chunks = [(high << 32) + low for high, low in rows]
    else:
        chunks = [place for (place,) in _table(_content(stream, boxes[b"stco"]), 1)]
    runs = _table(_content(stream, boxes[b"stsc"]), 3)
    firsts = [first for first, _, _ in runs] + [len(chunks) + 1]
    places: list[int] = []
    for (first, n, _), after in zip(runs, firsts[1:], strict=True):
        for chunk in chunks[first - 1 : after - 1]:
            place = chunk
            for _ in range(n):
                if len(places) == len(sizes):
                    return places
                places.append(place)
                place += sizes[len(places) - 1]
    return places


# ---- GPMF ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Item:
    """Key, type, size of a structure, and content of one item."""

    key: bytes
    kind: int
    size: int
    content: bytes


def _items(content: bytes) -> Iterator[_Item]:
    at = 0
    while at + 8 <= len(content):
        key, kind, size, repeat = struct.unpack_from(">4sBBH", content, at)
        length = size * repeat
        if key == b"\0\0\0\0":
            return
        if at + 8 + length > len(content):
            raise ValueError(f"{key!r} is cut off")
        yield _Item(key, kind, size, content[at + 8 : at + 8 + length])
        at += 8 + (length + 3) // 4 * 4


def _readings(content: bytes) -> Iterator[tuple[bytes, FloatArray, bool]]:
    """Gyro [rad/s] and accelerometer [m/s^2] of a payload, (n, 3), and whether axes are named."""
    for device in _items(content):
        if device.key != b"DEVC" or device.kind != _NESTED:
            continue
        for stream in _items(device.content):
            if stream.key != b"STRM" or stream.kind != _NESTED:
                continue
            items = {item.key: item for item in _items(stream.content)}
            for name in (b"GYRO", b"ACCL"):
                if name in items:
                    yield name, *_scaled(items[name], items)


def _scaled(item: _Item, items: dict[bytes, _Item]) -> tuple[FloatArray, bool]:
    values = _numbers(item)
    columns = item.size // np.dtype(_NUMBERS[bytes([item.kind])]).itemsize
    if columns != 3:
        raise ValueError(f"{item.key!r} has {columns} columns")
    readings = values.reshape(-1, 3)
    if b"SCAL" in items:
        readings = readings / _numbers(items[b"SCAL"])
    order = items[b"ORIN"].content.decode("ascii", "replace") if b"ORIN" in items else ""
    if sorted(order.upper()) != ["X", "Y", "Z"]:
        return readings, False
    # A small letter is the negative axis.
    ordered = np.empty_like(readings)
    for column, letter in zip(readings.T, order, strict=True):
        ordered[:, "XYZ".index(letter.upper())] = column if letter.isupper() else -column
    return ordered, True


def _numbers(item: _Item) -> FloatArray:
    kind = bytes([item.kind])
    if kind not in _NUMBERS:
        raise ValueError(f"{item.key!r} has the type {kind!r}")
    return np.frombuffer(item.content, dtype=_NUMBERS[kind]).astype(np.float64)
