# SPDX-License-Identifier: BSD-3-Clause
"""Patches of points and aligned sightings: they stay in files, edits and loaded maps."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import MapFileError, Sensor, SettingsError
from orbslam2py import _core as core
from orbslam2py.maps import (
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
from orbslam2py.maps.map_file import MapFile
from orbslam2py.trajectory import Similarity
from support import small_sequences
from support.saved_maps import FRAMES, edit, small_map, written


@pytest.fixture(scope="module")
def saved() -> SavedMap:
    return small_map()


@pytest.fixture(scope="module")
def contents(saved: SavedMap) -> MapContents:
    return saved.contents


def seen_as(contents: MapContents) -> set[tuple[int, int, int]]:
    """Keyframe, keypoint and point of all observations."""
    seen = contents.observations
    return set(
        zip(seen.keyframe.tolist(), seen.keypoint.tolist(), seen.point.tolist(), strict=True)
    )


def aligned_as(contents: MapContents) -> set[tuple[int, int, int]]:
    aligned = contents.aligned
    return set(
        zip(
            aligned.keyframe.tolist(),
            aligned.keypoint.tolist(),
            aligned.point.tolist(),
            strict=True,
        )
    )


def assert_consistent(contents: MapContents) -> None:
    """Patches are of points and known keyframes, aligned sightings are observations of these."""
    patches = contents.patches
    known = np.concatenate([contents.keyframes.ids, contents.removed_keyframes.ids])
    assert np.isin(patches.point, contents.points.ids).all()
    assert np.isin(patches.keyframe, known).all()
    assert aligned_as(contents) <= seen_as(contents)
    assert np.isin(contents.aligned.point, patches.point).all()


def test_a_map_of_depth_images_has_them(contents: MapContents) -> None:
    assert len(contents.patches) > 0.9 * len(contents.points)
    assert (contents.aligned.variance > 0).sum() > len(contents.points)
    assert contents.alignment_noise[0, 0] < 0.5 and contents.alignment_noise[0, 1] >= 1
    assert_consistent(contents)
    reference = contents.aligned.reference
    own = np.searchsorted(contents.patches.point, contents.aligned.point[reference])
    np.testing.assert_array_equal(
        contents.patches.keyframe[own], contents.aligned.keyframe[reference]
    )


def test_a_patch_shows_what_the_image_shows(contents: MapContents) -> None:
    """16 times the smoothed grey values around the point, on its level."""
    patches, keyframes = contents.patches, contents.keyframes
    row = int(np.flatnonzero((patches.level == 0) & (patches.keyframe == keyframes.ids[-1]))[0])
    frame = int(keyframes.frame_ids[-1])
    image = small_sequences.images(Sensor.RGBD, frame).image.astype(np.float64)
    grey = image if image.ndim == 2 else image @ [0.299, 0.587, 0.114]
    x, y = np.rint(patches.pixel[row] - patches.fraction[row]).astype(int)
    values = patches.values[row].reshape(24, 24) / 16
    assert values[12, 12] == pytest.approx(grey[y - 1 : y + 2, x - 1 : x + 2].mean(), abs=25)
    around = grey[y - 12 : y + 12, x - 12 : x + 12]
    assert np.corrcoef(values.ravel(), around.ravel())[0, 1] > 0.9


def test_files_keep_them_bit_by_bit(saved: SavedMap, tmp_path: Path) -> None:
    one, other = written(tmp_path), tmp_path / "again.orbmap"
    read = verify_map_file(one)
    assert map_differences(saved, read) == []
    save_map(read, other)
    assert one.read_bytes() == other.read_bytes()


@pytest.mark.parametrize("from_file", [False, True])
def test_a_restored_map_has_them(contents: MapContents, tmp_path: Path, from_file: bool) -> None:
    slam_map = core.Map()
    path = written(tmp_path)
    (MapFile(path) if from_file else load_map(path)).restore(slam_map)
    assert core.count_aligned(slam_map) == (contents.aligned.variance > 0).sum()
    assert core.alignment_noise(slam_map)[0] == contents.alignment_noise[0, 0]
    assert contents.first_difference(take_contents(slam_map)) is None


def test_they_can_be_left_out(saved: SavedMap, tmp_path: Path) -> None:
    path, whole = tmp_path / "bare.orbmap", written(tmp_path)
    save_map(saved, path, patches=False)
    read = load_map(path).contents
    assert (len(read.patches), len(read.aligned), read.alignment_noise.shape) == (0, 0, (0, 2))
    assert read.content_hash() != saved.contents.content_hash()
    assert saved.contents.without_patches().first_difference(read) is None
    assert path.stat().st_size < whole.stat().st_size - 1000 * len(saved.contents.patches)
    with pytest.raises(SettingsError, match="patches is"):
        save_map(saved, path, patches="no")  # type: ignore[arg-type]


def test_a_system_leaves_them_out_of_its_files(tmp_path: Path) -> None:
    path = tmp_path / "a.orbmap"
    with small_sequences.new_system(Sensor.RGBD, deterministic=True, point_patches=False) as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 12)
        slam.save_map(path)
        assert core.count_aligned(slam.pipeline.back_end.map) > 0
        assert len(slam.saved_map().contents.patches) == 0
    assert len(load_map(path).contents.aligned) == 0


def test_a_file_that_grows_has_the_present_ones(tmp_path: Path) -> None:
    """Only what has changed was looked at."""
    path = tmp_path / "a.orbmap"
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        slam.autosave(path, every=1000)
        autosave = slam.pipeline.keeper._autosave
        assert autosave is not None
        for first in range(0, 40, 8):
            small_sequences.play(slam, 8, first=first)
            autosave.save_now(everything=False)
        there = load_map(path).contents
        now = slam.map_contents()
    for (name, one), (_, other) in zip(there.patches.arrays(), now.patches.arrays(), strict=True):
        assert one.tobytes() == other.tobytes(), name
    # Entries whose observation has gone may still be in it; they do not count.
    counted = take_contents(restore_contents(there)).aligned
    for (name, one), (_, other) in zip(counted.arrays(), now.aligned.arrays(), strict=True):
        assert one.tobytes() == other.tobytes(), name
    np.testing.assert_array_equal(there.alignment_noise, now.alignment_noise)


@pytest.mark.parametrize("patches", [True, False])
def test_old_points_are_aligned_in_a_loaded_map(tmp_path: Path, patches: bool) -> None:
    path = written(tmp_path)
    if not patches:
        save_map(small_map(), path, patches=False)
    old = small_map().contents
    with small_sequences.new_system(Sensor.RGBD, load_map=path, deterministic=True) as slam:
        small_sequences.play(slam, 30, first=FRAMES - 10)
        new = slam.map_contents()
    assert_consistent(new)
    is_new = new.aligned.keyframe >= old.next_keyframe
    assert is_new.any()
    of_old_points = new.aligned.point[is_new] < old.next_point
    references = new.patches.keyframe[np.searchsorted(new.patches.point, new.aligned.point)]
    to_old_patches = is_new & (references < old.next_keyframe) & (new.aligned.variance > 0)
    assert of_old_points.any()
    assert (to_old_patches.sum() > 100) == patches


# ---- edits ---------------------------------------------------------------------------------------
def test_a_part_keeps_those_of_its_points(contents: MapContents) -> None:
    kept = np.arange(len(contents.keyframes)) != 2
    part = keep_keyframes(contents, kept)
    assert_consistent(part)
    assert 0 < len(part.patches) < len(contents.patches)
    dropped = int(contents.keyframes.ids[2])
    assert dropped not in part.patches.keyframe and dropped not in part.aligned.keyframe
    assert take_contents(restore_contents(part)).first_difference(part) is None


def test_a_part_without_the_first_keyframe(contents: MapContents) -> None:
    part = keep_keyframes(contents, np.arange(len(contents.keyframes)) > 1)
    assert part.keyframes.ids[0] == 0
    assert_consistent(part)
    assert take_contents(restore_contents(part)).first_difference(part) is None
    assert len(part.aligned) > 100


def test_a_move_leaves_them(contents: MapContents) -> None:
    R = core.Pose.exp(np.array([0.3, -0.2, 0.5, 0, 0, 0])).rotation_matrix
    moved = transform_map(contents, Similarity(1.0, R, np.array([1.0, 2.0, 3.0])))
    assert moved.patches is contents.patches and moved.aligned is contents.aligned


def test_maps_in_one_file_and_taken_out_again(saved: SavedMap) -> None:
    both = put_together([saved, saved])
    assert_consistent(both.contents)
    assert len(both.contents.patches) == 2 * len(saved.contents.patches)
    assert both.contents.patches.camera.max() == 1
    restore_contents(both.contents)
    alone = take_map(both, 1).contents
    assert_consistent(alone)
    np.testing.assert_array_equal(alone.patches.values, saved.contents.patches.values)
    np.testing.assert_array_equal(alone.aligned.position, saved.contents.aligned.position)
    np.testing.assert_array_equal(alone.alignment_noise, saved.contents.alignment_noise)


def test_patches_of_a_camera_that_is_gone_are_left_out(contents: MapContents) -> None:
    cameras = replace(
        contents.cameras,
        **{name: np.repeat(array, 2, axis=0) for name, array in contents.cameras.arrays()},
    )
    cameras.fx[1] += 1.0
    camera = contents.patches.camera.copy()
    camera[::2] = 1
    two = replace(contents, cameras=cameras, patches=replace(contents.patches, camera=camera))
    again = take_contents(restore_contents(two))
    np.testing.assert_array_equal(again.patches.point, contents.patches.point[1::2])
    assert len(again.cameras) == 1


# ---- bad input -----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("statement", "named"),
    [
        (
            "UPDATE patches SET grey_values = x'00' WHERE page = 2",
            "grey_values of patches 2 has the wrong length",
        ),
        ("UPDATE aligned SET variances = x'' WHERE keyframe = 0", "variances of aligned 0"),
        (
            "UPDATE patches SET keyframes = CAST(zeroblob(length(keyframes) - 1) || x'7F' AS BLOB)"
            " WHERE page = 2",
            "the patch of point .* is of keyframe",
        ),
        (
            "UPDATE patches SET cameras = "
            "CAST(zeroblob(length(cameras) - 8) || x'0300000000000000' AS BLOB) WHERE page = 2",
            "the patch of point .* has the camera 3",
        ),
        (
            "UPDATE patches SET points = zeroblob(length(points)) WHERE page = 2",
            "the patch of point 0 has no such point, or is out of order",
        ),
        (
            "UPDATE aligned SET keypoints = zeroblob(length(keypoints)) WHERE keyframe = 0",
            "aligned keypoint 0 of keyframe 0 has no such keyframe, or is out of order",
        ),
        (
            "UPDATE aligned SET variances = "
            "CAST(zeroblob(length(variances) - 4) || x'0000C07F' AS BLOB) WHERE keyframe = 0",
            "the aligned keypoint .* of keyframe 0 has a number out of range",
        ),
        ("UPDATE alignment_noise SET factor = 0.0", "noise of aligned sightings"),
        ("DELETE FROM alignment_noise WHERE id = 1", "other numbers than two"),
    ],
)
def test_what_is_damaged_is_named(tmp_path: Path, statement: str, named: str) -> None:
    path = edit(written(tmp_path), statement)
    with pytest.raises(MapFileError, match=named) as refused:
        load_map(path)
    assert path.name in str(refused.value) and "copy of the file" in str(refused.value)
    with pytest.raises(MapFileError, match=named):
        MapFile(path).check()
