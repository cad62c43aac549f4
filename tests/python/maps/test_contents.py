# SPDX-License-Identifier: BSD-3-Clause
"""Everything that a map is, as arrays, and back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from orbslam2py import MapFileError, Sensor
from orbslam2py import _core as core
from orbslam2py.maps import MapContents, restore_contents, take_contents
from orbslam2py.maps.map_copies import take_changes
from orbslam2py.maps.schema import IDS_PER_PAGE
from support import small_sequences
from support.saved_maps import small_map


@pytest.fixture(scope="module")
def contents() -> MapContents:
    return small_map().contents


def test_contents_agree_with_the_snapshot_of_the_same_moment() -> None:
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        small_sequences.play(slam, 30)
        contents, snapshot = slam.map_contents(), slam.map_snapshot()
        keyframes = contents.keyframes
        assert np.array_equal(keyframes.ids, snapshot.keyframe_ids)
        assert np.allclose(keyframes.T_wc, snapshot.keyframe_T_wc, atol=1e-12)
        assert np.array_equal(contents.points.positions, snapshot.point_positions)
        assert keyframes.offsets[-1] == len(keyframes.keypoints) == len(keyframes.descriptors)
        assert len(contents.observations) > len(contents.points) > 100


def test_observations_are_seen_where_the_points_project(contents: MapContents) -> None:
    keyframes, cameras = contents.keyframes, contents.cameras
    row = len(keyframes) - 1
    points, keypoints = contents.observations_in_keyframe(int(keyframes.ids[row]))
    X = contents.points.positions[np.searchsorted(contents.points.ids, points)]
    T_cw = keyframes.T_cw[row]
    p_c = X @ T_cw[:3, :3].T + T_cw[:3, 3]
    u = cameras.fx[0] * p_c[:, 0] / p_c[:, 2] + cameras.cx[0]
    seen = keyframes.keypoints[keyframes.keypoints_of(row)][keypoints]
    assert len(points) > 50
    assert np.median(np.abs(u - seen[:, 0])) < 2.0


def test_observations_of_a_point_name_its_reference_keyframe(contents: MapContents) -> None:
    for row in (0, len(contents.points) // 2, -1):
        keyframes, keypoints = contents.observations_of_point(int(contents.points.ids[row]))
        assert contents.points.reference_keyframe[row] in keyframes
        assert len(keyframes) == len(keypoints)
    assert len(contents.observations_of_point(10**9)[0]) == 0


@pytest.mark.parametrize("sensor", [Sensor.RGBD, Sensor.STEREO])
def test_a_restored_map_is_the_same_bit_by_bit(sensor: Sensor) -> None:
    contents = small_map(sensor).contents
    restored = restore_contents(contents)
    again = take_contents(restored)
    assert contents.first_difference(again) is None
    assert contents.content_hash() == again.content_hash()
    assert core.check_invariants(restored, require_words=False) == []


def test_the_hash_of_the_map_survives() -> None:
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        small_sequences.play(slam, 30)
        assert int(restore_contents(slam.map_contents()).content_hash()) == slam.map_hash()


def test_known_keyframes_come_without_their_keypoints() -> None:
    slam_map = restore_contents(small_map().contents)
    whole = take_contents(slam_map)
    ids = whole.keyframes.ids
    part = take_changes(slam_map, ids[:-1], None).contents
    assert np.array_equal(part.keyframes.ids, ids)
    assert np.all(np.diff(part.keyframes.offsets)[:-1] == 0)
    last = whole.keyframes.keypoints_of(len(ids) - 1)
    assert np.array_equal(part.keyframes.descriptors, whole.keyframes.descriptors[last])


def test_only_points_on_pages_with_a_change_are_copied_again() -> None:
    slam_map = restore_contents(small_map().contents)
    nothing = np.zeros(0, np.int64)
    first = take_changes(slam_map, nothing, None)
    again = take_changes(slam_map, nothing, first)
    assert len(again.contents.points) == len(again.pages) == 0
    assert not again.changed_keyframes.any()
    moved = int(first.contents.points.ids[-1])
    slam_map.set_position(moved, np.ones(3))
    later = take_changes(slam_map, nothing, again)
    assert later.pages.tolist() == [moved // IDS_PER_PAGE]
    assert moved in later.contents.points.ids
    assert set(later.contents.points.ids // IDS_PER_PAGE) == {moved // IDS_PER_PAGE}


def test_a_map_is_restored_into_an_empty_one_only(contents: MapContents) -> None:
    slam_map = restore_contents(contents)
    with pytest.raises(Exception, match="empty one only"):
        restore_contents(contents, slam_map)


def test_moved_keyframes_have_the_poses_they_were_given(contents: MapContents) -> None:
    T_cw = contents.keyframes.T_cw.copy()
    T_cw[:, 0, 3] += 1.0
    moved = contents.keyframes.with_poses(T_cw)
    assert np.allclose(moved.T_cw, T_cw, atol=1e-12)


def _changed(contents: MapContents, group: str, field: str, row: object, value: object) -> object:
    array = getattr(getattr(contents, group), field).copy()
    array[row] = value
    part = dataclasses.replace(getattr(contents, group), **{field: array})
    return dataclasses.replace(contents, **{group: part})


@pytest.mark.parametrize(
    ("group", "field", "row", "value", "named"),
    [
        ("keyframes", "rotations", 1, np.nan, "pose of keyframe"),
        ("keyframes", "rotations", 1, 2.0, "pose of keyframe"),
        ("keyframes", "translations", 1, np.inf, "pose of keyframe"),
        ("keyframes", "parent", 1, 10**6, "parent"),
        ("keyframes", "parent", 1, 1, "ancestor"),
        ("keyframes", "parent", 0, 1, "keyframe 0"),
        ("keyframes", "ids", 1, 0, "id"),
        ("keyframes", "ids", 0, -1, "id"),
        ("keyframes", "ids", -1, 2**62, "id"),
        ("keyframes", "camera", 0, 7, "camera"),
        ("keyframes", "camera", 0, -1, "camera"),
        ("keyframes", "offsets", 1, 10**9, "keypoints"),
        ("keyframes", "offsets", 0, -5, "keypoints"),
        ("keyframes", "octave", 3, 200, "keypoint 3"),
        ("keyframes", "angle", 3, np.nan, "keypoint 3"),
        ("keyframes", "angle", 3, 400, "keypoint 3"),
        ("keyframes", "keypoints", 3, np.inf, "keypoint 3"),
        ("keyframes", "depth", 3, -3, "keypoint 3"),
        ("keyframes", "scale", 0, 0, "scale"),
        ("keyframes", "timestamps", 0, np.nan, "time stamp"),
        ("points", "ids", 1, 0, "id"),
        ("points", "positions", 1, np.nan, "point"),
        ("points", "mean_directions", 1, 3.0, "point"),
        ("points", "max_distance", 1, -1.0, "point"),
        ("points", "n_visible", 1, 0, "point"),
        ("points", "n_found", 1, 2**31 - 1, "point"),
        ("points", "reference_keyframe", 1, 10**6, "reference"),
        ("points", "first_keyframe", 1, -1, "point"),
        ("observations", "keyframe", 1, 10**6, "keyframe"),
        ("observations", "keypoint", 1, -1, "keypoint"),
        ("observations", "keypoint", 1, 10**6, "keypoint"),
        ("observations", "point", 0, 10**6, "point"),
        ("covisibility", "a", 0, 10**6, "covisibility"),
        ("covisibility", "weight", 0, 0, "covisibility"),
        ("cameras", "fx", 0, -1.0, "camera 0"),
        ("cameras", "width", 0, 2**40, "pixels"),
        ("cameras", "n_levels", 0, 100, "pyramid"),
        ("cameras", "scale_factor", 0, np.nan, "pyramid"),
    ],
)
def test_impossible_contents_are_refused_before_anything_is_made(
    contents: MapContents, group: str, field: str, row: object, value: object, named: str
) -> None:
    spoilt = _changed(contents, group, field, row, value)
    slam_map = core.Map()
    with pytest.raises(MapFileError, match=named):
        restore_contents(spoilt, slam_map)  # type: ignore[arg-type]
    assert slam_map.n_keyframes == 0
    restore_contents(contents, slam_map)


def test_huge_ids_are_refused(contents: MapContents) -> None:
    for field in ("next_point", "next_keyframe"):
        with pytest.raises(MapFileError, match="next"):
            restore_contents(dataclasses.replace(contents, **{field: 2**50}))
