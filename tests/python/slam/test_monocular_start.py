# SPDX-License-Identifier: BSD-3-Clause
"""A single camera's map begins where one pair of views is not enough, and is right."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import (
    Reason,
    System,
    TrackingRecord,
    TrackingState,
    Trajectory,
    open_sequence,
)
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.slam.initialization import from_views
from orbslam2py.slam.initialization.image_motion import ImageMotion
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(120)


class Played:
    """A system that has seen the frames of a made-up sequence."""

    def __init__(self, n_features: int = 1000, stride: int = 1, **options: object) -> None:
        sequence = SyntheticSequence(
            SyntheticOptions(**{"sensor": "mono", "size": (320, 240), "noise": 1.0} | options)
        )
        self.sequence = sequence
        settings = sequence.settings
        orb = dataclasses.replace(settings.orb, n_features=n_features)
        settings = dataclasses.replace(settings, orb=orb)
        self.indices = list(range(0, len(sequence), stride))
        self.records: list[TrackingRecord] = []
        with System(settings, "mono", deterministic=True) as self.system:
            for i in self.indices:
                image = sequence.load(i).image
                record = self.system.track_monocular(image, float(sequence.timestamps[i]))
                self.records.append(record)

    @property
    def first(self) -> int:
        """Position of the first pose."""
        return next(i for i, r in enumerate(self.records) if r.state is TrackingState.OK)

    def path(self) -> Trajectory:
        return self.system.trajectory()

    def error(self) -> float:
        """RMSE of the path by its length, aligned by Sim(3)."""
        truth = self.sequence.ground_truth()
        path = self.path()
        figures = evaluate_trajectory(path.select(~path.lost), truth, Alignment.SIM3)
        assert figures.ate is not None
        length = np.linalg.norm(np.diff(truth.positions, axis=0), axis=1).sum()
        return figures.ate.rmse / float(length)


@pytest.fixture(scope="module")
def walked() -> Played:
    """A walk along a corridor."""
    return Played(world="corridor", frames=40)


def test_a_plane_begins_a_map() -> None:
    """Two views of a plane allow two motions; further ones tell them apart."""
    played = Played(world="wall", frames=40)
    assert played.first <= 25
    assert played.error() < 0.02
    assert all(r.state is TrackingState.OK for r in played.records[played.first :])


def test_a_table_from_above_begins_a_map() -> None:
    played = Played(world="table-top", frames=30)
    assert played.first <= 12
    assert played.error() < 0.01


def test_a_fast_car_begins_a_map() -> None:
    """Three metres a frame: no view is seen again for long."""
    played = Played(2000, stride=3, world="street", size=(620, 188), frames=60)
    assert played.first <= 5
    assert played.error() < 0.02
    assert sum(r.state is TrackingState.OK for r in played.records) >= 15


@pytest.mark.parametrize(("n_features", "stride", "latest"), [(800, 4, 4), (400, 3, 7)])
def test_a_car_with_few_images_a_second_begins_a_map(
    n_features: int, stride: int, latest: int
) -> None:
    """No three images show 30 of the same points by the last one's matches alone."""
    played = Played(n_features, stride, world="street", size=(620, 188), frames=60)
    assert played.first <= latest
    assert played.error() < 0.02


def test_few_features_begin_a_map() -> None:
    played = Played(400, world="corridor", frames=40)
    assert played.first <= 20
    assert played.error() < 0.02


def test_straight_on_to_a_wall_a_map_begins() -> None:
    """The two motions of a plane are nearly one there, and nothing tells them apart."""
    played = Played(world="two-rooms", frames=40, noise=2.0, seed=1)
    assert played.first <= 20
    assert played.error() < 0.03


def test_a_turn_before_the_first_step_begins_no_wrong_map() -> None:
    """Rotation first and translation later: views from behind the turn serve."""
    played = Played(world="corridor", motion="turn-on-the-spot", seed=3, frames=60)
    assert played.error() < 0.02


def test_after_a_long_stand_a_map_begins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first view is older than all frames that are remembered."""
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1, frames=40)
    )
    standing = sequence.load(0).image
    n_remembered = 40
    monkeypatch.setattr(from_views, "_REMEMBERED_FRAMES", n_remembered)
    with System(sequence.settings, "mono", deterministic=True) as system:
        for i in range(n_remembered + 5):
            record = system.track_monocular(standing, i / 20)
            assert record.state is TrackingState.NOT_INITIALIZED
        for i in range(1, 40):
            record = system.track_monocular(sequence.load(i).image, (n_remembered + 5 + i) / 20)
        assert record.state is TrackingState.OK
        assert system.check_map() == []
        # It begins with the first view, or sooner.
        assert system.trajectory().indices[0] <= n_remembered + 5


# ---- where the trajectory begins -----------------------------------------------------------------
def test_the_trajectory_begins_where_the_recording_does(walked: Played) -> None:
    played = walked
    assert played.first > 1
    path = played.path()
    assert list(path.indices) == list(range(40))
    assert not path.lost.any()
    assert played.error() < 0.01
    early = path.select(path.indices <= played.first)
    truth = played.sequence.ground_truth()
    figures = evaluate_trajectory(path, truth, Alignment.SIM3)
    scale = figures.transform.scale
    gap = figures.transform.apply(early.positions) - truth.positions[: played.first + 1]
    assert scale > 0
    assert np.linalg.norm(gap, axis=1).max() < 0.02
    before = played.records[: played.first]
    assert all(r.T_cw is None and r.reason is not Reason.NONE for r in before)


def test_earlier_frames_are_no_keyframes_and_leave_a_sound_map(walked: Played) -> None:
    played = walked
    assert played.system.check_map() == []
    keyframes = sum(r.is_keyframe for r in played.records)
    # The first view is a keyframe whose record said that there was no map.
    assert played.system.n_keyframes <= keyframes + 1


def test_a_map_that_comes_to_nothing_throws_no_frames_away() -> None:
    """Lost right after the start: the next map holds the frames from before the loss as well."""
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1, frames=60)
    )
    options = dataclasses.replace(sequence.options, world="table-top")
    elsewhere = SyntheticSequence(options).load(0).image
    records = []
    with System(sequence.settings, "mono", deterministic=True) as system:
        i = 0
        while not records or records[-1].state is not TrackingState.OK:
            records.append(system.track_monocular(sequence.load(i).image, i / 20))
            i += 1
        records.append(system.track_monocular(elsewhere, i / 20))
        assert records[-1].state is TrackingState.LOST
        begun_before = i
        for k in range(i + 1, i + 25):
            records.append(system.track_monocular(sequence.load(k).image, k / 20))
        assert system.n_resets == 1
        assert [record.frame_id for record in records] == list(range(len(records)))
        assert records[-1].state is TrackingState.OK
        path = system.trajectory()
    assert path.indices[0] < begun_before
    truth = sequence.ground_truth()
    figures = evaluate_trajectory(path.select(~path.lost), truth, Alignment.SIM3)
    assert figures.ate is not None
    assert figures.ate.rmse < 0.01


def test_a_reset_that_is_asked_for_forgets_all() -> None:
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1, frames=40)
    )
    with System(sequence.settings, "mono", deterministic=True) as system:
        for i in range(15):
            system.track_monocular(sequence.load(i).image, i / 20)
        system.reset()
        records = [system.track_monocular(sequence.load(i).image, i / 20) for i in range(15, 40)]
        assert [record.frame_id for record in records] == list(range(25))
        assert system.trajectory().timestamps[0] >= 0.75


# ---- features ------------------------------------------------------------------------------------
def test_features_are_raised_while_it_does_not_begin() -> None:
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="mono", size=(320, 240), noise=1)
    )
    settings = sequence.settings
    orb = dataclasses.replace(settings.orb, n_features=300)
    with System(dataclasses.replace(settings, orb=orb), "mono", deterministic=True) as system:
        seen = []
        for i in range(14):
            image = sequence.load(5).image  # it stands still
            record = system.track_monocular(image, i / 20, details=True)
            assert record.features is not None
            seen.append(len(record.features.keypoints))
    assert seen[0] == pytest.approx(600, rel=0.05)
    assert seen[-1] == pytest.approx(1200, rel=0.05)


# ---- the motion of the image ---------------------------------------------------------------------
def test_the_motion_of_the_image_is_fitted_despite_wrong_matches() -> None:
    random = np.random.default_rng(0)
    places = random.uniform(0, 600, (400, 2)).astype(np.float32)
    centre = np.array([300.0, 300.0])
    zoom = 0.1 * (places - centre) + [30.0, -4.0]
    displacements = zoom + random.normal(0, 0.3, zoom.shape)
    displacements[:120] = random.uniform(-100, 100, (120, 2))
    motion = ImageMotion(centre, centre)
    motion.fit(places, displacements.astype(np.float32))
    assert np.abs(motion.at(places) - zoom).max() < 1.5
    assert motion.spread is not None
    assert motion.spread < 3


def test_too_few_matches_leave_the_motion_as_it_was() -> None:
    motion = ImageMotion(np.array([300.0, 300.0]), np.array([300.0, 300.0]))
    places = np.full((5, 2), 10, np.float32)
    motion.fit(places, places)
    assert not motion.at(places).any()
    assert motion.spread is None


@pytest.mark.parametrize(("fps", "waits"), [(30.0, 10), (10.0, 10), (2.5, 4)])
def test_more_features_after_ten_images_or_a_second(fps: float, waits: int) -> None:
    """A camera of few images a second would wait for seconds else."""
    sequence = SyntheticSequence(
        SyntheticOptions(world="wall", sensor="mono", size=(320, 240), frames=1)
    )
    image = sequence.load(0).image
    factors = []
    with System(sequence.settings, "mono", deterministic=True) as slam:
        for i in range(12):
            slam.track_monocular(image, 100.0 + i / fps)
            factors.append(slam.pipeline.feature_factor)
    assert factors == [2] * (waits - 1) + [4] * (12 - waits + 1)


@pytest.mark.shared
@pytest.mark.parametrize("seed", [0, 3])
def test_a_real_camera_that_takes_off_ends_with_a_right_map(seed: int, shared_data: Path) -> None:
    """A drone, seen with 2000 features."""
    sequence = open_sequence(shared_data / "sequences" / "drone_semicircle", "mono")
    truth = sequence.ground_truth()
    assert truth is not None
    settings = sequence.settings
    settings = dataclasses.replace(settings, orb=dataclasses.replace(settings.orb, n_features=2000))
    with System(settings, "mono", deterministic=True, seed=seed) as system:
        for i in range(len(sequence)):
            system.track_monocular(sequence.load(i).image, float(sequence.timestamps[i]))
        path = system.trajectory()
    figures = evaluate_trajectory(path.select(~path.lost), truth, Alignment.SIM3)
    assert figures.as_dict()["ate_rmse_m"] < 0.04
