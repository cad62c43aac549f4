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
from orbslam2py.slam.records import PoseMethod, TrackingState
from support.small_sequences import ate, black, images, new_system, play, track

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


# ---- frames without features ---------------------------------------------------------------------
FOLLOW = {"alignment.rgbd": True, "alignment.monocular": True, "alignment.follow": True}


@pytest.mark.parametrize("kind", [Sensor.RGBD, Sensor.MONOCULAR])
def test_frames_are_followed_without_features(kind: Sensor) -> None:
    errors = []
    for changes in (FOLLOW, OFF):
        with new_system(kind, deterministic=True, config=changes) as system:
            records = play(system, 80 if kind is Sensor.MONOCULAR else 40)
            assert all(record.T_cw is not None for record in records[20:])
        errors.append(ate(system))
        if changes is FOLLOW:
            followed = [record for record in records if record.method is PoseMethod.PATCHES]
            assert len(followed) > 15
            assert not any(record.is_keyframe for record in followed)
            assert "extract" not in followed[0].milliseconds
            assert all(record.covariance is not None for record in followed)
    assert errors[0] < errors[1]


def test_a_followed_frame_has_the_keypoints_of_its_points() -> None:
    with new_system(Sensor.RGBD, deterministic=True, config=FOLLOW) as system:
        play(system, 6)
        record = track(system, 6, details=True)
        assert record.method is PoseMethod.PATCHES
        assert record.features is not None
        assert np.count_nonzero(record.features.inliers) == record.n_inliers


def test_frames_need_features_where_the_image_shows_something_else() -> None:
    with new_system(Sensor.RGBD, deterministic=True, config=FOLLOW) as system:
        play(system, 6)
        system.track(black(Sensor.RGBD), 100.0)
        assert system.state is TrackingState.LOST
        record = system.track(images(Sensor.RGBD, 6), 101.0)
        assert record.T_cw is not None
        assert record.method is PoseMethod.RELOCALIZATION


def test_a_mask_needs_features() -> None:
    with new_system(Sensor.RGBD, deterministic=True, config=FOLLOW) as system:
        play(system, 6)
        shown = images(Sensor.RGBD, 6)
        mask = np.full(shown.image.shape[:2], 255, np.uint8)
        assert system.track(shown, 100.0, mask=mask).method is not PoseMethod.PATCHES


def test_pairs_are_not_followed_and_a_warning_says_so(caplog: pytest.LogCaptureFixture) -> None:
    new_system(Sensor.RGBD, config=FOLLOW)
    assert "tracked with features" not in caplog.text
    new_system(Sensor.STEREO, effort="light")
    assert "is for one camera, or RGB-D" in caplog.text


def test_repeated_runs_without_features_are_equal() -> None:
    with played(Sensor.RGBD, FOLLOW) as first, played(Sensor.RGBD, FOLLOW) as second:
        np.testing.assert_array_equal(first.trajectory().T_wc, second.trajectory().T_wc)
