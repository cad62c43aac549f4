# SPDX-License-Identifier: BSD-3-Clause
"""Poses, scale tables, errors and the extractor as Python sees them."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
from numpy.typing import NDArray

from orbslam2py import ImageError, SettingsError, StateError, _core
from support.slow_arrays import SlowArray


def noise(height: int, width: int, seed: int = 0) -> NDArray[np.generic]:
    """Reproducible random grey image."""
    return np.random.default_rng(seed).integers(0, 256, (height, width), dtype=np.uint8)


def test_extraction_arrays() -> None:
    extractor = _core.OrbExtractor(_core.OrbOptions(n_features=300, n_levels=4))
    result = extractor.extract(noise(240, 320))
    n = len(result)
    assert n > 250
    assert (result.keypoints.shape, result.keypoints.dtype) == ((n, 5), np.float32)
    assert (result.levels.shape, result.levels.dtype) == ((n,), np.int32)
    assert (result.descriptors.shape, result.descriptors.dtype) == ((n, 32), np.uint8)
    assert [image.shape for image in result.pyramid] == [
        (240, 320), (200, 267), (167, 222), (139, 185)
    ]  # fmt: skip


@pytest.mark.parametrize("original", [False, True])
def test_pixels_of_coarse_levels_lie_at_their_true_place(original: bool) -> None:
    options = _core.OrbOptions(n_features=300, n_levels=4, original_coordinates=original)
    extractor = _core.OrbExtractor(options)
    assert extractor.scales.original_coordinates is original
    result = extractor.extract(noise(240, 320))
    sizes = np.array([image.shape[::-1] for image in result.pyramid])[result.levels]
    scale = np.array([320, 240]) / sizes
    if original:
        scale = np.tile(extractor.scales.scale[result.levels][:, None], 2)
    centre = np.zeros_like(scale) if original else (scale - 1) / 2
    pixels = (result.keypoints[:, :2] - centre) / scale
    np.testing.assert_allclose(pixels, np.round(pixels), atol=1e-4)


def test_masks_are_read_at_the_true_place() -> None:
    # One column of ten is allowed: whatever is found lies there and nowhere else.
    mask = np.zeros((240, 320), np.uint8)
    mask[:, 100:130] = 255
    for original in (False, True):
        options = _core.OrbOptions(n_features=300, original_coordinates=original)
        x = _core.OrbExtractor(options).extract(noise(240, 320), mask).keypoints[:, 0]
        assert len(x) > 30
        assert x.min() >= 100
        assert x.max() <= 129


def test_no_keypoints_is_an_empty_result() -> None:
    result = _core.OrbExtractor().extract(np.full((100, 100), 7, np.uint8))
    assert result.keypoints.shape == (0, 5)
    assert result.levels.shape == (0,)
    assert result.descriptors.shape == (0, 32)


def test_result_keeps_its_own_pixels() -> None:
    image = noise(120, 160)
    before = image.copy()
    result = _core.OrbExtractor().extract(image)
    image[:] = 0
    np.testing.assert_array_equal(result.pyramid[0], before)


def test_window_of_a_larger_image() -> None:
    large = noise(300, 400)
    window = large[20:270, 31:361]
    plain = _core.OrbExtractor().extract(window.copy())
    np.testing.assert_array_equal(_core.OrbExtractor().extract(window).keypoints, plain.keypoints)


def test_portable_kernels_by_environment() -> None:
    code = "from orbslam2py import _core; print(_core.OrbExtractor().kernel_name)"
    environment = {**os.environ, "ORBSLAM2PY_PORTABLE_KERNELS": "1"}
    run = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert run.stdout.strip() == _core.vector_units()[0]


def test_kernels_by_name() -> None:
    """The names of the vector units, or what they are to somebody who knows none of them."""
    units = _core.vector_units()
    image = noise(240, 320)
    expected = _core.OrbExtractor().extract(image)
    for kernels in ("portable", *units):
        extractor = _core.OrbExtractor(kernels=kernels)
        assert extractor.kernel_name == (units[0] if kernels == "portable" else kernels)
        result = extractor.extract(image)
        np.testing.assert_array_equal(result.keypoints, expected.keypoints)
        np.testing.assert_array_equal(result.descriptors, expected.descriptors)
    with pytest.raises(SettingsError, match=f"altivec.*portable, {units[0]}"):
        _core.OrbExtractor(kernels="altivec")


def test_one_extractor_refuses_a_second_thread() -> None:
    """Another image would overwrite what the first is working on (OD-26)."""
    extractor = _core.OrbExtractor()
    large, small = noise(3000, 4000), noise(100, 100)
    refused = threading.Event()

    def work() -> None:
        while not refused.is_set():
            try:
                extractor.extract(large)
            except StateError:
                refused.set()

    thread = threading.Thread(target=work)
    thread.start()
    for _ in range(100_000):
        if refused.is_set():
            break
        try:
            extractor.extract(small)
        except StateError:
            refused.set()
    found = refused.is_set()
    refused.set()
    thread.join()
    assert found
    assert len(extractor.extract(small)) > 0


def test_a_second_thread_is_refused_while_the_arrays_are_read() -> None:
    extractor, image = _core.OrbExtractor(), noise(240, 320)
    mask = SlowArray(np.full(image.shape, 255, np.uint8))
    found: list[_core.Extraction] = []
    thread = threading.Thread(target=lambda: found.append(extractor.extract(image, mask)))
    thread.start()
    assert mask.is_read.wait(30)
    try:
        with pytest.raises(StateError, match="another thread"):
            extractor.extract(image)
    finally:
        mask.go_on.set()
        thread.join()
    expected = _core.OrbExtractor().extract(image)
    np.testing.assert_array_equal(found[0].keypoints, expected.keypoints)


def test_refused_arrays_do_not_keep_the_extractor() -> None:
    extractor, image = _core.OrbExtractor(), noise(240, 320)
    for wrong in ((image[:0], None), (image, image[:, :1])):
        with pytest.raises(ImageError):
            extractor.extract(*wrong)
    assert len(extractor.extract(image)) > 0


def test_mask() -> None:
    image = noise(240, 320)
    mask = np.full(image.shape, 255, np.uint8)
    mask[:, :200] = 0
    result = _core.OrbExtractor().extract(image, mask=mask)
    assert len(result) > 0
    assert result.keypoints[:, 0].min() >= 200
    everything = _core.OrbExtractor().extract(image, mask=np.full_like(image, 255))
    np.testing.assert_array_equal(
        everything.descriptors, _core.OrbExtractor().extract(image).descriptors
    )


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((0, 0), np.uint8),
        np.zeros((0, 20), np.uint8),
        np.zeros((50, 50, 3), np.uint8),
        np.zeros(50, np.uint8),
        np.zeros((50, 50), np.float32),
    ],
)
def test_bad_images(image: NDArray[np.generic]) -> None:
    """The original keeps the keypoints of the image before, or does not notice (OD-24)."""
    with pytest.raises(ImageError, match="image"):
        _core.OrbExtractor().extract(image)


@pytest.mark.parametrize("mask", [np.zeros((50, 49), np.uint8), np.zeros((50, 50), bool)])
def test_bad_masks(mask: NDArray[np.generic]) -> None:
    with pytest.raises(ImageError, match="mask"):
        _core.OrbExtractor().extract(noise(50, 50), mask=mask)


def test_options_out_of_range_are_settings_errors() -> None:
    with pytest.raises(SettingsError, match="n_features"):
        _core.OrbOptions(n_features=0)
    with pytest.raises(SettingsError, match="scale factor"):
        _core.ScalePyramid(0.5, 8)
    with pytest.raises(SettingsError, match="kernels"):
        _core.OrbExtractor(kernels="fast")
    assert _core.SettingsError is SettingsError


def test_extractors_in_threads_agree_with_one_alone() -> None:
    images = [noise(240, 320, seed) for seed in range(4)]
    alone = [_core.OrbExtractor().extract(image).descriptors for image in images]
    found: dict[int, NDArray[np.generic]] = {}

    def work(index: int) -> None:
        found[index] = _core.OrbExtractor().extract(images[index]).descriptors

    threads = [threading.Thread(target=work, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for index, descriptors in enumerate(alone):
        np.testing.assert_array_equal(found[index], descriptors)


def test_hamming() -> None:
    rng = np.random.default_rng(1)
    a = rng.integers(0, 256, (20, 32), dtype=np.uint8)
    b = rng.integers(0, 256, (30, 32), dtype=np.uint8)
    expected = np.unpackbits(a[:, None] ^ b[None], axis=2).sum(axis=2)
    np.testing.assert_array_equal(_core.hamming_matrix(a, b), expected)
    np.testing.assert_array_equal(_core.hamming_distances(a, b[:20]), np.diag(expected))
    with pytest.raises(ValueError, match="32"):
        _core.hamming_matrix(a[:, :31], b)
    with pytest.raises(ValueError, match="length"):
        _core.hamming_distances(a, b)


def test_pose_algebra() -> None:
    xi = np.array([0.3, -0.2, 0.9, 1.0, -2.0, 3.0])
    pose = _core.Pose.exp(xi)
    np.testing.assert_allclose(pose.log(), xi, atol=1e-12)
    np.testing.assert_allclose(pose.power(0.5).log(), np.multiply(0.5, xi), atol=1e-12)
    other = _core.Pose.exp(-0.5 * xi[::-1])
    np.testing.assert_allclose((pose @ other).matrix, pose.matrix @ other.matrix, atol=1e-12)
    np.testing.assert_allclose((pose @ pose.inverse()).matrix, np.eye(4), atol=1e-12)
    turn, way = (pose @ other).difference(other)
    assert turn == pytest.approx(np.linalg.norm(xi[:3]))
    assert way == pytest.approx(np.linalg.norm((pose @ other).center - other.center))
    np.testing.assert_allclose(_core.Pose.from_matrix(pose.matrix).matrix, pose.matrix, atol=1e-12)
    np.testing.assert_allclose(pose @ pose.center, np.zeros(3), atol=1e-12)
    rebuilt = _core.Pose(pose.quaternion_xyzw, pose.translation)
    np.testing.assert_allclose(rebuilt.matrix, pose.matrix, atol=1e-12)
    np.testing.assert_array_equal(_core.Pose().matrix, np.eye(4))


@pytest.mark.parametrize("n", [0, 1, 3, 50])
def test_pose_moves_points(n: int) -> None:
    pose = _core.Pose.exp(np.array([0.1, 0.2, 0.3, 4.0, 5.0, 6.0]))
    points = np.random.default_rng(n).normal(size=(n, 3))
    expected = points @ pose.matrix[:3, :3].T + pose.matrix[:3, 3]
    moved = pose @ points
    assert moved.shape == (n, 3)
    np.testing.assert_allclose(moved, expected, atol=1e-12)
    for point, target in zip(points, expected, strict=True):
        assert (pose @ point).shape == (3,)
        np.testing.assert_allclose(pose @ point, target, atol=1e-12)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_poses_are_finite(wrong: float) -> None:
    matrix = np.eye(4)
    matrix[1, 3] = wrong
    with pytest.raises(ValueError, match="finite"):
        _core.Pose.from_matrix(matrix)
    with pytest.raises(ValueError, match="translation must be finite"):
        _core.Pose([0, 0, 0, 1], [0, wrong, 0])
    with pytest.raises(ValueError, match="quaternion must be finite"):
        _core.Pose([0, wrong, 0, 1], [0, 0, 0])
    with pytest.raises(ValueError, match="tangent vector must be finite"):
        _core.Pose.exp([0, 0, 0, 0, 0, wrong])


def test_pose_pickles_and_prints() -> None:
    pose = _core.Pose.exp(np.array([0.1, 0.2, 0.3, 4.0, 5.0, 6.0]))
    again = pickle.loads(pickle.dumps(pose))
    np.testing.assert_allclose(again.matrix, pose.matrix, atol=1e-15)
    assert repr(pose).startswith("Pose(translation=[")


@pytest.mark.parametrize("bad", [np.zeros((4, 4)), np.full((4, 4), np.nan)])
def test_pose_refuses_what_is_no_pose(bad: NDArray[np.generic]) -> None:
    with pytest.raises(ValueError, match="last row"):
        _core.Pose.from_matrix(bad)
    with pytest.raises(ValueError, match="quaternion"):
        _core.Pose(bad[0], np.zeros(3))


def test_scale_tables() -> None:
    scales = _core.ScalePyramid(1.2, 8)
    assert scales.levels == 8
    assert scales.scale.dtype == np.float32
    np.testing.assert_allclose(scales.scale, 1.2 ** np.arange(8), rtol=1e-6)
    np.testing.assert_allclose(scales.sigma2 * scales.inverse_sigma2, np.ones(8), rtol=1e-6)
    assert scales.features_per_level(1000) == [217, 181, 151, 126, 105, 87, 73, 60]
    assert scales.level_size(640, 480, 7) == (179, 134)
    with pytest.raises(IndexError):
        scales.level_size(640, 480, 8)
