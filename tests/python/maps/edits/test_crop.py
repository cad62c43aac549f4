# SPDX-License-Identifier: BSD-3-Clause
"""Parts of maps: whatever is cut off, a consistent map is left."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from orbslam2py import MapFileError
from orbslam2py import _core as core
from orbslam2py.maps import (
    Covisibility,
    MapContents,
    RemovedKeyframes,
    crop_to_box,
    crop_to_times,
    keep_keyframes,
    restore_contents,
)
from orbslam2py.maps.edits.parts import map_numbers, put_together
from orbslam2py.maps.edits.spanning_tree import count_covisibility, spanning_parents
from support.made_up_map import FIRST_TIME, STEP, counted, made_up_map
from support.made_up_saved import made_up_saved
from support.map_invariants import check_invariants

FAR = np.array([9.0, 9.0, 9.0])


def weights(contents: MapContents) -> dict[int, int]:
    """Weighted number of observations of every point."""
    weight = np.where(contents.keyframes.depth[contents.observed_keypoints] > 0, 2, 1)
    point, inverse = np.unique(contents.observations.point, return_inverse=True)
    return dict(zip(point.tolist(), np.bincount(inverse, weight).tolist(), strict=True))


@hypothesis_settings(deadline=None, max_examples=60)
@given(
    n=st.integers(2, 10),
    seed=st.integers(0, 50),
    depth=st.booleans(),
    lens=st.booleans(),
    data=st.data(),
)
def test_any_crop_is_a_map(n: int, seed: int, depth: bool, lens: bool, data: st.DataObject) -> None:
    kinds = {"depth": depth, "colours": depth, "lens": (-0.1, 0, 0, 0, 0.0) if lens else None}
    contents = made_up_map(n, 60, seed=seed, **kinds)  # type: ignore[arg-type]
    check_invariants(contents)
    kept = np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n).filter(any)))
    cropped = keep_keyframes(contents, kept)
    check_invariants(cropped)
    assert len(cropped.keyframes) == kept.sum()
    np.testing.assert_array_equal(cropped.keyframes.frame_ids, contents.keyframes.frame_ids[kept])
    # Every point that is left has lost nothing, or has more than what a point dies of.
    before, after = weights(contents), weights(cropped)
    for point, weight in after.items():
        assert weight == before[point] or weight > 2
    # And no other has gone.
    there = kept[np.searchsorted(contents.keyframes.ids, contents.observations.keyframe)]
    worth = np.where(contents.keyframes.depth[contents.observed_keypoints] > 0, 2, 1)
    for point in set(before) - set(after):
        assert worth[(contents.observations.point == point) & there].sum() <= 2


@hypothesis_settings(deadline=None, max_examples=20)
@given(n=st.integers(1, 9), seed=st.integers(0, 50))
def test_keeping_everything_changes_nothing(n: int, seed: int) -> None:
    contents = made_up_map(max(n, 2), 50, seed=seed, depth=bool(seed % 2))
    cropped = keep_keyframes(contents, np.ones(len(contents.keyframes), bool))
    assert cropped.first_difference(contents) is None


def test_cropping_twice_is_cropping_to_both() -> None:
    contents = made_up_map(9)
    begin, end = FIRST_TIME + 1.5 * STEP, FIRST_TIME + 6.5 * STEP
    late = crop_to_times(contents, begin, np.inf)
    assert late.keyframes.ids.tolist() == [0, 3, 4, 5, 6, 7, 8]  # 2 has become the root
    both = crop_to_times(late, -np.inf, end)
    assert both.keyframes.timestamps.tolist() == contents.keyframes.timestamps[2:7].tolist()
    check_invariants(both)


def test_what_stays_is_what_it_was() -> None:
    contents = made_up_map(8, lens=(-0.2, 0.0, 0.0, 0.0, 0.0), depth=True, colours=True)
    kept = np.arange(8) % 2 == 0
    cropped = keep_keyframes(contents, kept)
    for name in ("keypoints", "raw_keypoints", "descriptors", "depth", "colours", "octave"):
        old, new = getattr(contents.keyframes, name), getattr(cropped.keyframes, name)
        for row, number in enumerate(cropped.keyframes.ids.tolist()):
            expected = old[contents.keyframes.keypoints_of(contents.keyframes.row_of(number))]
            np.testing.assert_array_equal(new[cropped.keyframes.keypoints_of(row)], expected)
    rows = np.searchsorted(contents.points.ids, cropped.points.ids)
    np.testing.assert_array_equal(cropped.points.positions, contents.points.positions[rows])
    for point in cropped.points.ids.tolist():
        seers, keypoints = contents.observations_of_point(point)
        left = np.isin(seers, cropped.keyframes.ids)
        found = cropped.observations_of_point(point)
        np.testing.assert_array_equal(found[0], seers[left])
        np.testing.assert_array_equal(found[1], keypoints[left])


def test_a_new_reference_keyframe_gives_the_distances() -> None:
    contents = made_up_map(6)
    kept = np.arange(6) > 0
    cropped = keep_keyframes(contents, kept)
    lost = np.isin(cropped.points.ids, contents.points.ids[contents.points.reference_keyframe == 0])
    assert lost.any()
    keyframes, points = cropped.keyframes, cropped.points
    centres = keyframes.T_wc[:, :3, 3]
    for row in np.flatnonzero(lost):
        seers, keypoints = cropped.observations_of_point(int(points.ids[row]))
        assert points.reference_keyframe[row] == seers[0]
        seer = keyframes.row_of(int(seers[0]))
        level = keyframes.octave[keyframes.offsets[seer] + keypoints[0]]
        distance = np.linalg.norm(points.positions[row] - centres[seer])
        assert points.max_distance[row] == pytest.approx(distance * 1.2**level, rel=1e-6)
        assert points.max_distance[row] / points.min_distance[row] == pytest.approx(1.2**7)


def test_box_of_cameras_and_of_points() -> None:
    contents = made_up_map(8)
    low, high = np.array([-1.0, -1, -1]), np.array([1.0, 1.0, 4.0])
    cameras = crop_to_box(contents, low, high)
    x = cameras.keyframes.T_wc[:, 0, 3]
    assert np.all(x <= 1.0)
    assert 0 < len(x) < 8
    assert np.any(cameras.points.positions[:, 2] > 4.0)
    points = crop_to_box(contents, low, high, points_too=True)
    check_invariants(points)
    assert len(points.keyframes) == len(x)
    assert points.points.positions[:, 2].max() <= 4.0
    assert 0 < len(points.points) < len(cameras.points)


def test_removed_keyframes_stay_while_what_they_hang_on_does() -> None:
    contents = made_up_map(6)
    ids = np.array([10, 11, 12, 13])
    chain = RemovedKeyframes(
        ids, np.array([2, 10, 5, 12]), np.tile([0, 0, 0, 1.0], (4, 1)), np.zeros((4, 3)),
        np.ones(4), np.ones(4),
    )  # fmt: skip
    contents = replace(contents, removed_keyframes=chain, next_keyframe=14)
    check_invariants(contents)
    cropped = keep_keyframes(contents, np.arange(6) < 4)
    check_invariants(cropped)
    assert cropped.removed_keyframes.ids.tolist() == [10, 11]


def test_orphans_hang_on_whom_they_share_most_with() -> None:
    contents = made_up_map(7)
    # A chain, of which one in the middle goes.
    chain = replace(contents.keyframes, parent=np.arange(-1, 6))
    cropped = keep_keyframes(replace(contents, keyframes=chain), np.arange(7) != 3)
    edges = cropped.covisibility
    shared = {
        int(a + b - 4): int(weight)
        for a, b, weight in zip(edges.a, edges.b, edges.weight, strict=True)
        if 4 in (a, b) and a + b - 4 not in (5, 6)  # those are below it
    }
    parent = int(cropped.keyframes.parent[cropped.keyframes.row_of(4)])
    assert shared[parent] == max(shared.values())
    assert not cropped.keyframes.provisional_parent.any()


def test_a_keyframe_that_shares_nothing_hangs_provisionally() -> None:
    contents = made_up_map(4)
    alone = contents.observations.keyframe == 2
    seen = replace(
        contents.observations,
        **{name: array[~alone] for name, array in contents.observations.arrays()},
    )
    seen_points = np.isin(contents.points.ids, seen.point)
    points = replace(
        contents.points,
        **{name: array[seen_points] for name, array in contents.points.arrays()},
    )
    first = seen.keyframe[np.searchsorted(seen.point, points.ids)]
    points = replace(points, reference_keyframe=first)
    tree = replace(contents.keyframes, parent=np.array([-1, 0, 1, 0]))
    bare = replace(contents, observations=seen, points=points, keyframes=tree)
    bare = replace(bare, covisibility=count_covisibility(seen, tree.ids))
    check_invariants(bare)
    cropped = keep_keyframes(bare, np.array([True, False, True, True]))
    row = cropped.keyframes.row_of(2)
    assert cropped.keyframes.parent[row] == 0
    assert cropped.keyframes.provisional_parent[row]
    check_invariants(cropped)


@hypothesis_settings(deadline=None, max_examples=20)
@given(n=st.integers(2, 9), seed=st.integers(0, 99))
def test_shared_points_are_counted(n: int, seed: int) -> None:
    contents = made_up_map(n, 40, seed=seed)
    expected = counted(contents.observations)
    found = count_covisibility(contents.observations, contents.keyframes.ids)
    for name in ("a", "b", "weight"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        assert getattr(found, name).dtype == getattr(expected, name).dtype


# ---- several maps --------------------------------------------------------------------------------
def several_maps(*sizes: int, seed: int = 0) -> MapContents:
    """Maps of so many keyframes, each in its own world frame."""
    maps = [made_up_map(n, 60, seed=seed + number) for number, n in enumerate(sizes)]
    return put_together([made_up_saved(contents) for contents in maps]).contents


@hypothesis_settings(deadline=None, max_examples=40)
@given(
    sizes=st.lists(st.integers(2, 6), min_size=2, max_size=3),
    seed=st.integers(0, 50),
    data=st.data(),
)
def test_maps_stay_apart(sizes: list[int], seed: int, data: st.DataObject) -> None:
    contents = several_maps(*sizes, seed=seed)
    numbers, n = map_numbers(contents.keyframes), sum(sizes)
    kept = np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n).filter(any)))
    cropped = keep_keyframes(contents, kept)
    assert core.check_invariants(restore_contents(cropped), require_words=False) == []
    left, expected = np.unique(numbers[kept], return_inverse=True)
    found = map_numbers(cropped.keyframes)
    np.testing.assert_array_equal(found, expected)
    # What is left of each is what cropping it alone gives, but for who made points: the number 0 is
    # given away twice there.
    for place, number in enumerate(left):
        alone = keep_keyframes(contents, numbers == number)
        both = (
            keep_keyframes(cropped, found == place),
            keep_keyframes(alone, kept[numbers == number]),
        )
        one, other = (
            replace(
                part, points=replace(part.points, first_keyframe=part.points.reference_keyframe)
            )
            for part in both
        )
        assert one.first_difference(other) is None


def test_keeping_all_of_several_maps_changes_nothing() -> None:
    contents = several_maps(5, 2, 7)
    everything = np.ones(14, bool)
    assert keep_keyframes(contents, everything).first_difference(contents) is None
    assert crop_to_times(contents, -np.inf, np.inf).first_difference(contents) is None
    assert crop_to_box(contents, -FAR, FAR).first_difference(contents) is None


def test_a_root_that_went_is_followed_by_the_first_of_its_map() -> None:
    cropped = keep_keyframes(several_maps(4, 4), ~np.isin(np.arange(8), [0, 4]))
    keyframes = cropped.keyframes
    assert keyframes.ids.tolist() == [0, 2, 3, 5, 6, 7]
    assert keyframes.ids[keyframes.parent < 0].tolist() == [0, 5]
    assert not keyframes.provisional_parent[keyframes.parent < 0].any()


def test_who_shares_nothing_hangs_on_the_keyframe_before_it_in_its_own_map() -> None:
    """Of two maps that were made by turns: 0, 1, 4, 5 and 2, 3."""
    keyframes = replace(
        made_up_map(6).keyframes,
        parent=np.array([-1, 0, -1, 2, 1, 4]),
        provisional_parent=np.array([False, True, False, True, False, False]),
    )
    left = np.array([0, 2, 3, 4, 5])
    keyframes = replace(
        keyframes,
        ids=keyframes.ids[left],
        parent=keyframes.parent[left],
        provisional_parent=keyframes.provisional_parent[left],
    )
    nothing = np.zeros(0, np.int64)
    nobody = Covisibility(nothing, nothing, nothing.astype(np.int32))
    parents, provisional = spanning_parents(keyframes, nobody, np.array([0, 1, 1, 0, 0]))
    assert parents.tolist() == [-1, -1, 2, 0, 4]
    assert provisional.tolist() == [False, False, True, True, False]


# ---- nothing left --------------------------------------------------------------------------------
def test_nothing_left() -> None:
    contents = made_up_map()
    with pytest.raises(MapFileError, match=r"no keyframe is of 1\.0+ to 2\.0+ s; they are of 1305"):
        crop_to_times(contents, 1.0, 2.0)
    with pytest.raises(MapFileError, match=r"box from \(9, 9, 9\) to \(9, 9, 9\); they stood in"):
        crop_to_box(contents, FAR, FAR)
    with pytest.raises(MapFileError, match="at least one"):
        keep_keyframes(contents, np.zeros(8, bool))
