# SPDX-License-Identifier: BSD-3-Clause
"""Alignment of patches while the map grows: what its switches change, and what they do not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.slam.config import AlignmentConfig
from orbslam2py.slam.kept_images import KeptImages
from support.small_sequences import ate, new_system, play

OFF = {"alignment.stereo": False, "alignment.rgbd": False}
ON = {"alignment.stereo": True, "alignment.rgbd": True}


def played(sensor: Sensor, changes: dict[str, Any], n_frames: int = 40) -> System:
    system = new_system(sensor, deterministic=True, config=changes)
    play(system, n_frames)
    return system


def map_of(system: System) -> core.Map:
    return system.pipeline.back_end.map


def test_each_sensor_has_its_switch() -> None:
    config = AlignmentConfig(stereo=True, rgbd=True, right_image=True)
    single = config.for_sensor(Sensor.MONOCULAR)
    assert (single.new_keyframes, single.tracked_inliers) == (False, 0)
    assert not single.uses_points
    assert config.for_sensor(Sensor.STEREO).right_image
    rgbd = config.for_sensor(Sensor.RGBD)
    assert rgbd.uses_points
    assert not rgbd.right_image


def test_sightings_are_aligned_where_that_is_switched_on(sensor: Sensor) -> None:
    with played(sensor, OFF) as system:
        assert core.count_aligned(map_of(system)) == 0
    with played(sensor, ON) as system:
        points = map_of(system).n_points
        assert core.count_aligned(map_of(system)) > points
    with played(sensor, ON | {"alignment.new_keyframes": False}) as system:
        assert core.count_aligned(map_of(system)) == 0  # of frames alone


def test_poses_are_more_exact_with_it(sensor: Sensor) -> None:
    with played(sensor, OFF) as without, played(sensor, ON) as aligned:
        assert ate(aligned) < 0.8 * ate(without)


def test_repeated_runs_are_equal(sensor: Sensor) -> None:
    with played(sensor, ON) as first, played(sensor, ON) as second:
        np.testing.assert_array_equal(first.trajectory().T_wc, second.trajectory().T_wc)


def test_right_images_are_aligned_where_that_is_switched_on() -> None:
    changes = ON | {"alignment.right_image": True}
    with played(Sensor.STEREO, changes, 3) as system:
        frame = system.pipeline.tracking.motion.last.features
        aligned = frame.right_variance > 0
        assert np.count_nonzero(aligned) > 0.7 * np.count_nonzero(frame.depth > 0)
    with played(Sensor.STEREO, ON, 3) as system:
        assert len(system.pipeline.tracking.motion.last.features.right_variance) == 0


def test_only_the_newest_keyframes_keep_their_images(monkeypatch: pytest.MonkeyPatch) -> None:
    class Frame:
        has_images = True

    def release(frame: Frame) -> None:
        frame.has_images = False

    monkeypatch.setattr(core, "release_images", release)
    kept = KeptImages()
    waiting, plain = Frame(), Frame()
    kept.note(waiting, is_keyframe=False, waiting=True)  # type: ignore[arg-type]
    kept.note(plain, is_keyframe=False, waiting=False)  # type: ignore[arg-type]
    assert waiting.has_images
    assert not plain.has_images
    keyframes = [Frame() for _ in range(12)]
    for frame in keyframes:
        kept.note(frame, is_keyframe=True, waiting=False)  # type: ignore[arg-type]
    assert [frame.has_images for frame in keyframes] == [False] * 2 + [True] * 10
    assert not waiting.has_images


def test_frames_keep_no_images_without_alignment() -> None:
    with played(Sensor.RGBD, OFF, 3) as system:
        assert not system.pipeline.tracking.motion.last.features.has_images
