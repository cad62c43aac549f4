# SPDX-License-Identifier: BSD-3-Clause
"""``map crop``, ``align`` and ``optimize`` on a file of several maps: the others stay in it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import MapFileError, optimize_map
from orbslam2py import _core as core
from orbslam2py.maps import (
    MapContents,
    SavedMap,
    load_map,
    map_differences,
    restore_contents,
    transform_map,
)
from orbslam2py.maps.edits.parts import (
    crop_among_others,
    map_numbers,
    put_back,
    put_together,
    take_map,
)
from orbslam2py.trajectory import Similarity, Trajectory, write_tum
from support.command_line import CommandLine
from support.made_up_map import STEP, made_up_map
from support.made_up_saved import made_up_saved, map_file
from support.renumbered import renumbered

TWICE = Similarity(2.0, np.eye(3), np.array([1.0, 2.0, 3.0]))


def several(n: int = 2, *, depth: bool = False) -> SavedMap:
    """Maps of 6, 7, ... keyframes, whose points do not lie quite where they are seen."""
    return put_together(
        [
            made_up_saved(
                made_up_map(6 + number, 60, seed=number, noise=0.5, loop=False, depth=depth),
                images=True,
            )
            for number in range(n)
        ]
    )


def check_invariants(contents: MapContents) -> None:
    assert core.check_invariants(restore_contents(contents), require_words=False) == []


def read(path: str | Path) -> SavedMap:
    saved = load_map(path, images=True)
    check_invariants(saved.contents)
    return saved


def sizes(saved: SavedMap) -> list[int]:
    return np.bincount(map_numbers(saved.contents.keyframes)).tolist()


def edges_of(saved: SavedMap, number: int) -> np.ndarray:
    """Both keyframes' places in their map, and the weight, of every edge of a map; (e, 3)."""
    keyframes, edges = saved.contents.keyframes, saved.contents.covisibility
    ids = keyframes.ids[map_numbers(keyframes) == number]
    mine = np.isin(edges.a, ids)
    rows = [np.searchsorted(ids, end[mine]) for end in (edges.a, edges.b)]
    return np.stack([*rows, edges.weight[mine]], axis=1)


def check_untouched(before: SavedMap, after: SavedMap, numbers: dict[int, int]) -> None:
    """Maps are in the file as they were, under new numbers."""
    for old, new in numbers.items():
        mine, theirs = take_map(before, old), take_map(after, new)
        # Taking a map out counts its edges anew.
        np.testing.assert_array_equal(edges_of(before, old), edges_of(after, new))
        # The numbers that the next ones will have are those of the whole file.
        assert map_differences(mine, theirs) == []


# ---- refined -------------------------------------------------------------------------------------
@pytest.mark.parametrize("number", [0, 1, 2])
def test_optimize_in_place(command: CommandLine, tmp_path: Path, number: int) -> None:
    saved = several(3)
    file = map_file(tmp_path, saved)
    done = command("map", "optimize", file, "-o", file, "--map", number, "--force")
    assert done.code == 0, done.err
    assert done.out.splitlines()[-1] == f"Map {number} is in {file}, the 2 other maps as they were"
    after = read(file)
    assert sizes(after) == [6, 7, 8]
    check_untouched(saved, after, {k: k for k in range(3) if k != number})
    refined, _ = optimize_map(take_map(saved, number).contents)
    for name, array in take_map(after, number).contents.arrays():
        if not name.startswith("cameras.") and name != "keyframes.camera":  # equal ones are one
            expected = dict(refined.arrays())[name]
            np.testing.assert_array_equal(array, expected, err_msg=name)
    assert (after.runs, after.images) != ((), {})
    assert [len(run.frames) for run in after.runs] == [len(run.frames) for run in saved.runs]


# ---- moved ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("depth", [False, True])
def test_align_to_another_file(command: CommandLine, tmp_path: Path, depth: bool) -> None:
    saved = several(depth=depth)
    similarity = replace(TWICE, scale=1.0) if depth else TWICE
    mine = take_map(saved, 1).contents.keyframes
    T_wc = similarity.apply_to_poses(mine.T_wc)
    write_tum(tmp_path / "truth.txt", Trajectory(mine.timestamps, T_wc))
    file = map_file(tmp_path, saved)
    done = command("map", "align", file, "-o", "b.orbmap", "--map", 1, "--truth", "truth.txt")
    assert done.code == 0, done.err
    assert done.out.splitlines()[-1] == "Map 1 is in b.orbmap, the other map as it was"
    after = read("b.orbmap")
    assert sizes(after) == [6, 7]
    check_untouched(saved, after, {0: 0})
    moved = take_map(after, 1).contents
    np.testing.assert_allclose(moved.keyframes.T_wc, T_wc, atol=1e-6)
    before = transform_map(take_map(saved, 1).contents, similarity)
    for name in ("positions", "mean_directions", "max_distance"):
        found, expected = getattr(moved.points, name), getattr(before.points, name)
        np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_allclose(moved.keyframes.scale, before.keyframes.scale, rtol=1e-5)
    told = command("map", "info", "b.orbmap").out
    assert told.count(" m, ") == (2 if depth else 1), "only the one has metres"


def test_a_map_that_has_become_another_one_is_not_put_back() -> None:
    saved = several()
    other = made_up_map(6, 50, seed=4)
    with pytest.raises(MapFileError, match="not the keyframes and points of map 0"):
        put_back(saved, 0, other)


# ---- cut -----------------------------------------------------------------------------------------
def test_crop_in_place(command: CommandLine, tmp_path: Path) -> None:
    saved = several()
    file = map_file(tmp_path, saved)
    done = command("map", "crop", file, "-o", file, "--map", 1, "--to", 3.2 * STEP, "--force")
    assert done.code == 0, done.err
    assert done.out.startswith("4 of 7 keyframes and ")
    assert done.out.endswith(f" points of map 1 are in {file}, the other map as it was\n")
    after = read(file)
    assert sizes(after) == [6, 4]
    check_untouched(saved, after, {0: 0})
    assert len(after.images) == 10


def test_crop_to_a_box_leaves_points_of_other_maps(command: CommandLine, tmp_path: Path) -> None:
    saved = several()
    file = map_file(tmp_path, saved)
    box = ("--low", "-9,-9,-9", "--high", "9,9,4", "--points")
    done = command("map", "crop", file, "-o", "b.orbmap", "--map", 0, *box)
    assert done.code == 0, done.err
    after = read("b.orbmap")
    check_untouched(saved, after, {1: 1})
    assert take_map(after, 0).contents.points.positions[:, 2].max() <= 4
    assert take_map(saved, 0).contents.points.positions[:, 2].max() > 4


def test_crop_tells_a_map_that_has_another_number_then(
    command: CommandLine, tmp_path: Path
) -> None:
    """Maps are numbered by their first keyframes, and this one went on after the other began."""
    saved = renumbered(several(), np.array([0, 1, 2, *range(6, 13), 3, 4, 5]))
    check_invariants(saved.contents)
    assert sizes(saved) == [6, 7]
    file = map_file(tmp_path, saved)
    done = command("map", "crop", file, "-o", "b.orbmap", "--map", 0, "--from", 2.5 * STEP)
    assert done.code == 0, done.err
    assert done.out.endswith("the other map as it was; the file has it as map 1\n")
    after = read("b.orbmap")
    assert sizes(after) == [7, 3]
    check_untouched(saved, after, {1: 0})


@pytest.mark.parametrize("number", [0, 1])
def test_one_map_taken_out_of_the_file(command: CommandLine, tmp_path: Path, number: int) -> None:
    saved = several()
    file = map_file(tmp_path, saved)
    done = command("map", "crop", file, "-o", "b.orbmap", "--map", number, "--only")
    assert done.code == 0, done.err
    after = read("b.orbmap")
    assert map_differences(after, take_map(saved, number)) == []
    assert done.out.startswith(f"{6 + number} of {6 + number} keyframes and ")
    assert done.out.endswith(" points are in b.orbmap\n")
    done = command("map", "crop", file, "-o", "c.orbmap", "--map", number, "--only", "--to", STEP)
    assert done.code == 0, done.err
    assert sizes(read("c.orbmap")) == [2]


def test_the_number_must_be_told(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path, several())
    for words in (("crop", "--to", 1), ("crop", "--only"), ("optimize",)):
        done = command("map", words[0], file, "-o", "b.orbmap", *words[1:])
        assert done.code == 2
        assert "holds 2 maps" in " ".join(done.err.split())
        assert not Path("b.orbmap").exists()


def test_cropping_one_map_leaves_the_edges_of_others_as_they_were_counted() -> None:
    """Weights are those of the last count, which may lie behind."""
    saved = several(2)
    edges = saved.contents.covisibility
    older = replace(edges, weight=np.maximum(edges.weight - 1, 1))
    saved = replace(saved, contents=replace(saved.contents, covisibility=older))
    n = sizes(saved)[0]
    cropped, number = crop_among_others(saved, 0, np.arange(n) < n - 1)
    assert (number, sizes(cropped)) == (0, [n - 1, 7])
    np.testing.assert_array_equal(edges_of(cropped, 1), edges_of(saved, 1))
    assert not np.array_equal(edges_of(cropped, 0)[:, 2], edges_of(saved, 0)[:, 2])
    check_invariants(cropped.contents)
