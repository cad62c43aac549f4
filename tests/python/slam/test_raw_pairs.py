# SPDX-License-Identifier: BSD-3-Clause
"""Raw pairs from arrays: rectified by the system, or matched along their epipolar curves."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import ImageError, Sensor, Settings, System
from orbslam2py._timing import StageTimer
from orbslam2py.datasets.rectification import rectifiers_of
from orbslam2py.maps import load_map
from orbslam2py.slam.front_end import FrontEnd
from support.raw_pairs import distorted_pair, fisheye_pair, seen_through


def frame_of(settings: Settings, left: np.ndarray, right: np.ndarray, **more: object) -> object:
    front_end = FrontEnd(settings, Sensor.STEREO, check_calibration=False)
    return front_end.stereo(left, right, 0, 0.0, StageTimer(), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("settings", [distorted_pair(), fisheye_pair(90)], ids=["pinhole", "90"])
def test_the_system_rectifies_as_sequences_do(settings: Settings) -> None:
    assert settings.rectification is not None
    images = seen_through(settings).load(0)
    assert images.right is not None
    rectifiers = rectifiers_of(settings)
    assert rectifiers is not None
    rectified = [
        one.rectify(image)
        for one, image in zip(rectifiers, (images.image, images.right), strict=True)
    ]
    applied = replace(settings, rectification=replace(settings.rectification, applied=True))
    raw = frame_of(settings, images.image, images.right)
    expected = frame_of(applied, *rectified)
    np.testing.assert_array_equal(raw.keypoints, expected.keypoints)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(raw.depth, expected.depth)  # type: ignore[attr-defined]
    assert np.count_nonzero(raw.depth > 0) > 100  # type: ignore[attr-defined]


def test_pairs_that_come_rectified_are_tracked_as_they_are(
    caplog: pytest.LogCaptureFixture,
) -> None:
    settings = distorted_pair()
    images = seen_through(settings).load(0)
    rectifiers = rectifiers_of(settings)
    assert rectifiers is not None
    assert images.right is not None
    left, right = rectifiers[0].rectify(images.image), rectifiers[1].rectify(images.right)
    front_end = FrontEnd(settings, Sensor.STEREO, check_calibration=False)
    with caplog.at_level(logging.WARNING):
        frame = front_end.stereo(left, right, 0, 0.0, StageTimer())
    assert "the pairs come rectified already" in caplog.text
    assert "Give the raw images of both cameras, or settings without" in caplog.text
    assert "rectified already" in str(front_end.depth_warning)
    pair = settings.rectification
    assert pair is not None
    applied = replace(settings, rectification=replace(pair, applied=True))
    expected = frame_of(applied, left, right)
    np.testing.assert_array_equal(frame.depth, expected.depth)  # type: ignore[attr-defined]


def test_a_mask_of_a_raw_pair_is_of_the_raw_images() -> None:
    settings = distorted_pair()
    images = seen_through(settings).load(0)
    assert images.right is not None
    mask = np.full(images.image.shape, 255, np.uint8)
    mask[:, :160] = 0
    frame = frame_of(settings, images.image, images.right, mask=(mask, None))
    pair = settings.rectification
    assert pair is not None
    core_rectifier = rectifiers_of(settings)
    assert core_rectifier is not None
    raw = core_rectifier[0]._rectifier.to_raw(
        np.asarray(frame.keypoints[:, :2], np.float64)  # type: ignore[attr-defined]
    )
    assert len(raw) > 50
    assert raw[:, 0].min() > 158


@pytest.mark.parametrize("degrees", [150, 195])
def test_a_fisheye_pair_measures_distances_along_the_rays(degrees: float) -> None:
    settings = fisheye_pair(degrees)
    assert settings.rectification is None
    sequence = seen_through(settings)
    images = sequence.load(0)
    assert images.right is not None
    frame = frame_of(settings, images.image, images.right)
    keypoints = np.asarray(frame.keypoints[:, :2], np.float64)  # type: ignore[attr-defined]
    depth = np.asarray(frame.depth, np.float64)  # type: ignore[attr-defined]
    rays = settings.camera.camera_model(320, 240).unproject(keypoints)
    columns, rows = np.rint(keypoints).astype(int).T
    axial = sequence.exact_depth(0)[rows, columns]
    known = (depth > 0) & (rays[:, 2] > 0.2) & (axial > 0)
    assert np.count_nonzero(known) > 0.4 * len(depth)
    exact = axial[known] / rays[known, 2]
    disparity_errors = settings.camera.bf * (1 / depth[known] - 1 / exact)
    assert np.median(np.abs(disparity_errors)) < 0.15  # pixels
    assert abs(np.median(disparity_errors)) < 0.03


@pytest.mark.parametrize(("degrees", "metres"), [(90, 0.03), (195, 0.01)])
def test_a_raw_pair_is_tracked_on_the_true_path(degrees: float, metres: float) -> None:
    settings = fisheye_pair(degrees)
    sequence = seen_through(settings, frames=8)
    with System(settings, "stereo", deterministic=True) as slam:
        for i in range(len(sequence)):
            images = sequence.load(i)
            record = slam.track((images.image, images.right), float(sequence.timestamps[i]))
    assert record.state.name == "OK"
    assert record.T_wc is not None
    moved = np.linalg.inv(sequence.T_wc(0)) @ sequence.T_wc(len(sequence) - 1)
    assert np.linalg.norm(moved[:3, 3]) > 0.04
    np.testing.assert_allclose(record.T_wc, moved, atol=metres)


def test_swapped_images_of_a_fisheye_pair_have_hardly_any_depth() -> None:
    settings = fisheye_pair(195)
    images = seen_through(settings).load(0)
    assert images.right is not None
    n_right, n_swapped = (
        np.count_nonzero(frame_of(settings, *pair).depth > 0)  # type: ignore[attr-defined]
        for pair in ((images.image, images.right), (images.right, images.image))
    )
    assert n_swapped < 0.3 * n_right


@pytest.mark.parametrize("settings", [distorted_pair(), fisheye_pair(195)], ids=["raw", "fisheye"])
def test_images_of_another_size_than_the_calibration(settings: Settings) -> None:
    small = np.zeros((200, 300), np.uint8)
    large = np.zeros((240, 320), np.uint8)
    if settings.rectification is not None:
        with pytest.raises(ImageError, match="300x200, but the calibration of the pair is for"):
            frame_of(settings, small, small)
    with pytest.raises(ImageError, match="left image has size 320x240, the right 300x200"):
        frame_of(settings, large, small)


def test_a_saved_map_knows_the_right_camera(tmp_path: Path) -> None:
    settings = fisheye_pair(195)
    sequence = seen_through(settings, frames=4)
    images = [sequence.load(i) for i in range(4)]
    with System(settings, "stereo", deterministic=True) as slam:
        for i in range(3):
            slam.track((images[i].image, images[i].right), float(sequence.timestamps[i]))
        slam.save_map(tmp_path / "map.orbmap")
    stored = load_map(tmp_path / "map.orbmap").contents
    centre = settings.right.centre  # type: ignore[union-attr]
    np.testing.assert_array_equal(stored.cameras.lens[0, -3:], centre)
    doubled = stored.cameras.scaled(2.0)
    np.testing.assert_allclose(doubled.lens[0, -3:], 2 * centre)
    np.testing.assert_array_equal(doubled.lens[0, :13], stored.cameras.lens[0, :13])
    with System(settings, "stereo", load_map=tmp_path / "map.orbmap", deterministic=True) as slam:
        record = slam.track((images[3].image, images[3].right), 10.0)
    assert record.state.name == "OK"
    assert record.T_wc is not None
    moved = np.linalg.inv(sequence.T_wc(0)) @ sequence.T_wc(3)
    np.testing.assert_allclose(record.T_wc, moved, atol=0.01)
