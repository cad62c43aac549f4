# SPDX-License-Identifier: BSD-3-Clause
"""Parts of saved maps: frames and images go with the keyframes they belong to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orbslam2py.maps import RemovedKeyframes, SavedMap, crop_saved_map, transform_map
from orbslam2py.maps.edits.parts import map_numbers, put_together
from orbslam2py.trajectory import Similarity
from support.made_up_map import made_up_map
from support.made_up_saved import FRAMES_PER_KEYFRAME, made_up_saved
from support.map_invariants import check_invariants


@pytest.fixture
def saved() -> SavedMap:
    """Keyframe 6 was culled, and hangs on 5; frames hang on it still."""
    contents = made_up_map(8)
    one = np.ones(1)
    removed = RemovedKeyframes(
        np.array([9]), np.array([5]), np.array([[0, 0, 0, 1.0]]), np.zeros((1, 3)), one, one
    )
    contents = replace(contents, removed_keyframes=removed, next_keyframe=10)
    made = made_up_saved(contents, images=True)
    frames = made.runs[0].frames
    frames = replace(frames, keyframes=np.where(frames.keyframes == 6, 9, frames.keyframes))
    return replace(made, runs=(replace(made.runs[0], frames=frames),))


def world_positions(saved: SavedMap) -> dict[float, np.ndarray]:
    """Where the frames of the run were in the map's world, by time stamp."""
    path = saved.trajectory()
    T_wc = saved.contents.keyframes.T_wc[0] @ path.T_wc
    return dict(zip(path.timestamps.tolist(), T_wc[:, :3, 3], strict=True))


@pytest.mark.parametrize("first", [0, 2])
def test_frames_stay_where_they_were(saved: SavedMap, first: int) -> None:
    kept = np.arange(8) >= first
    kept[7] = False
    cropped = crop_saved_map(saved, kept)
    check_invariants(cropped.contents)
    before, after = world_positions(saved), world_positions(cropped)
    # Those of the keyframes that went are missing; those of the culled one hang on 5, which stayed.
    assert len(after) == (7 - first) * FRAMES_PER_KEYFRAME
    for time, position in after.items():
        np.testing.assert_allclose(position, before[time], atol=1e-12)


def test_images_keep_their_keyframes(saved: SavedMap) -> None:
    cropped = crop_saved_map(saved, np.arange(8) >= 2)
    assert sorted(cropped.images) == [0, 3, 4, 5, 6, 7]  # 2 is the new 0
    assert cropped.images[0] == saved.images[2]
    assert cropped.images[3] == saved.images[3]


def test_frames_that_hang_on_what_went_are_left_out(saved: SavedMap) -> None:
    cropped = crop_saved_map(saved, np.arange(8) < 5)  # 5 went, and the culled one with it
    assert len(cropped.contents.removed_keyframes) == 0
    assert set(cropped.runs[0].frames.keyframes.tolist()) == {0, 1, 2, 3, 4}


def test_frames_of_several_maps_stay_in_theirs() -> None:
    both = put_together([made_up_saved(made_up_map(6, seed=seed), images=True) for seed in (1, 2)])
    cropped = crop_saved_map(both, ~np.isin(np.arange(12), [0, 2, 6]))
    assert np.bincount(map_numbers(cropped.contents.keyframes)).tolist() == [4, 5]
    assert sorted(cropped.images) == [0, 3, 4, 5, 7, 8, 9, 10, 11]
    for number, first in enumerate((1, 7)):
        before, after = both.trajectory(number), cropped.trajectory(number)
        stay = np.isin(before.timestamps, after.timestamps)
        assert len(after) == (4 + number) * FRAMES_PER_KEYFRAME == stay.sum()
        # Paths are relative to the first keyframe of their map, which has become another one.
        T_wc = both.contents.keyframes.T_wc
        moved = np.linalg.inv(T_wc[first]) @ T_wc[6 * number] @ before.T_wc[stay]
        np.testing.assert_allclose(after.T_wc, moved, atol=1e-12)


def test_frames_follow_a_change_of_size(saved: SavedMap) -> None:
    """What a frame is away from its keyframe grows with the map."""
    similarity = Similarity(3.0, np.eye(3), np.array([1.0, 2.0, 3.0]))
    moved = replace(saved, contents=transform_map(saved.contents, similarity))
    after = world_positions(moved)
    for time, position in world_positions(saved).items():
        np.testing.assert_allclose(after[time], similarity.apply(position[None])[0], atol=1e-9)
