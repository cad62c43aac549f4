# SPDX-License-Identifier: BSD-3-Clause
"""What is no map, no path, no mask: refused at the door, with what to give instead."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import MapFileError, OrbSlamError, SettingsError, maps, merge_maps, optimize_map
from orbslam2py.maps import SavedMap, load_map, save_map
from orbslam2py.maps.map_writer import check_map_target
from orbslam2py.trajectory import Similarity
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved

Function = Callable[..., Any]


def refusal(error: type[OrbSlamError], call: Callable[[], Any]) -> str:
    """The message of a refusal: one line with a remedy."""
    with pytest.raises(error) as caught:
        call()
    text = str(caught.value)
    assert "\n" not in text
    assert "give" in text
    return text


# ---- maps ----------------------------------------------------------------------------------------
TAKE_CONTENTS: dict[str, Callable[[Any, Path], Any]] = {
    "crop_to_box": lambda given, _: maps.crop_to_box(given, np.zeros(3), np.ones(3)),
    "crop_to_times": lambda given, _: maps.crop_to_times(given, 0, 1),
    "export_colmap": maps.export_colmap,
    "export_g2o": maps.export_g2o,
    "export_nerfstudio": maps.export_nerfstudio,
    "export_points": lambda given, path: maps.export_points(given, path, "ply"),
    "images_of": lambda given, _: maps.images_of(given, None),  # type: ignore[arg-type]
    "keep_keyframes": lambda given, _: maps.keep_keyframes(given, np.ones(8, bool)),
    "keyframe_path": lambda given, _: maps.keyframe_path(given),
    "optimize_map": lambda given, _: optimize_map(given),
    "place_by_length": lambda given, _: maps.place_by_length(given, np.zeros(3), np.ones(3), 1),
    "place_by_points": lambda given, _: maps.place_by_points(given, np.eye(3), np.eye(3)),
    "place_by_trajectory": lambda given, _: maps.place_by_trajectory(given, None),  # type: ignore[arg-type]
    "reprojection_errors": lambda given, _: maps.reprojection_errors(given),
    "restore_contents": lambda given, _: maps.restore_contents(given),
    "transform_map": lambda given, _: maps.transform_map(given, Similarity.identity()),
    "with_colours": lambda given, _: maps.with_colours(given, lambda _: None),
}


@pytest.mark.parametrize("given", [made_up_saved(), "a.orbmap", None, []], ids=type)
@pytest.mark.parametrize("function", TAKE_CONTENTS.values(), ids=TAKE_CONTENTS)
def test_what_is_no_contents_is_refused(tmp_path: Path, function: Function, given: Any) -> None:
    text = refusal(MapFileError, lambda: function(given, tmp_path / "out"))
    assert "saved.contents of saved = load_map(path)" in text
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("given", [made_up_map(), "a.orbmap", None], ids=type)
@pytest.mark.parametrize(
    "function",
    [
        save_map,
        lambda given, _: maps.map_differences(made_up_saved(), given),
        lambda given, _: maps.map_differences(given, made_up_saved()),
        lambda given, _: maps.crop_saved_map(given, np.ones(8, bool)),
        lambda given, _: merge_maps([given, made_up_saved()]),
    ],
)
def test_what_is_no_saved_map_is_refused(tmp_path: Path, function: Function, given: Any) -> None:
    text = refusal(MapFileError, lambda: function(given, tmp_path / "out.orbmap"))
    assert "a SavedMap, as from load_map(path)" in text


# ---- masks and places ----------------------------------------------------------------------------
@pytest.mark.parametrize(
    "mask",
    [np.ones(8, int), np.arange(8), np.ones(7, bool), np.ones((8, 1), bool), ["a"] * 8, [[1], []]],
)
def test_a_mask_is_bool_and_one_per_entry(mask: Any) -> None:
    saved = made_up_saved(made_up_map(8, 120))
    everything = np.ones(8, bool)
    for crop, given in ((maps.keep_keyframes, saved.contents), (maps.crop_saved_map, saved)):
        text = refusal(MapFileError, lambda: crop(given, mask))  # type: ignore[operator] # noqa: B023
        assert "kept is" in text
        assert "give a bool array of shape (8,), True for each keyframe that stays" in text
        text = refusal(MapFileError, lambda: crop(given, everything, mask))  # type: ignore[operator] # noqa: B023
        assert "True for each point that stays" in text


def test_a_list_of_true_and_false_is_a_mask() -> None:
    cropped = maps.crop_saved_map(made_up_saved(), [True] * 7 + [False])  # type: ignore[arg-type]
    assert cropped.n_keyframes == 7


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda c: maps.crop_to_box(c, [1, 1], np.ones(3)), r"the low corner has shape \(2,\)"),
        (lambda c: maps.crop_to_box(c, np.ones(3), "far"), "the high corner is 'far'"),
        (lambda c: maps.crop_to_times(c, "0", 1), "begin is '0'"),
        (lambda c: maps.crop_to_times(c, 0, np.nan), "end is nan"),
        (lambda c: maps.transform_map(c, np.eye(4)), "the similarity is a ndarray"),
        (lambda c: maps.place_by_trajectory(c, None), "the truth is None"),
        (lambda c: maps.place_by_points(c, [[0, 0]] * 3, np.eye(3)), "positions has shape"),
        (lambda c: maps.place_by_points(c, np.eye(3), "x"), "known is 'x'"),
        (lambda c: maps.place_by_points(c, np.eye(3), np.ones((4, 3))), "3 positions, but 4"),
        (lambda c: maps.place_by_length(c, [0, 0], [1, 0, 0], 1), "the first position has shape"),
        (lambda c: maps.place_by_length(c, [0, 0, 0], [1, 0, 0], "1"), "the length is '1'"),
    ],
)
def test_places_times_and_lengths_are_numbers(call: Function, words: str) -> None:
    with pytest.raises(MapFileError, match=words):
        call(made_up_map())


def test_lists_of_numbers_are_places() -> None:
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    placed = maps.place_by_points(made_up_map(), corners, corners)  # type: ignore[arg-type]
    assert placed.similarity.scale == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((7,), "run is 7; give a whole number from -1 to 0"),
        ((-2,), "run is -2"),
        (("last",), "run is 'last'"),
        ((0, 9), "map_number is 9; give a whole number from 0 to 0"),
        ((0, -1), "map_number is -1"),
    ],
)
def test_a_run_or_map_that_is_not_there(arguments: tuple[Any, ...], words: str) -> None:
    with pytest.raises(MapFileError, match=words):
        made_up_saved().trajectory(*arguments)


@pytest.mark.parametrize("seconds", [-1, 0, np.nan, np.inf, "3", True])
def test_a_time_limit_is_above_zero(seconds: Any) -> None:
    text = refusal(SettingsError, lambda: optimize_map(made_up_map(), time_limit=seconds))
    assert "seconds above 0, or None for no limit" in text


# ---- paths ---------------------------------------------------------------------------------------
TAKE_PATHS: dict[str, Callable[[Any], Any]] = {
    "check_map_target": check_map_target,
    "export_colmap": lambda path: maps.export_colmap(made_up_map(), path),
    "export_g2o": lambda path: maps.export_g2o(made_up_map(), path),
    "export_nerfstudio": lambda path: maps.export_nerfstudio(made_up_map(), path),
    "export_points": lambda path: maps.export_points(made_up_map(), path, "ply"),
    "export_trajectory": lambda path: maps.export_trajectory(
        maps.keyframe_path(made_up_map()), path, "tum"
    ),
    "load_map": load_map,
    "MapArrays.load": maps.MapArrays.load,
    "MapFile": maps.MapFile,
    "save_map": lambda path: save_map(made_up_saved(), path),
    "verify_map_file": maps.verify_map_file,
    "write_pcd": lambda path: maps.write_pcd(path, np.zeros((2, 3))),
    "write_ply": lambda path: maps.write_ply(path, np.zeros((2, 3))),
}


@pytest.mark.parametrize("path", [None, b"map", 3, "a\0b", ""])
@pytest.mark.parametrize("function", TAKE_PATHS.values(), ids=TAKE_PATHS)
def test_what_is_no_path_is_refused(function: Function, path: Any) -> None:
    assert "give a path" in refusal(OrbSlamError, lambda: function(path))


# ---- maps that are none --------------------------------------------------------------------------
def _with_points(saved: SavedMap, **arrays: Any) -> SavedMap:
    points = dataclasses.replace(saved.contents.points, **arrays)
    return dataclasses.replace(saved, contents=dataclasses.replace(saved.contents, points=points))


def _with_frames(saved: SavedMap, **arrays: Any) -> SavedMap:
    (run,) = saved.runs
    frames = dataclasses.replace(run.frames, **arrays)
    return dataclasses.replace(saved, runs=(dataclasses.replace(run, frames=frames),))


@pytest.mark.parametrize(
    "spoil",
    [
        lambda saved: _with_points(saved, positions=np.full((120, 3), np.nan)),
        lambda saved: _with_points(saved, positions=np.zeros((3, 3))),
        lambda saved: _with_points(saved, positions=None),
        lambda saved: _with_points(saved, positions="here"),
        lambda saved: _with_frames(saved, keyframes=saved.runs[0].frames.keyframes + 1000),
    ],
)
def test_a_map_that_could_not_be_loaded_is_not_saved(tmp_path: Path, spoil: Function) -> None:
    path = tmp_path / "map.orbmap"
    saved = made_up_saved(made_up_map(8, 120))
    save_map(saved, path)
    before = path.read_bytes()
    text = refusal(MapFileError, lambda: save_map(spoil(saved), path))
    assert text.startswith(f"cannot write {path}: ")
    assert "a file that was there is kept" in text
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
