# SPDX-License-Identifier: BSD-3-Clause
"""Maps that an IMU has turned upright: they stay so in files and edits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import _core as core
from orbslam2py.maps import (
    MapContents,
    SavedMap,
    crop_saved_map,
    keep_keyframes,
    load_map,
    map_differences,
    restore_contents,
    save_map,
    take_contents,
    transform_map,
)
from orbslam2py.maps.edits.parts import put_together, take_map
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.units import unit_of
from orbslam2py.trajectory import Similarity
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved
from support.saved_maps import edit


def upright(saved: SavedMap) -> SavedMap:
    """The same map, as an IMU has turned it."""
    slam_map = restore_contents(saved.contents)
    slam_map.set_upright(slam_map.maps[0])
    return replace(saved, contents=take_contents(slam_map))


@pytest.fixture
def saved() -> SavedMap:
    return upright(made_up_saved(made_up_map(6, loop=False)))


def turned(angle: float, axis: int) -> Similarity:
    vector = np.zeros(6)
    vector[axis] = angle
    return Similarity(1.0, core.Pose.exp(vector).rotation_matrix, np.array([1.0, 2.0, 3.0]))


def test_one_cameras_upright_map_is_in_metres(saved: SavedMap) -> None:
    assert saved.contents.upright_roots == saved.contents.metric_roots == (0,)
    assert unit_of(saved.contents) == "m"
    depth = upright(made_up_saved(made_up_map(4, depth=True))).contents
    assert (depth.upright_roots, depth.metric_roots) == ((0,), ())


@pytest.mark.parametrize("from_file", [False, True])
def test_files_keep_it(saved: SavedMap, tmp_path: Path, from_file: bool) -> None:
    path = tmp_path / "a.orbmap"
    save_map(saved, path)
    read = load_map(path)
    assert map_differences(saved, read) == []
    assert read.contents.upright_roots == (0,)
    slam_map = core.Map()
    if from_file:
        MapFile(path).restore(slam_map)
    else:
        read.restore(slam_map)
    assert slam_map.is_upright(0)
    assert take_contents(slam_map).upright_roots == (0,)
    slam_map.clear()
    assert take_contents(slam_map).upright_roots == ()


def test_files_without_the_line_are_read(saved: SavedMap, tmp_path: Path) -> None:
    path = tmp_path / "a.orbmap"
    save_map(saved, path)
    edit(path, "UPDATE settings SET yaml = replace(yaml, '# Upright', '# Other')")
    assert load_map(path).contents.upright_roots == ()


def test_comparing_tells_it(saved: SavedMap) -> None:
    other = replace(saved, contents=replace(saved.contents, upright_roots=()))
    assert map_differences(saved, other) == ["upright: map 0 only in the first"]
    assert saved.contents.first_difference(other.contents) == "upright_roots"
    assert saved.contents.content_hash() != other.contents.content_hash()


@pytest.mark.parametrize(
    ("similarity", "stays"),
    [
        (turned(0.7, 2), True),
        (turned(0.01, 0), False),
        (turned(3.0, 1), False),
        (Similarity(2.0, np.eye(3), np.zeros(3)), False),
    ],
)
def test_only_yaw_and_translation_leave_it_upright(
    saved: SavedMap, similarity: Similarity, stays: bool
) -> None:
    moved: MapContents = transform_map(saved.contents, similarity)
    assert moved.upright_roots == ((0,) if stays else ())


def test_parts_keep_it(saved: SavedMap) -> None:
    for first in (0, 2):
        assert keep_keyframes(saved.contents, np.arange(6) >= first).upright_roots == (0,)
    both = put_together([made_up_saved(made_up_map(6, seed=1)), saved])
    assert both.contents.upright_roots == (6,)
    assert [take_map(both, number).contents.upright_roots for number in (0, 1)] == [(), (0,)]
    cut_short = crop_saved_map(both, ~np.isin(np.arange(12), [6, 7]))
    assert cut_short.contents.upright_roots == (8,)
