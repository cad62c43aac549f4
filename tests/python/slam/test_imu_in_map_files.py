# SPDX-License-Identifier: BSD-3-Clause
"""A run with an IMU is saved, loaded and continued."""

from __future__ import annotations

from functools import lru_cache
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import System
from orbslam2py.maps import SavedMap, load_map
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.imu_states import velocities

pytestmark = pytest.mark.watchdog(200)

FIRST_PART = 110


@lru_cache
def sequence() -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor="stereo", frames=180, size=(320, 240), motion="shakes",
            imu=True, imu_noise="bmi088",
        )
    )  # fmt: skip


def play(slam: System, begin: int, end: int) -> None:
    with_imu = slam.pipeline.inertial.settings is not None
    for frame in islice(sequence(), begin, end):
        slam.track(frame.images, frame.timestamp, imu=frame.imu if with_imu else None)


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> SavedMap:
    """The map of the first part, as it comes back from a file that grew."""
    path = tmp_path_factory.mktemp("maps") / "first.orbmap"
    settings = sequence().default_settings()
    with System(settings, "stereo", imu=sequence().imu_settings(), deterministic=True) as slam:
        slam.autosave(path, every=1000)
        for end in range(30, FIRST_PART + 1, 20):
            play(slam, end - 20 if end > 30 else 0, end)
            slam.pipeline.keeper._autosave.save_now(everything=False)  # type: ignore[union-attr]
        contents = slam.map_contents()
    saved = load_map(path, images=True)
    assert contents.first_difference(saved.contents) is None
    return saved


def test_velocities_and_samples_are_those_of_the_motion(saved: SavedMap) -> None:
    states, keyframes = saved.contents.imu_states, saved.contents.keyframes
    assert len(states) > 4
    assert saved.contents.upright_roots == (0,)
    made = sequence().imu()
    assert made is not None
    truth = sequence().ground_truth()
    for row, velocity in enumerate(velocities(saved.contents)):
        time = keyframes.timestamps[np.searchsorted(keyframes.ids, states.ids[row])]
        at = int(np.argmin(np.abs(truth.timestamps - time)))
        step = truth.timestamps[at + 1] - truth.timestamps[at - 1]
        speed = np.linalg.norm(truth.positions[at + 1] - truth.positions[at - 1]) / step
        assert np.linalg.norm(velocity) == pytest.approx(speed, abs=0.25)
    assert len(states.samples) > 100
    inside = np.isin(np.round(made.timestamps, 6), np.round(states.samples[:, 0], 6))
    assert inside.sum() > 0.8 * len(states.samples)


def test_the_next_run_begins_with_the_biases_of_the_file(saved: SavedMap, tmp_path: Path) -> None:
    path = tmp_path / "second.orbmap"
    before = saved.contents.imu_states
    with System(load_map=saved, imu=sequence().imu_settings(), deterministic=True) as slam:
        tracker = slam.pipeline.inertial_tracker
        assert tracker is not None
        np.testing.assert_array_equal(tracker._bias, before.bias[-1])
        assert tracker._bias_deviations == (0.01, 0.05)
        # The same times once more: the samples of the file are no older ones of this run.
        play(slam, FIRST_PART - 50, 180)
        assert tracker.filter is not None
        slam.save_map(path)
    after = load_map(path).contents.imu_states
    new = after.ids >= saved.contents.next_keyframe
    assert new.sum() > 2
    first = int(np.flatnonzero(new)[0])
    assert after.offsets[first] == after.offsets[first + 1], "nothing joins the two runs"
    assert (np.diff(after.offsets)[new] > 0).sum() == new.sum() - 1
    old = np.searchsorted(before.ids, after.ids[~new])
    np.testing.assert_array_equal(before.ids[old], after.ids[~new])
    np.testing.assert_array_equal(before.velocity[old], after.velocity[~new])


def test_a_run_without_an_imu_keeps_what_there_is(saved: SavedMap, tmp_path: Path) -> None:
    path = tmp_path / "second.orbmap"
    with System(load_map=saved, deterministic=True) as slam:
        assert slam.pipeline.inertial_tracker is None
        slam.localization_mode = True
        play(slam, FIRST_PART - 20, FIRST_PART)
        slam.save_map(path)
    for (name, one), (_, other) in zip(
        saved.contents.imu_states.arrays(),
        load_map(path).contents.imu_states.arrays(),
        strict=True,
    ):
        assert one.tobytes() == other.tobytes(), name


def test_a_reset_drops_them(saved: SavedMap) -> None:
    with System(load_map=saved, deterministic=True) as slam:
        slam.reset()
        play(slam, 0, 2)
        assert len(slam.map_contents().imu_states) == 0
        assert len(slam.map_contents().keyframes) > 0
