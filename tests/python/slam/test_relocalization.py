# SPDX-License-Identifier: BSD-3-Clause
"""Lost frames are found again where the map knows the place, and nowhere else.

Errors are taken through the nearest mapped keyframe, see `MappedWorld`. Larger versions:
``benchmarks/relocalization.py``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from benchmarks.accuracy.mapped_world import MappedWorld, beside

from orbslam2py import Reason, Sensor, TrackingState
from orbslam2py import _core as core
from orbslam2py._timing import StageTimer
from orbslam2py.datasets import Images
from orbslam2py.settings.sensor import WITHOUT_RIG
from orbslam2py.slam.config import RelocalizationConfig
from orbslam2py.slam.relocalization import Relocalizer
from orbslam2py.slam.state import LostSearch
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(60)

SIZE = (480, 360)
N_MAPPED = 110


@lru_cache
def mapped(sensor: Sensor) -> MappedWorld:
    options = SyntheticOptions(world="corridor", sensor=sensor, size=SIZE, noise=2)
    return MappedWorld(SyntheticSequence(options), range(N_MAPPED))


@pytest.fixture(params=WITHOUT_RIG)
def world(request: pytest.FixtureRequest) -> MappedWorld:
    """With mapping on, tracking lost."""
    world = mapped(request.param)
    world.system.localization_mode = False
    assert world.lose().state is TrackingState.LOST
    return world


def test_the_way_was_mapped(world: MappedWorld) -> None:
    assert world.n_tracked >= N_MAPPED - 8
    assert world.system.n_keyframes > 5
    assert world.system.n_resets == 0
    assert world.system.check_map() == []


@pytest.mark.parametrize("start", [10, 60, 95])
def test_kidnapped(world: MappedWorld, start: int) -> None:
    n_before = world.system.n_relocalizations
    for _ in range(5):
        record = world.show(world.black())
        assert record.state is TrackingState.LOST
        assert record.reason is Reason.NOT_FOUND_IN_MAP
        assert record.T_cw is None
        assert record.n_inliers == 0
    errors = []
    for k in range(10):
        T_wc = world.sequence.T_wc(start + k) @ _aside(0.05, 3.0)
        record = world.show(world.sequence.view(T_wc, 1000 + k))
        if record.state is TrackingState.OK:
            errors.append(world.error(record, T_wc))
    assert len(errors) >= 8, "found within the first three frames, and kept"
    assert errors[0].is_within(0.02, 0.5), errors[0]
    assert max(e.translation_m for e in errors) < 0.03
    assert world.system.n_relocalizations == n_before + 1
    assert world.system.check_map() == []


def _aside(metres: float, degrees: float) -> np.ndarray:
    moved = np.eye(4)
    angle = np.radians(degrees)
    moved[[0, 2], [0, 2]] = np.cos(angle)
    moved[0, 2], moved[2, 0] = np.sin(angle), -np.sin(angle)
    moved[0, 3] = metres
    return moved


def test_recall_beside_the_path(world: MappedWorld) -> None:
    world.system.localization_mode = True
    rng = np.random.default_rng(5)
    errors = []
    n_views = 15
    for number in range(n_views):
        T_wc = beside(world.sequence.T_wc(int(rng.integers(N_MAPPED))), rng, 0.5, 20.0)
        shown = world.sequence.view(T_wc, 2000 + number, exposure=float(rng.uniform(0.6, 1.6)))
        record = world.show(shown)
        if record.state is TrackingState.OK:
            errors.append(world.error(record, T_wc))
            assert world.lose().state is TrackingState.LOST
    assert len(errors) >= 0.8 * n_views
    assert np.median([e.translation_m for e in errors]) < 0.02
    assert np.median([e.rotation_deg for e in errors]) < 0.5


# ---- places that are not in the map --------------------------------------------------------------
def foreign_views(sensor: Sensor) -> Iterator[Images]:
    rng = np.random.default_rng(1)
    for name in ("corridor", "room", "figure-eight", "two-rooms", "repeating-corridor"):
        options = SyntheticOptions(world=name, sensor=sensor, size=SIZE, noise=2, seed=7)
        sequence = SyntheticSequence(options)
        for index in rng.integers(len(sequence), size=4):
            yield sequence.load(int(index))


@pytest.mark.parametrize("localization", [True, False])
def test_foreign_worlds_are_never_found(world: MappedWorld, localization: bool) -> None:
    world.system.localization_mode = localization
    n_keyframes = world.system.n_keyframes
    for shown in foreign_views(world.sequence.sensor):
        record = world.show(shown)
        assert record.state is TrackingState.LOST
        assert record.T_cw is None
        assert record.reason in (Reason.NOT_FOUND_IN_MAP, Reason.FEW_INLIERS_LOCAL_MAP)
    assert world.system.n_keyframes == n_keyframes


@pytest.mark.shared
def test_photographs_are_never_found(world: MappedWorld, shared_data: Path) -> None:
    files = sorted((shared_data / "vocabulary_images").glob("*.jpg"))[::50]
    assert files
    for file in files:
        image = cv2.resize(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE), SIZE)
        right = np.roll(image, -10, axis=1)
        shown = Images(image, right, np.full(image.shape, 10_000, np.uint16))
        assert world.show(shown).state is TrackingState.LOST


# ---- the verb ------------------------------------------------------------------------------------
def described(world: MappedWorld, shown: Images) -> core.TrackedFrame:
    front_end = world.system.pipeline.front_end
    timer = StageTimer()
    if world.sequence.sensor is Sensor.STEREO:
        assert shown.right is not None
        frame = front_end.stereo(shown.image, shown.right, 10_000, 0.0, timer)
    elif world.sequence.sensor is Sensor.RGBD:
        assert shown.depth is not None
        frame = front_end.rgbd(shown.image, shown.depth, 10_000, 0.0, timer)
    else:
        frame = front_end.monocular(shown.image, 10_000, 0.0, timer)
    core.describe(frame, world.system.vocabulary)
    return core.TrackedFrame(frame)


def relocalizer(world: MappedWorld, seed: int = 0) -> Relocalizer:
    back_end = world.system.pipeline.back_end
    return Relocalizer(
        back_end.map,
        back_end.keyframe_index,
        seed,
        fix_scale=world.sequence.sensor.has_depth,
        config=RelocalizationConfig(),
    )


def relocalized(by: Relocalizer, frame: core.TrackedFrame) -> int:
    """Search a frame anywhere in the map; its inliers."""
    return by.relocalize(frame, LostSearch())[0].n_inliers


def test_found_frame_has_pose_and_matches(world: MappedWorld) -> None:
    frame = described(world, world.sequence.load(40))
    n_inliers = relocalized(relocalizer(world), frame)
    assert n_inliers >= 50
    assert frame.T_cw is not None
    assert frame.n_associated() == n_inliers


def test_what_is_not_found_has_neither(world: MappedWorld) -> None:
    """The original keeps the pose of the failed attempt (OD-73)."""
    frame = described(world, next(foreign_views(world.sequence.sensor)))
    frame.T_cw = core.Pose()
    assert relocalized(relocalizer(world), frame) == 0
    assert frame.T_cw is None
    assert frame.n_associated() == 0


def test_same_seed_same_pose(world: MappedWorld) -> None:
    shown = world.sequence.load(40)
    poses = []
    for seed in (3, 3, 4):
        frame = described(world, shown)
        assert relocalized(relocalizer(world, seed), frame) > 0
        assert frame.T_cw is not None
        poses.append(frame.T_cw.matrix)
    np.testing.assert_array_equal(poses[0], poses[1])
    np.testing.assert_allclose(poses[0], poses[2], atol=0.05)


def test_an_empty_map_finds_nothing(world: MappedWorld) -> None:
    frame = described(world, world.sequence.load(40))
    nothing = core.Map(), core.KeyFrameIndex()
    config = RelocalizationConfig()
    empty = Relocalizer(*nothing, 0, fix_scale=True, config=config)
    assert relocalized(empty, frame) == 0
    assert frame.T_cw is None
