# SPDX-License-Identifier: BSD-3-Clause
"""Several maps in one file, and maps of several files made one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py import _core as core
from orbslam2py.maps import SavedMap, load_map, save_map, verify_map_file
from orbslam2py.maps.edits.parts import map_numbers, put_together, take_map
from orbslam2py.maps.map_copies import restore_contents
from orbslam2py.slam import saved_map_merging
from orbslam2py.slam.saved_map_merging import merge_maps
from support.command_line import CommandLine
from support.cut_sequences import corridor, cut, settings_of, track


def mapped(first: int, last: int, sensor: str = "rgbd", seed: int = 0) -> SavedMap:
    """A map of a part of the corridor."""
    sequence = cut(corridor(sensor, seed), range(first, last))
    with orb.System(settings_of(sequence), sensor, deterministic=True) as slam:
        track(slam, sequence)
        return slam.saved_map()


@pytest.fixture(scope="module")
def beginning() -> SavedMap:
    return mapped(0, 90)


@pytest.fixture(scope="module")
def overlapping() -> SavedMap:
    return mapped(40, 130)


@pytest.fixture(scope="module")
def elsewhere() -> SavedMap:
    return mapped(200, 260)


def test_put_together_each_is_as_it_was(beginning: SavedMap, elsewhere: SavedMap) -> None:
    both = put_together([beginning, elsewhere])
    numbers = map_numbers(both.contents.keyframes)
    assert np.bincount(numbers).tolist() == [beginning.n_keyframes, elsewhere.n_keyframes]
    assert core.check_invariants(restore_contents(both.contents), require_words=False) == []
    again = take_map(both, 0)
    assert again.contents.points.positions.tobytes() == (
        beginning.contents.points.positions.tobytes()
    )
    other = take_map(both, 1)
    assert other.n_keyframes == elsewhere.n_keyframes
    np.testing.assert_array_equal(other.contents.keyframes.T_cw, elsewhere.contents.keyframes.T_cw)
    assert len(both.runs) == 2
    assert len(take_map(both, 1).runs[1].frames) == len(elsewhere.runs[0].frames)
    with pytest.raises(orb.MapFileError, match=r"holds 2 maps: 0 \(.* keyframes\), 1 \(.*--map"):
        take_map(both)
    with pytest.raises(orb.MapFileError, match="has no map 2"):
        take_map(both, 2)


def test_a_file_of_several_maps_comes_back_as_it_was(
    beginning: SavedMap, elsewhere: SavedMap, tmp_path: Path
) -> None:
    both = put_together([beginning, elsewhere])
    save_map(both, tmp_path / "both.orbmap")
    read = verify_map_file(tmp_path / "both.orbmap")
    assert read.contents.first_difference(both.contents) is None


def test_maps_that_show_the_same_place_become_one(
    beginning: SavedMap, overlapping: SavedMap, elsewhere: SavedMap
) -> None:
    merged, merges = merge_maps([beginning, overlapping, elsewhere], full_adjustment=False)
    (one,) = merges
    assert (one.map_index, one.merged_map) == (0, 1)
    numbers = map_numbers(merged.contents.keyframes)
    assert numbers.max() == 1, "what shows no common place stays a map of its own"
    assert merged.n_keyframes == sum(
        saved.n_keyframes for saved in (beginning, overlapping, elsewhere)
    )
    # The world of the first stays, and the second began 40 frames along the way.
    first = merged.contents.keyframes
    np.testing.assert_allclose(first.T_wc[0], beginning.contents.keyframes.T_wc[0], atol=0.05)
    source = cut(corridor("rgbd"), range(130)).source
    root = int(beginning.contents.next_keyframe)
    true = np.linalg.inv(source.T_wc(0)) @ source.T_wc(40)
    found = np.linalg.inv(first.T_wc[0]) @ first.T_wc[first.row_of(root)]
    assert np.linalg.norm(found[:3, 3] - true[:3, 3]) < 0.1
    assert core.check_invariants(restore_contents(merged.contents), require_words=False) == []


def test_merging_gives_the_same_bytes_in_every_run(
    beginning: SavedMap, overlapping: SavedMap
) -> None:
    once, _ = merge_maps([beginning, overlapping])
    twice, _ = merge_maps([beginning, overlapping])
    assert once.contents.first_difference(twice.contents) is None


def test_a_loop_that_waits_at_the_end_of_a_map_is_closed() -> None:
    asked: list[object] = []
    closing: Any = SimpleNamespace(
        process=asked.append,
        end=lambda: asked.append("end"),
        reset=lambda: asked.append("reset"),
    )
    slam_map: Any = SimpleNamespace(
        maps=[1, 2], keyframe_ids=lambda number: np.array([10 * number, 10 * number + 1])
    )
    index: Any = None
    saved_map_merging._compare(slam_map, index, closing)
    assert asked == [10, 11, "end", "reset", 20, 21, "end", "reset"]


def test_one_map_is_not_enough(beginning: SavedMap) -> None:
    with pytest.raises(orb.MapFileError, match="takes two maps or more"):
        merge_maps([beginning])


def test_maps_of_other_cameras_are_refused(beginning: SavedMap, elsewhere: SavedMap) -> None:
    camera = replace(elsewhere.settings.camera, fx=100.0)
    other = replace(elsewhere, settings=replace(elsewhere.settings, camera=camera))
    with pytest.raises(orb.OrbSlamError, match=r"made with different cameras: Camera.fx is"):
        merge_maps([beginning, other])


def test_the_command_merges_and_tells(
    beginning: SavedMap,
    overlapping: SavedMap,
    elsewhere: SavedMap,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    call = CommandLine(monkeypatch, capsys, tmp_path)
    names = []
    for name, saved in (("a", beginning), ("b", overlapping), ("c", elsewhere)):
        save_map(saved, tmp_path / f"{name}.orbmap")
        names.append(str(tmp_path / f"{name}.orbmap"))
    target = str(tmp_path / "all.orbmap")
    told = call("map", "merge", *names, "--output", target, "--no-full-adjustment").out
    assert "map 1 is part of map 0 now" in told
    assert "2 maps of" in told
    told = call("map", "info", target).out
    assert "each in its own world frame" in told
    assert "map 1 " in told
    assert "in 2 maps" in call("map", "verify", target).out
    part = str(tmp_path / "part.orbmap")
    assert call("map", "optimize", target, "--output", part).code == 2
    assert call("map", "optimize", target, "--map", "1", "--output", part).code == 0
    assert load_map(part).n_keyframes == load_map(target).n_keyframes
    alone = str(tmp_path / "alone.orbmap")
    assert call("map", "crop", part, "--map", "1", "--only", "--output", alone).code == 0
    assert load_map(alone).n_keyframes == elsewhere.n_keyframes


def test_paths_of_two_maps_are_never_mixed(beginning: SavedMap, elsewhere: SavedMap) -> None:
    both = put_together([beginning, elsewhere])
    for number, alone in enumerate((beginning, elsewhere)):
        mine, theirs = both.trajectory(number), alone.trajectory()
        np.testing.assert_array_equal(mine.timestamps, theirs.timestamps)
        np.testing.assert_allclose(mine.T_wc, theirs.T_wc, atol=1e-12)
    assert len(both.trajectory(0, map_number=1)) == 0


def test_only_a_list_of_saved_maps_is_merged(beginning: SavedMap, tmp_path: Path) -> None:
    saved = beginning
    for wrong in (saved, "a.orbmap", [saved], ["a.orbmap", "b.orbmap"], None):
        with pytest.raises(orb.MapFileError, match=r"two maps or more|SavedMap"):
            merge_maps(wrong)  # type: ignore[arg-type]
    with pytest.raises(orb.MapFileError, match="SavedMap"):
        merge_maps([saved, "b.orbmap"], str(tmp_path / "out.orbmap"))  # type: ignore[list-item]
