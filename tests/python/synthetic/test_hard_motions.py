# SPDX-License-Identifier: BSD-3-Clause
"""Motions, bends and disturbances that are hard to follow: as described, and the same each time."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import SettingsError
from orbslam2py.synthetic import SyntheticMotion, SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory.rotations import rotation_angles

SMALL = (160, 120)


def made(**options) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(**{"size": SMALL, "frames": 200, "world": "corridor"} | options)
    )


def steps_of(sequence: SyntheticSequence) -> tuple[np.ndarray, np.ndarray]:
    """Metres and degrees from each frame to the next."""
    T_wc = sequence.ground_truth().T_wc
    relative = np.linalg.inv(T_wc[:-1]) @ T_wc[1:]
    return np.linalg.norm(relative[:, :3, 3], axis=1), np.degrees(
        rotation_angles(relative[:, :3, :3])
    )


@pytest.mark.parametrize("motion", SyntheticMotion)
def test_a_motion_is_the_same_each_time_and_begins_on_the_way(motion):
    once, again = made(motion=motion, seed=4), made(motion=motion, seed=4)
    np.testing.assert_array_equal(once.ground_truth().T_wc, again.ground_truth().T_wc)
    np.testing.assert_allclose(once.T_wc(0), made(seed=4).T_wc(0), atol=1e-12)
    if motion not in (SyntheticMotion.SMOOTH, SyntheticMotion.STAIRS):
        assert not np.array_equal(
            once.ground_truth().T_wc, made(motion=motion, seed=5).ground_truth().T_wc
        )


def test_turns_begin_at_once_and_are_up_to_six_degrees_a_frame():
    most = []
    for seed in range(5):
        _, smooth = steps_of(made(seed=seed))
        _, degrees = steps_of(made(motion="turns-at-once", seed=seed))
        jumps = np.abs(np.diff(degrees))
        most.append(degrees.max())
        assert (jumps > 1).sum() >= 4
        assert degrees.max() < 6 + smooth.max() + 0.3
    assert max(most) > 4


def test_stops_stand_still_and_go_on_at_the_usual_speed():
    metres, degrees = steps_of(made(motion="stops"))
    usual, _ = steps_of(made())
    still = metres < 1e-9
    assert 0.15 < still.mean() < 0.7
    assert degrees[still].max() < 1e-5  # the angle of a rotation is not known better than that
    assert np.median(metres[~still]) == pytest.approx(np.median(usual), rel=0.1)
    assert len(made(motion="stops", frames=None)) > 1.2 * len(made(frames=None))


def test_turns_on_the_spot_stay_there_and_reach_a_hundred_degrees_a_second():
    fastest = []
    for seed in range(5):
        sequence = made(motion="turn-on-the-spot", seed=seed)
        metres, degrees = steps_of(sequence)
        turning = degrees > 1.9
        assert turning.sum() > 10
        assert np.median(metres[turning]) < 1e-9
        fastest.append(degrees.max() * sequence.camera.fps)
    assert 90 < max(fastest) < 121


def test_shaking_trembles_about_the_way():
    smooth, shaken = (made(motion=motion).ground_truth().T_wc for motion in ("smooth", "shakes"))
    aside = np.linalg.inv(smooth) @ shaken
    angles = np.degrees(rotation_angles(aside[:, :3, :3]))
    assert 1.0 < angles.max() < 2.0 * np.sqrt(3)
    assert 0.005 < np.abs(aside[:, :3, 3]).max() < 0.02


def test_stairs_go_up_and_down_by_steps():
    smooth, climbing = (made(motion=motion).ground_truth().T_wc for motion in ("smooth", "stairs"))
    height = smooth[:, 1, 3] - climbing[:, 1, 3]
    assert height.min() == pytest.approx(0, abs=1e-9)
    assert height.max() == pytest.approx(4 * 0.17, abs=0.01)
    _, degrees = steps_of(made(motion="stairs"))
    assert degrees.max() > 1


def test_sharp_corners_turn_at_once_where_round_ones_turn_early():
    for world, seconds in (("street-block", None), ("corridor", 8)):
        frames = None if seconds is None else 20 * seconds
        (_, round_), (_, sharp) = (
            steps_of(made(world=world, frames=frames, corners=corners))
            for corners in ("round", "sharp")
        )
        assert np.abs(np.diff(sharp)).max() > 4 * np.abs(np.diff(round_)).max()
        positions = [
            made(world=world, corners=corners).ground_truth().positions
            for corners in ("round", "sharp")
        ]
        assert np.linalg.norm(positions[0] - positions[1], axis=1).max() < 0.1
    straight = made(world="street-block", corners="sharp", frames=30).ground_truth().T_wc
    np.testing.assert_allclose(
        straight, made(world="street-block", frames=30).ground_truth().T_wc, atol=1e-6
    )


def test_the_pace_multiplies_the_speed_in_every_world():
    for world in ("room", "corridor", "table-top"):
        usual, quick = made(world=world, frames=None), made(world=world, frames=None, pace=2.0)
        assert len(quick) == pytest.approx(len(usual) / 2, abs=2)
        np.testing.assert_allclose(quick.T_wc(20), usual.T_wc(40), atol=1e-12)


# ---- the lens ------------------------------------------------------------------------------------
def gradients(image: np.ndarray) -> tuple[float, float]:
    values = image.astype(float)
    return np.abs(np.diff(values, axis=1)).mean(), np.abs(np.diff(values, axis=0)).mean()


def test_blur_smears_along_the_motion():
    options = {"motion": "turn-on-the-spot", "world": "room"}
    sequence, smeared = made(**options), made(**options, blur=1.0)
    _, degrees = steps_of(sequence)
    turning = int(np.argmax((degrees > 2) & (np.roll(degrees, -1) > 2))) + 1
    across, down = np.divide(
        gradients(smeared.load(turning).image), gradients(sequence.load(turning).image)
    )
    assert across < 0.75 * down
    assert across < 0.6
    slow = made(world="room", blur=1.0, pace=0.01)
    difference = slow.load(1).image.astype(int) - made(world="room", pace=0.01).load(1).image
    assert np.abs(difference).max() <= 2


def test_blur_is_the_average_of_what_is_seen_meanwhile():
    still = made(world="wall", fps=10, frames=4)
    smeared = made(world="wall", fps=10, frames=4, blur=1.0)
    fine = made(world="wall", fps=320, frames=200)
    seen = np.mean([fine.load(i).image.astype(float) for i in range(32 - 16, 32 + 17)], axis=0)
    error = np.abs(smeared.load(1).image - seen)[:, 8:-8]
    assert np.percentile(error, 95) < 6
    assert error.mean() < 0.4 * np.abs(still.load(1).image - seen)[:, 8:-8].mean()


def test_both_eyes_are_smeared_and_exposed_alike():
    sequence = made(sensor="stereo", world="wall", blur=1.0, exposure=(0.5, 1.5), fps=5)
    for i in (3, 9):
        images = sequence.load(i)
        assert images.image.mean() == pytest.approx(images.right.mean(), rel=0.05)


def test_exposure_jumps_between_frames_and_stays_in_its_limits():
    usual, jumping = made(world="wall"), made(world="wall", exposure=(0.4, 1.2))
    factors = np.array(
        [jumping.load(i).image.mean() / usual.load(i).image.mean() for i in range(0, 200, 4)]
    )
    assert 0.39 < factors.min() < 0.6
    assert 0.8 < factors.max() < 1.21
    changes = np.abs(np.diff(factors)) > 0.01
    assert 5 <= changes.sum() <= 20


def test_a_hand_covers_the_lens_in_the_middle():
    sequence = made(sensor="rgbd", cover=1.0)
    covered = [sequence.covered(i) for i in range(len(sequence))]
    first, last = covered.index(True), len(covered) - covered[::-1].index(True)
    assert covered[first:last] == [True] * (last - first)
    assert (last - first) / sequence.camera.fps == pytest.approx(1.3, abs=0.11)
    assert (first + last) / 2 == pytest.approx(100, abs=1)
    images = sequence.load(100)
    assert images.image.max() < 60
    assert gradients(images.image)[0] < 0.5
    assert not images.depth.any()
    assert not any(made().covered(i) for i in range(200))
    with pytest.raises(IndexError):
        sequence.covered(200)


@pytest.mark.parametrize(
    ("cover", "why"),
    [
        ((50.0, 1.0), r"begins at 50 s .* 20 images ends at 0\.95 s: no image would be covered"),
        (100.0, r"is 100 s, .* ends at 0\.95 s: it would be dark all the time; give less"),
        ((0.0, 2.0), "dark all the time"),
    ],
)
def test_a_hand_that_covers_nothing_or_all_is_refused(cover, why):
    with pytest.raises(SettingsError, match=why):
        made(frames=20, cover=cover)


def test_a_hand_may_come_before_the_last_image_and_stay():
    assert made(frames=20, cover=(0.9, 50.0)).covered(19)
    assert not made(frames=20, cover=(0.9, 50.0)).covered(10)


def test_the_door_slides_before_the_cabin():
    sequence = made(world="lift-door", frames=None)
    fps = sequence.camera.fps
    shut, open_ = (sequence.exact_depth(round(s * fps)) for s in (1.0, 5.0))
    middle = (slice(55, 65), slice(77, 83))
    assert shut[middle].max() < 2.0
    assert open_[middle].min() > 2.5
    assert (np.abs(shut - open_) < 0.3).mean() > 0.5  # the wall beside it
