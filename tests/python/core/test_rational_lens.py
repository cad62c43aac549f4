# SPDX-License-Identifier: BSD-3-Clause
"""The rational lens (k4 to k6): from the settings to poses, map files and exports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py import _core as core
from orbslam2py.errors import DatasetError
from orbslam2py.maps import export_nerfstudio, load_map
from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import align

#: That of an Azure Kinect's colour camera.
LENS = (0.46, -2.63, 0.0006, -0.0003, 1.52, 0.34, -2.45, 1.45)
N = 20


def with_lens(settings: Settings) -> Settings:
    k1, k2, p1, p2, k3, k4, k5, k6 = LENS
    camera = replace(settings.camera, k1=k1, k2=k2, p1=p1, p2=p2, k3=k3, k4=k4, k5=k5, k6=k6)
    return replace(settings, camera=camera)


@pytest.mark.parametrize("n", [4, 5, 8])
def test_undistortion_is_that_of_opencv(n: int) -> None:
    lens = np.array(LENS[:n]) * (1.0 if n == 8 else 0.2)
    options = core.CameraOptions(
        fx=611.5, fy=611.3, cx=639.2, cy=367.1, width=1280, height=720, distortion=lens.tolist()
    )
    K = np.array([[611.5, 0, 639.2], [0, 611.3, 367.1], [0, 0, 1]])
    u, v = np.meshgrid(np.arange(0, 1281, 40.0), np.arange(0, 721, 40.0))
    raw = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float32)
    camera = core.Camera(options)
    straight = camera.from_image(raw)
    rays = np.column_stack([(straight - K[:2, 2]) / (K[0, 0], K[1, 1]), np.ones(len(raw))])
    np.testing.assert_allclose(camera.rays(straight), rays, rtol=1e-12)
    np.testing.assert_allclose(camera.project(2.5 * rays), straight, atol=1e-9)
    again = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, lens)[0][:, 0]
    # A cut rational lens folds over outside of this.
    shown = np.full(len(raw), True) if n == 8 else np.abs(raw - K[:2, 2]).max(axis=1) < 250
    np.testing.assert_allclose(camera.to_image(straight)[shown], again[shown], atol=1e-9)
    np.testing.assert_allclose(again[shown], raw[shown], atol=1e-4)


def test_points_that_are_not_in_front_have_no_pixel() -> None:
    camera = core.Camera(core.CameraOptions(fx=100, fy=100, cx=50, cy=40, width=100, height=80))
    points = np.array([[0.1, 0.2, 1.0], [0.1, 0.2, 0.0], [0.1, 0.2, -1.0], [0.1, 0.2, np.nan]])
    pixels = camera.project(points)
    np.testing.assert_array_equal(pixels, [[60.0, 60.0], *[[np.nan] * 2] * 3])
    assert camera.pixels_per_radian == 100.0
    with pytest.raises(ValueError, match=r"points must have the shape \(n, 3\)"):
        camera.project(pixels)


def test_too_many_coefficients_are_refused() -> None:
    with pytest.raises(ValueError, match="at most 8 coefficients, got 9"):
        core.CameraOptions(fx=1, fy=1, width=2, height=2, distortion=[0.0] * 9)


@pytest.fixture(scope="module")
def sequence() -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(world="corridor", sensor="rgbd", size=(320, 240), frames=N)
    )


def track(sequence: SyntheticSequence, settings: Settings, *, bent: bool) -> orb.System:
    """Track the sequence, seen through the lens or as it is."""
    size = sequence.load(0).image.shape[1::-1]
    K = settings.camera.matrix
    lens = np.array(LENS)
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)
    straight = pixels.copy()
    for _ in range(50):  # until the lens shows them at their pixels
        rays = np.column_stack([(straight - K[:2, 2]) / (K[0, 0], K[1, 1]), np.ones(len(pixels))])
        straight += pixels - cv2.projectPoints(rays, np.zeros(3), np.zeros(3), K, lens)[0][:, 0]
    map_x, map_y = straight.astype(np.float32).T.reshape(2, *size[::-1])
    with orb.System(settings, "rgbd", deterministic=True) as slam:
        for i in range(N):
            images = sequence.load(i)
            image, depth = images.image, images.depth
            assert depth is not None
            if bent:
                image = cv2.remap(image, map_x, map_y, cv2.INTER_LINEAR)
                depth = cv2.remap(depth, map_x, map_y, cv2.INTER_NEAREST)
            slam.track_rgbd(image, depth, i / 20)
    return slam


def error_of(slam: orb.System, sequence: SyntheticSequence) -> float:
    path = slam.trajectory()
    assert not path.lost.any()
    true = np.stack([sequence.T_wc(i)[:3, 3] for i in range(N)])
    moved = align(path.T_wc[:, :3, 3], true).apply(path.T_wc[:, :3, 3])
    return float(np.sqrt(np.mean(np.sum((moved - true) ** 2, axis=1))))


def test_images_through_the_lens_are_tracked_as_exactly(
    sequence: SyntheticSequence, tmp_path: Path
) -> None:
    straight = error_of(track(sequence, sequence.settings, bent=False), sequence)
    slam = track(sequence, with_lens(sequence.settings), bent=True)
    assert error_of(slam, sequence) < max(2 * straight, 0.01)
    ignored = error_of(track(sequence, sequence.settings, bent=True), sequence)
    assert error_of(slam, sequence) < ignored

    path = tmp_path / "lens.orbmap"
    slam.save_map(path)
    loaded = load_map(path)
    np.testing.assert_array_equal(loaded.contents.cameras.distortion, [LENS])
    assert tuple(loaded.settings.camera.distortion) == LENS
    with pytest.raises(DatasetError, match="give the images"):
        export_nerfstudio(loaded.contents, tmp_path / "nerf")
