# SPDX-License-Identifier: BSD-3-Clause
"""What an IMU measured at and between keyframes: it stays in files, edits and loaded maps."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import MapFileError
from orbslam2py import _core as core
from orbslam2py.maps import (
    ImuStates,
    MapContents,
    SavedMap,
    keep_keyframes,
    load_map,
    map_differences,
    restore_contents,
    save_map,
    take_contents,
    transform_map,
    verify_map_file,
)
from orbslam2py.maps.edits.parts import put_together, take_map
from orbslam2py.maps.imu_states import new_keeper, take_states
from orbslam2py.maps.map_autosave import MapAutosave
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.map_writer import MapWriter
from orbslam2py.slam.full_bundle_adjustment import optimize_map
from orbslam2py.trajectory import Similarity
from support.imu_states import SAMPLES, velocities, with_states
from support.made_up_map import made_up_map
from support.made_up_saved import made_up_saved
from support.saved_maps import edit


@pytest.fixture
def saved() -> SavedMap:
    return made_up_saved(with_states(made_up_map(8, loop=False)))


def test_files_keep_them_bit_by_bit(saved: SavedMap, tmp_path: Path) -> None:
    one, other = tmp_path / "a.orbmap", tmp_path / "b.orbmap"
    save_map(saved, one)
    read = load_map(one)
    assert map_differences(saved, read) == []
    assert read.contents.content_hash() == saved.contents.content_hash()
    save_map(read, other)
    assert one.read_bytes() == other.read_bytes()
    verify_map_file(one)


@pytest.mark.parametrize("from_file", [False, True])
def test_a_restored_map_has_them(saved: SavedMap, tmp_path: Path, from_file: bool) -> None:
    path = tmp_path / "a.orbmap"
    save_map(saved, path)
    loaded = MapFile(path) if from_file else load_map(path)
    slam_map, keeper = core.Map(), new_keeper()
    loaded.restore(slam_map, inertial=keeper)
    assert len(keeper) == 7
    taken = take_contents(slam_map, keeper)
    assert saved.contents.first_difference(taken) is None
    np.testing.assert_array_equal(keeper.newest_bias, saved.contents.imu_states.bias[-1])
    assert len(take_contents(slam_map).imu_states) == 0


def test_a_map_without_them_has_the_hash_of_before() -> None:
    bare = made_up_map(4)
    digest = hashlib.sha256(f"{bare.next_keyframe} {bare.next_point}".encode())
    for name, array in bare.arrays():
        if name != "keyframes.words" and not name.startswith(
            ("imu_states.", "patches.", "aligned.", "alignment_noise")
        ):
            digest.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
            digest.update(np.ascontiguousarray(array).data)
    assert bare.content_hash() == digest.hexdigest()
    assert with_states(bare).content_hash() != bare.content_hash()


def test_differences_are_told(saved: SavedMap) -> None:
    states = saved.contents.imu_states
    velocity = states.velocity.copy()
    velocity[2, 0] += 0.5
    other = replace(
        saved, contents=replace(saved.contents, imu_states=replace(states, velocity=velocity))
    )
    assert map_differences(saved, other) == ["imu_states.velocity: 1 of 7 rows, by at most 0.5"]
    assert saved.contents.first_difference(other.contents) == "imu_states.velocity"


# ---- edits ---------------------------------------------------------------------------------------
def test_a_turn_and_a_scale_move_velocities_with_the_map(saved: SavedMap) -> None:
    contents = saved.contents
    R = core.Pose.exp(np.array([0.3, -0.2, 0.5, 0, 0, 0])).rotation_matrix
    moved = transform_map(contents, Similarity(2.5, R, np.array([1.0, 2.0, 3.0])))
    np.testing.assert_allclose(velocities(moved), 2.5 * velocities(contents) @ R.T, atol=1e-12)
    assert moved.imu_states is contents.imu_states, "in the axes of the cameras"


def test_a_removed_keyframe_leaves_its_samples_to_the_next(saved: SavedMap) -> None:
    contents = saved.contents
    before = contents.imu_states
    assert before.ids.tolist() == [0, 2, 3, 4, 5, 6, 7]
    part = keep_keyframes(contents, np.arange(8) != 6).imu_states
    assert part.ids.tolist() == [0, 2, 3, 4, 5, 7]
    assert np.diff(part.offsets).tolist() == [0, 11, 11, 0, 11, 2 * SAMPLES - 1]
    times = part.samples[part.offsets[5] :, 0]
    assert (np.diff(times) > 0).all()
    np.testing.assert_array_equal(part.velocity, before.velocity[[0, 1, 2, 3, 4, 6]])
    # Where nothing joined one of them to the one before, nothing joins the next.
    part = keep_keyframes(contents, np.arange(8) != 4).imu_states
    assert np.diff(part.offsets).tolist() == [0, 11, 11, 0, 11, 11]


def test_the_first_one_of_a_part_begins_anew(saved: SavedMap) -> None:
    part = keep_keyframes(saved.contents, np.arange(8) > 1)
    assert part.imu_states.ids.tolist() == [0, 3, 4, 5, 6, 7], "the root has number 0"
    assert np.diff(part.imu_states.offsets).tolist() == [0, 11, 0, 11, 11, 11]
    restore_contents(part)
    np.testing.assert_array_equal(part.imu_states.velocity, saved.contents.imu_states.velocity[1:])


def test_maps_in_one_file_and_taken_out_again(saved: SavedMap) -> None:
    other = made_up_saved(with_states(made_up_map(5, loop=False, seed=2), seed=7))
    both = put_together([saved, other])
    states = both.contents.imu_states
    assert states.ids.tolist() == [0, 2, 3, 4, 5, 6, 7, 8, 10, 11, 12]
    restore_contents(both.contents)
    alone = take_map(both, 1).contents.imu_states
    for (name, one), (_, again) in zip(
        alone.arrays(), other.contents.imu_states.arrays(), strict=True
    ):
        if name != "ids":
            np.testing.assert_array_equal(one, again, err_msg=name)


def test_an_adjustment_leaves_them(saved: SavedMap) -> None:
    refined, _ = optimize_map(saved.contents)
    assert refined.imu_states is saved.contents.imu_states


# ---- files that grow -----------------------------------------------------------------------------
def test_only_changed_states_are_written_again(saved: SavedMap, tmp_path: Path) -> None:
    keeper = new_keeper()
    slam_map = restore_contents(saved.contents, inertial=keeper)
    autosave = MapAutosave(
        slam_map,
        lambda index, ids: saved.runs[0].frames,
        saved.settings,
        lambda: saved.vocabulary,
        seed=0,
        options={},
        earlier=None,
        inertial=keeper,
    )
    path = tmp_path / "a.orbmap"
    writer = MapWriter(path)
    first = autosave.changes(writer, None)
    autosave.update(writer, first, partly=False)
    keeper.set(6, np.array([1.0, 2.0, 3.0]), np.arange(6.0))
    second = autosave.changes(writer, first)
    changed = second.contents.imu_states.ids[second.changed_states]
    assert changed.tolist() == [6]
    assert len(second.contents.imu_states.samples) == SAMPLES, "those before it"
    autosave.update(writer, second, partly=True)
    assert slam_map.erase_keyframe(3)
    third = autosave.changes(writer, second)
    assert third.contents.imu_states.ids[third.changed_states].tolist() == [4]
    autosave.update(writer, third, partly=True)
    writer.close()
    read = load_map(path).contents
    assert read.first_difference(take_contents(slam_map, keeper)) is None
    assert read.imu_states.ids.tolist() == [0, 2, 4, 5, 6, 7]


# ---- bad input -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("statement", "named"),
    [
        ("UPDATE imu_states SET velocity = x'00' WHERE keyframe = 3", "velocity of imu_states 3"),
        ("UPDATE imu_states SET bias = zeroblob(8) WHERE keyframe = 3", "bias of imu_states 3"),
        ("UPDATE imu_states SET count = 5 WHERE keyframe = 3", "samples of imu_states 3"),
        ("UPDATE imu_states SET scale = -1.0 WHERE keyframe = 3", "keyframe 3 has a scale"),
        (
            "UPDATE imu_states SET samples = zeroblob(length(samples)) WHERE keyframe = 3",
            "samples before the state of the IMU at keyframe 3",
        ),
        (
            "UPDATE imu_states SET keyframe = 1 WHERE keyframe = 3",
            "samples before the state of the IMU at keyframe",
        ),
    ],
)
@pytest.mark.parametrize("whole", [True, False])
def test_a_damaged_state_is_named(
    saved: SavedMap, tmp_path: Path, statement: str, named: str, whole: bool
) -> None:
    path = tmp_path / "a.orbmap"
    save_map(saved, path)
    edit(path, statement)
    with pytest.raises(MapFileError, match=named) as refused:
        load_map(path) if whole else MapFile(path).check()
    assert "a.orbmap" in str(refused.value)
    assert "copy of the file" in str(refused.value)


def test_a_flipped_bit_is_noticed(saved: SavedMap, tmp_path: Path) -> None:
    path = tmp_path / "a.orbmap"
    save_map(saved, path)
    row = saved.contents.imu_states.samples[5].tobytes()
    content = path.read_bytes()
    assert content.count(row) == 1
    path.write_bytes(content.replace(row, row[:-1] + bytes([row[-1] ^ 1])))
    with pytest.raises(MapFileError, match="checksum of a row of imu_states, 2, is wrong"):
        load_map(path)


@pytest.mark.parametrize(
    ("field", "value", "named"),
    [
        ("ids", np.array([0, 2, 3, 4, 5, 6, 99]), "keyframe is not there"),
        ("ids", np.array([0, 2, 3, 3, 5, 6, 7]), "out of order"),
        ("velocity", np.full((7, 3), np.nan), "not finite"),
        ("bias", np.full((7, 6), np.inf), "not finite"),
        ("bias", np.zeros((7, 5)), "imu_states.bias"),
        ("samples", np.zeros((3, 7)), "count other samples"),
        ("samples", np.zeros((55, 7), np.float32), "imu_states.samples"),
    ],
)
def test_impossible_states_make_no_map(
    saved: SavedMap, field: str, value: np.ndarray, named: str
) -> None:
    states = replace(saved.contents.imu_states, **{field: value})
    contents = replace(saved.contents, imu_states=states)
    with pytest.raises(MapFileError, match=named):
        restore_contents(contents)


def test_no_states() -> None:
    none = ImuStates.none()
    keeper = new_keeper()
    states, versions, changed = take_states(
        keeper, made_up_map(3).keyframes, np.zeros((0, 3), np.int64)
    )
    assert len(states) == len(none) == len(versions) == len(changed) == 0
    for (name, one), (_, other) in zip(states.arrays(), none.arrays(), strict=True):
        assert one.shape == other.shape and one.dtype == other.dtype, name
    assert keeper.newest_bias is None


def contents_with_first_state_joined(contents: MapContents) -> MapContents:
    """The first state has samples, although there is no keyframe with a state before it."""
    states = contents.imu_states
    offsets = states.offsets.copy()
    offsets[1:] += 1
    samples = np.vstack([states.samples[:1], states.samples])
    return replace(contents, imu_states=replace(states, offsets=offsets, samples=samples))


def test_nothing_comes_before_the_first(saved: SavedMap) -> None:
    with pytest.raises(MapFileError, match="samples before the state of the IMU at keyframe 0"):
        restore_contents(contents_with_first_state_joined(saved.contents))
