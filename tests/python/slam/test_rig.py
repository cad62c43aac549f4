# SPDX-License-Identifier: BSD-3-Clause
"""Several cameras that are mounted rigidly, tracked as one."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._timing import StageTimer
from orbslam2py.errors import ImageError, MapFileError, SettingsError, StateError
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.maps import export_colmap, load_map, reprojection_errors
from orbslam2py.settings import DepthSettings, OrbSettings, RigCamera, RightCamera, Settings
from orbslam2py.slam.rig_front_end import RigFrontEnd
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.rigs import WIDE, back_to_back, four_around, mounted, rig_settings, two_wide_pairs

Pictures = tuple[Any, ...]


def made_up(
    settings: Settings, frames: int, **options: Any
) -> tuple[SyntheticSequence, list[Pictures]]:
    sequence = SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="rig", rig=settings, frames=frames, **options)
    )
    return sequence, [sequence.load(i).cameras or () for i in range(frames)]


def ate_of(slam: orb.System, sequence: SyntheticSequence) -> float:
    result = evaluate_trajectory(slam.trajectory(), sequence.ground_truth(), "se3")
    assert result.ate is not None
    return result.ate.rmse


@pytest.mark.parametrize(
    ("settings", "most"),
    [(back_to_back(), 0.004), (two_wide_pairs(), 0.01), (four_around(), 0.02)],
    ids=["depth cameras", "two pairs", "four around"],
)
def test_follows_the_body(settings: Settings, most: float) -> None:
    sequence, images = made_up(settings, 20)
    slam = orb.System(sequence.settings, "rig", deterministic=True)
    for cameras, timestamp in zip(images, sequence.timestamps.tolist(), strict=True):
        assert slam.track(cameras, timestamp).T_wc is not None
    assert ate_of(slam, sequence) < most


def test_a_pair_as_a_rig_is_tracked_as_a_pair() -> None:
    T = mounted(0, (0.12, 0, 0))
    pair = Settings(
        sensor="stereo",
        camera=WIDE,
        orb=OrbSettings(n_features=500),
        depth=DepthSettings(40.0),
        right=RightCamera(WIDE, T),
    )
    rig = rig_settings([RigCamera(WIDE), RigCamera(WIDE, T)])
    sequence, images = made_up(rig, 8)
    paths = []
    for settings in (pair, rig):
        slam = orb.System(settings, settings.sensor, deterministic=True)
        for cameras, timestamp in zip(images, sequence.timestamps.tolist(), strict=True):
            slam.track(cameras, timestamp)
        paths.append(slam.trajectory().T_wc)
    assert np.abs(paths[0] - paths[1]).max() < 2e-3


def test_a_camera_that_drops_out_costs_its_points_alone(caplog: pytest.LogCaptureFixture) -> None:
    sequence, images = made_up(two_wide_pairs(), 16)
    slam = orb.System(sequence.settings, "rig", deterministic=True)
    records = []
    with caplog.at_level(logging.WARNING):
        for i, (cameras, timestamp) in enumerate(
            zip(images, sequence.timestamps.tolist(), strict=True)
        ):
            given = list(cameras)
            if i in (5, 6, 7):
                given[0] = None
            if i in (10, 11):
                given[2] = given[3] = None
            if i == 13:
                given[1] = np.zeros_like(given[1])
            records.append(slam.track(given, timestamp))
    assert all(record.T_wc is not None for record in records)
    assert ate_of(slam, sequence) < 0.01
    told = [text for text in caplog.messages if "has no image" in text]
    assert len(told) == 3  # once for each camera
    assert "camera 1 of the rig" in told[0]


def test_a_covered_lens_is_told_once(caplog: pytest.LogCaptureFixture) -> None:
    settings = two_wide_pairs()
    _, (images,) = made_up(settings, 1)
    front_end = RigFrontEnd(settings)
    covered = (np.zeros_like(images[0]), *images[1:])
    for i in range(35):
        frame = front_end.rig(covered, i, 0.1 * i, StageTimer())
        shown = {frame.camera.camera_at(float(x)) for x in frame.keypoints[:, 0]}
        assert shown == {1, 2}  # the right camera of the front pair steps in
    told = [text for text in caplog.messages if "lens covered" in text]
    assert len(told) == 1
    assert "camera 1 of the rig" in told[0]


def test_a_bare_wall_before_the_front_pair_loses_the_pair_but_not_the_rig() -> None:
    settings = two_wide_pairs()
    assert settings.rig is not None
    sequence, images = made_up(settings, 14)
    wall = np.full((256, 256), 140, np.uint8)
    lost = {}
    for used in (2, 4):
        rig = replace(settings, rig=settings.rig[:used])
        slam = orb.System(rig, "rig", deterministic=True)
        poses = []
        for i, (cameras, timestamp) in enumerate(
            zip(images, sequence.timestamps.tolist(), strict=True)
        ):
            given = cameras if i not in (8, 9, 10) else (wall, wall, *cameras[2:])
            poses.append(slam.track(given[:used], timestamp).T_wc)
        lost[used] = [i for i, T_wc in enumerate(poses) if T_wc is None]
    assert lost == {2: [8, 9, 10], 4: []}


def test_found_again_and_loaded_again(tmp_path: Path) -> None:
    sequence, images = made_up(back_to_back(), 14)
    times = sequence.timestamps.tolist()
    slam = orb.System(sequence.settings, "rig", deterministic=True)
    dark = [(np.zeros_like(image), depth) for image, depth in images[0]]
    states = []
    for i, (cameras, timestamp) in enumerate(zip(images, times, strict=True)):
        states.append(str(slam.track(dark if i in (8, 9) else cameras, timestamp).state))
    assert [i for i, state in enumerate(states) if state != str(orb.TrackingState.OK)] == [8, 9]
    slam.save_map(tmp_path / "rig.orbmap")
    slam.shutdown()

    loaded = orb.System(sensor="rig", load_map=tmp_path / "rig.orbmap", deterministic=True)
    assert loaded.settings == sequence.settings
    loaded.localization_mode = True
    record = loaded.track(images[5], times[5])
    assert record.T_wc is not None
    saved = load_map(tmp_path / "rig.orbmap").contents
    assert float(np.median(reprojection_errors(saved))) < 1
    with pytest.raises(MapFileError, match=r"map of a rig.*ply"):
        export_colmap(saved, tmp_path / "colmap")
    there = slam.trajectory().T_wc[slam.trajectory().timestamps.tolist().index(times[5])]
    assert np.abs(record.T_wc - there)[:3, 3].max() < 0.005


def test_extrinsics_the_wrong_way_round_are_told(caplog: pytest.LogCaptureFixture) -> None:
    right = mounted(0, (0.12, 0, 0))
    cameras = [RigCamera(WIDE), RigCamera(WIDE, right)]
    sequence, images = made_up(rig_settings(cameras), 11)
    wrong = rig_settings([RigCamera(WIDE), RigCamera(WIDE, np.asarray(np.linalg.inv(right)))])
    slam = orb.System(wrong, "rig", deterministic=True)
    for given, timestamp in zip(images, sequence.timestamps.tolist(), strict=True):
        slam.track(given, timestamp)
    told = [text for text in caplog.messages if "inverse extrinsics" in text]
    assert len(told) == 1


def test_refuses_images_that_do_not_belong_to_the_rig() -> None:
    settings = back_to_back()
    grey, depth = np.zeros((240, 320), np.uint8), np.ones((240, 320), np.uint16)
    slam = orb.System(settings, "rig", deterministic=True)
    wrong: list[tuple[Any, str]] = [
        ((grey,), "this rig has 2 cameras"),
        (grey, "a sequence with one for each camera"),
        ((None, None), "no image of any camera"),
        (((grey, depth), (grey[:200], depth)), "image of camera 2 is 320x200"),
        (((grey, depth), (grey, depth, depth)), "camera 2 has 3 images"),
        (((grey, depth), (grey, depth[:100])), "depth"),
    ]
    for images, named in wrong:
        with pytest.raises(ImageError, match=named):
            slam.track(images, 0.0)
    with pytest.raises(StateError, match="sensor 'stereo'"):
        slam.track_stereo(grey, grey, 0.0)
    assert len(slam.trajectory().timestamps) == 0
    with pytest.raises(SettingsError, match="a rig uses no IMU yet"):
        orb.System(settings, "rig", imu="imu.yaml")
