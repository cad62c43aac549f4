# SPDX-License-Identifier: BSD-3-Clause
"""The rows of a map file's tables, and their checksums."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import IntArray
from orbslam2py.maps.content_groups import Covisibility, ImuStates, Keyframes, model_name_of
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.saved_map import Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.schema import (
    FRAMES_PER_ROW,
    IDS_PER_PAGE,
    IN_METRES,
    PATCHES_PER_PAGE,
    TABLES,
    UPRIGHT,
    Blob,
    Table,
)
from orbslam2py.settings.settings import Settings

#: The values of one row in the order of `Table.columns`, without the checksum.
Row = tuple[Any, ...]


def checksum(row: Row) -> int:
    """CRC-32 over the values of a row: for each a letter for its type, its length, its bytes."""
    crc = 0
    for value in row:
        if isinstance(value, int):
            crc = zlib.crc32(b"I" + struct.pack("<q", value), crc)
        elif isinstance(value, float):
            crc = zlib.crc32(b"F" + struct.pack("<d", value), crc)
        elif value is None:
            crc = zlib.crc32(b"N", crc)
        else:
            data = value.encode() if isinstance(value, str) else value
            size = data.nbytes if isinstance(data, np.ndarray) else len(data)
            letter = b"T" if isinstance(value, str) else b"B"
            crc = zlib.crc32(data, zlib.crc32(letter + struct.pack("<q", size), crc))
    return crc


# ---- the tables that say what the map is of ---------------------------------------------------
def settings_rows(
    settings: Settings, vocabulary: VocabularyIdentity, contents: MapContents
) -> Iterator[tuple[str, Row]]:
    """Camera and vocabulary, as (table, row), and which maps are in metres and upright."""
    yaml = settings.to_yaml()
    for begin, roots in (
        (IN_METRES, contents.metric_roots),
        (UPRIGHT, contents.upright_roots),
    ):
        if roots:
            yaml += f"{begin} {' '.join(map(str, roots))}\n"
    yield "settings", (1, str(settings.sensor), yaml)
    yield "vocabulary", (1, vocabulary.name, vocabulary.hash, vocabulary.comment)


def run_rows(number: int, run: Run, *, first_part: int = 0) -> Iterator[tuple[str, Row]]:
    """One row for each run, as (table, row), and its frames from a part on."""
    options = json.dumps(dict(run.options), sort_keys=True)
    yield "runs", (number, run.program, run.started, run.seed, options)
    for part in range(first_part, -(-len(run.frames) // FRAMES_PER_ROW)):
        begin = part * FRAMES_PER_ROW
        which = slice(begin, min(begin + FRAMES_PER_ROW, len(run.frames)))
        yield "frames", (number, part, *_blobs(TABLES["frames"], run.frames, which))


# ---- the map ----------------------------------------------------------------------------------
def map_rows(
    contents: MapContents,
    changed_keyframes: NDArray[np.bool_] | None = None,
    changed_states: NDArray[np.bool_] | None = None,
) -> Iterator[tuple[str, Row]]:
    """All of the map but the keypoints of keyframes, as (table, row).

    Parameters
    ----------
    contents
        The map.
    changed_keyframes
        (k,) mask of the keyframes; all by default.
    changed_states
        (m,) mask of the states of the IMU; all by default.
    """
    if changed_keyframes is None:
        changed_keyframes = np.ones(len(contents.keyframes), bool)
    yield "map", (1, contents.next_keyframe, contents.next_point)
    yield from _camera_rows(contents)
    yield from _keyframe_rows(contents, np.flatnonzero(changed_keyframes))
    yield from _removed_rows(contents)
    points, seen = contents.points, contents.observations
    yield from _page_rows("map_points", points, points.ids)
    yield from _page_rows("observations", seen, seen.point)
    edges = contents.covisibility
    wanted = np.isin(edges.a, contents.keyframes.ids[changed_keyframes])
    edges = Covisibility(edges.a[wanted], edges.b[wanted], edges.weight[wanted])
    for keyframe, which in _groups(edges.a):
        yield "covisibility", (keyframe, *_blobs(TABLES["covisibility"], edges, which))
    for a, b in contents.loop_edges.tolist():
        yield "loop_edges", (a, b)
    states = contents.imu_states
    rows = range(len(states)) if changed_states is None else np.flatnonzero(changed_states)
    yield from _imu_rows(states, rows)
    patches, aligned = contents.patches, contents.aligned
    yield from _page_rows("patches", patches, patches.point, PATCHES_PER_PAGE)
    for keyframe, which in _groups(aligned.keyframe):
        yield "aligned", (keyframe, *_blobs(TABLES["aligned"], aligned, which))
    for number, (factor, measured) in enumerate(contents.alignment_noise.tolist()):
        yield "alignment_noise", (number, factor, int(measured))


def keypoint_rows(
    contents: MapContents, wanted: Iterable[int] | None = None
) -> Iterator[tuple[str, Row]]:
    """Keypoints of keyframes row by row, as (table, row).

    Parameters
    ----------
    contents
        The map.
    wanted
        Rows of the keyframes; all by default.
    """
    keyframes = contents.keyframes
    for row in range(len(keyframes)) if wanted is None else wanted:
        yield "keypoints", (int(keyframes.ids[row]), *_keypoint_blobs(keyframes, row))


def _keypoint_blobs(keyframes: Keyframes, row: int) -> Iterator[Any]:
    which = keyframes.keypoints_of(row)
    blobs = _blobs(TABLES["keypoints"], keyframes, which)
    yield next(blobs)
    for blob, value in zip(TABLES["keypoints"].blobs, blobs, strict=True):
        yield None if blob.sparse and not keyframes.has_colours[row] else value


def all_rows(saved: SavedMap) -> Iterator[tuple[str, Row]]:
    """A whole map file, as (table, row)."""
    yield from settings_rows(saved.settings, saved.vocabulary, saved.contents)
    for number, run in enumerate(saved.runs):
        yield from run_rows(number, run)
    yield from map_rows(saved.contents)
    yield from keypoint_rows(saved.contents)
    for keyframe, jpeg in saved.images.items():
        yield "images", (keyframe, jpeg)


def _camera_rows(contents: MapContents) -> Iterator[tuple[str, Row]]:
    cameras = contents.cameras
    for row in range(len(cameras)):
        numbers = (
            cameras.fx[row],
            cameras.fy[row],
            cameras.cx[row],
            cameras.cy[row],
            *cameras.distortion[row],
            cameras.bf[row],
            cameras.depth_ratio[row],
        )
        yield (
            "cameras",
            (
                row,
                *map(float, numbers),
                int(cameras.width[row]),
                int(cameras.height[row]),
                float(cameras.scale_factor[row]),
                int(cameras.n_levels[row]),
                model_name_of(int(cameras.model[row])),
                cameras.lens[row].astype("<f8").tobytes(),
                cameras.mount[row].astype("<f8").tobytes(),
            ),
        )


def _keyframe_rows(contents: MapContents, rows: IntArray) -> Iterator[tuple[str, Row]]:
    keyframes = contents.keyframes
    poses = np.hstack([keyframes.rotations, keyframes.translations]).astype("<f8")
    for row in rows.tolist():
        keyframe = int(keyframes.ids[row])
        parent = int(keyframes.parent[row])
        yield (
            "keyframes",
            (
                keyframe,
                int(keyframes.frame_ids[row]),
                float(keyframes.timestamps[row]),
                int(keyframes.camera[row]),
                poses[row],
                float(keyframes.scale[row]),
                None if parent < 0 else parent,
                int(keyframes.provisional_parent[row]),
                int(keyframes.processed[row]),
            ),
        )


def _removed_rows(contents: MapContents) -> Iterator[tuple[str, Row]]:
    removed = contents.removed_keyframes
    poses = np.hstack([removed.rotations, removed.translations]).astype("<f8")
    for row, keyframe in enumerate(removed.ids.tolist()):
        scales = float(removed.scale[row]), float(removed.parent_scale[row])
        yield "removed_keyframes", (keyframe, int(removed.parent[row]), poses[row], *scales)


def _imu_rows(states: ImuStates, rows: Iterable[int]) -> Iterator[tuple[str, Row]]:
    velocities, biases = states.velocity.astype("<f8"), states.bias.astype("<f8")
    for row in rows:
        samples = slice(int(states.offsets[row]), int(states.offsets[row + 1]))
        yield (
            "imu_states",
            (
                int(states.ids[row]),
                velocities[row],
                float(states.scale[row]),
                biases[row],
                *_blobs(TABLES["imu_states"], states, samples),
            ),
        )


def _page_rows(
    name: str, group: object, ids: IntArray, ids_each: int = IDS_PER_PAGE
) -> Iterator[tuple[str, Row]]:
    for page, which in _groups(ids // ids_each):
        yield name, (page, *_blobs(TABLES[name], group, which))


def _groups(keys: IntArray) -> Iterator[tuple[int, slice]]:
    """Return the ranges of equal values in ascending keys."""
    if not len(keys):
        return
    begins = np.flatnonzero(np.diff(keys, prepend=keys[0] - 1))
    ends = [*begins[1:].tolist(), len(keys)]
    for begin, end in zip(begins.tolist(), ends, strict=True):
        yield int(keys[begin]), slice(begin, end)


def _blobs(table: Table, group: object, which: slice) -> Iterator[Any]:
    """The count, then the arrays of a row."""
    yield which.stop - which.start
    for blob in table.blobs:
        array: NDArray[Any] = getattr(group, blob.field)
        yield None if blob.optional and not len(array) else _little_endian(array[which], blob)


def _little_endian(array: NDArray[Any], blob: Blob) -> NDArray[Any]:
    return np.ascontiguousarray(array, dtype=blob.dtype)
