# SPDX-License-Identifier: BSD-3-Clause
"""Cameras, image input and frames as Python sees them."""

from __future__ import annotations

import threading

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from orbslam2py import ImageError, SettingsError, StateError
from orbslam2py import _core as core
from support import block_wall
from support.block_wall import HEIGHT, WIDTH, texture


def context(**options: object) -> core.FrameContext:
    return block_wall.context(**{"depth_ratio": 30.0, **options})


def extraction(image: npt.NDArray[np.uint8] | None = None) -> core.Extraction:
    return core.OrbExtractor(core.OrbOptions(n_features=300)).extract(
        texture() if image is None else image
    )


def test_camera_options_can_be_set_one_by_one() -> None:
    options = core.CameraOptions()
    options.fx, options.fy, options.cx, options.cy = 500.0, 510.0, 320.0, 240.0
    options.width, options.height = 640, 480
    options.distortion = [0.1, 0.0, 0.0, 0.0, 0.0]
    options.bf, options.depth_ratio = 40.0, 35.0
    camera = core.Camera(options)
    assert camera.image_size == (640, 480)
    assert camera.pinhole.fy == 510.0
    assert camera.baseline == pytest.approx(0.08)
    assert camera.close_depth == pytest.approx(2.8)
    assert not camera.is_rectified
    centre = np.array([[320.0, 240.0]], dtype=np.float32)
    np.testing.assert_array_equal(camera.from_image(centre), centre)
    assert camera.from_image(np.zeros((0, 2), dtype=np.float32)).shape == (0, 2)


def test_wrong_camera_options_name_the_setting() -> None:
    with pytest.raises(SettingsError, match=r"Camera\.fx"):
        core.Camera(core.CameraOptions(0, 1, 0, 0, 640, 480))


def test_grey_of_colour_images() -> None:
    red = np.zeros((4, 5, 3), dtype=np.uint8)
    red[..., 0] = 200
    assert (core.to_grey(red, is_rgb=True) == 60).all()
    assert (core.to_grey(red, is_rgb=False) == 23).all()
    assert (core.to_grey(red[..., ::-1], is_rgb=False) == 60).all()  # not contiguous
    alpha = np.dstack([red, np.full((4, 5), 7, dtype=np.uint8)])
    assert (core.to_grey(alpha, is_rgb=True) == 60).all()


def test_grey_of_a_large_image_is_opencvs() -> None:
    image = np.random.default_rng(3).integers(0, 256, (301, 467, 3), np.uint8)
    grey = core.to_grey(image, is_rgb=True)
    np.testing.assert_array_equal(grey, cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))


def test_grey_images_stay_as_they_are() -> None:
    image = texture()
    assert core.to_grey(image, is_rgb=True) is image
    np.testing.assert_array_equal(core.to_grey(image[:, ::2], is_rgb=True), image[:, ::2])
    np.testing.assert_array_equal(core.to_grey(image[..., np.newaxis], is_rgb=True), image)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((4, 5, 2), dtype=np.uint8),
        np.zeros((4, 5, 7), dtype=np.uint8),
        np.zeros(5, dtype=np.uint8),
        np.zeros((0, 5), dtype=np.uint8),
        np.zeros((4, 5), dtype=np.float32),
        np.zeros((4, 5), dtype=bool),
    ],
)
def test_other_images_are_refused(image: npt.NDArray[np.generic]) -> None:
    with pytest.raises(ImageError):
        core.to_grey(image, is_rgb=True)


@pytest.mark.parametrize(
    "kind", ["u1", "i1", "<u2", ">u2", "i2", "i4", "u4", "i8", "f2", "f4", "f8"]
)
def test_metres_of_any_numeric_depth(kind: str) -> None:
    raw = np.array([[0, 50, 100], [1, 2, 3]], dtype=kind)
    metres = core.to_depth_metres(raw, 50.0)
    assert metres.dtype == np.float32
    np.testing.assert_allclose(metres, raw.astype(np.float64) / 50.0, rtol=1e-6)


def test_wrong_depths_are_refused() -> None:
    for raw in (np.zeros((2, 2), dtype=bool), np.zeros((2, 2, 3), dtype=np.uint16)):
        with pytest.raises(ImageError):
            core.to_depth_metres(raw, 1.0)
    with pytest.raises(SettingsError, match="DepthMapFactor"):
        core.to_depth_metres(np.zeros((2, 2), dtype=np.uint16), -1.0)


def test_rgbd_frame() -> None:
    found = extraction()
    depth = np.full((HEIGHT, WIDTH), 2.0, dtype=np.float32)
    depth[:, : WIDTH // 2] = np.nan
    frame = core.build_rgbd_frame(context(), 5, 0.25, found, depth)
    assert (frame.id, frame.timestamp, frame.size, len(frame)) == (5, 0.25, len(found), len(found))
    assert not frame.described
    np.testing.assert_array_equal(frame.keypoints, found.keypoints[:, :2])
    np.testing.assert_array_equal(frame.raw_keypoints, frame.keypoints)
    np.testing.assert_array_equal(frame.levels, found.levels)
    np.testing.assert_array_equal(frame.angles, found.keypoints[:, 3])
    np.testing.assert_array_equal(frame.descriptors, found.descriptors)
    known = frame.keypoints[:, 0].astype(int) >= WIDTH // 2
    assert 0 < np.count_nonzero(known) < len(found)
    np.testing.assert_array_equal(frame.depth, np.where(known, np.float32(2), np.float32(-1)))
    np.testing.assert_allclose((frame.keypoints[:, 0] - frame.right_u)[known], 12.5, rtol=1e-5)
    x, y = frame.keypoints[7]
    assert 7 in frame.features_in_area(x, y, 2.0)


def test_wrong_depth_size_is_an_image_error() -> None:
    with pytest.raises(ImageError, match="320x240"):
        core.build_rgbd_frame(context(), 0, 0.0, extraction(), np.ones((9, 9), dtype=np.float32))
    with pytest.raises(ImageError, match="numeric, got bool"):
        core.build_rgbd_frame(
            context(), 0, 0.0, extraction(), np.ones((HEIGHT, WIDTH), dtype=np.bool_)
        )


@pytest.mark.parametrize("kind", ["<u2", ">u2", "i4", "u4", "f2", "f4", "f8"])
def test_raw_depth_is_divided_by_the_factor(kind: str) -> None:
    found = extraction()
    raw = np.tile(np.arange(WIDTH), (HEIGHT, 1)).astype(kind)
    frame = core.build_rgbd_frame(context(), 0, 0.0, found, raw, 50.0)
    columns = (frame.raw_keypoints[:, 0] + 0.5).astype(int)
    np.testing.assert_allclose(frame.depth, columns / 50.0, rtol=1e-6)


def test_stereo_frame_of_a_shifted_pair() -> None:
    pair = core.PairExtractor(core.OrbOptions(n_features=300)).extract(texture(), texture(shift=10))
    frame = core.build_stereo_frame(context(), 0, 0.0, *pair)
    known = frame.depth > 0
    assert np.count_nonzero(known) > 50
    error = frame.keypoints[known, 0] - frame.right_u[known] - 10
    assert np.median(np.abs(error)) < 0.5
    right_u, depth = core.match_stereo(*pair, core.ScalePyramid(1.2, 8), 25.0, 250.0)
    np.testing.assert_array_equal(frame.right_u, right_u)
    np.testing.assert_array_equal(frame.depth, depth)


def test_pair_extractor_equals_single_extractions() -> None:
    left, right = core.PairExtractor(core.OrbOptions(n_features=300)).extract(
        texture(seed=1), texture(seed=2)
    )
    for together, alone in (
        (left, extraction(texture(seed=1))),
        (right, extraction(texture(seed=2))),
    ):
        np.testing.assert_array_equal(together.keypoints, alone.keypoints)
        np.testing.assert_array_equal(together.descriptors, alone.descriptors)


def test_pair_extractor_refuses_unequal_sizes_and_goes_on() -> None:
    extractor = core.PairExtractor(core.OrbOptions(n_features=300))
    with pytest.raises(ImageError, match="one size"):
        extractor.extract(texture(), np.ascontiguousarray(texture()[:200]))
    assert len(extractor.extract(texture(), texture())) == 2


def test_pair_extractor_serves_one_thread_at_a_time() -> None:
    extractor = core.PairExtractor(core.OrbOptions(n_features=300))
    reference = extractor.extract(texture(), texture())[0].keypoints
    failures: list[BaseException] = []

    def work() -> None:
        for _ in range(20):
            try:
                pair = extractor.extract(texture(), texture())
                np.testing.assert_array_equal(pair[0].keypoints, reference)
            except StateError:
                pass  # the other thread was faster
            except BaseException as error:
                failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures


def test_tracked_frame() -> None:
    depth = np.full((HEIGHT, WIDTH), 2.0, dtype=np.float32)
    frame = core.build_rgbd_frame(context(), 3, 1.5, extraction(), depth)
    tracked = core.TrackedFrame(frame)
    assert tracked.features is frame
    assert (tracked.id, tracked.timestamp) == (3, 1.5)
    assert tracked.T_cw is None
    assert tracked.reference_keyframe == -1
    tracked.T_cw = core.Pose()
    np.testing.assert_array_equal(tracked.T_cw.matrix, np.eye(4))
    read = tracked.T_cw
    tracked.T_cw = core.Pose([0, 0, 0, 1], [1, 2, 3])
    np.testing.assert_array_equal(read.matrix, np.eye(4), "what was read stays")
    tracked.T_cw = None
    assert tracked.T_cw is None
    world = core.Map()
    keyframe = world.add_keyframe(frame, core.Pose())
    core.anchor_frame(world, tracked, keyframe)
    world.count_big_change()
    core.anchor_frame(world, tracked, keyframe)
    assert (tracked.reference_keyframe, tracked.big_change) == (keyframe, 1)
    other = core.TrackedFrame(frame)
    other.share_anchor(tracked)
    assert (other.reference_keyframe, other.big_change) == (keyframe, 1)

    tracked.associate(4, 17, np.array([1.0, 2.0, 3.0]))
    assert tracked.map_points.dtype == np.int64
    assert tracked.map_points[4] == 17
    np.testing.assert_array_equal(tracked.positions[4], [1, 2, 3])
    assert tracked.outlier.dtype == bool
    assert not tracked.outlier.any()
    assert tracked.n_associated() == 1
    assert tracked.n_close_tracked_untracked() == (1, len(frame) - 1)
    assert tracked.discard_outliers().size == 0
    with pytest.raises(IndexError):
        tracked.associate(len(frame), 1, np.zeros(3))
    tracked.dissociate(4)
    assert tracked.n_associated() == 0
    tracked.associate(5, 18, np.zeros(3))
    tracked.clear_associations()
    assert (tracked.map_points == -1).all()
    assert tracked.reference_keyframe == keyframe


def test_monocular_frame_of_a_distorting_lens() -> None:
    found = extraction()
    frame = core.build_monocular_frame(
        context(distortion=[0.2, -0.5, 0.0, 0.0, 0.0], bf=0.0), 0, 0.0, found
    )
    np.testing.assert_array_equal(frame.raw_keypoints, found.keypoints[:, :2])
    np.testing.assert_array_equal(frame.keypoints, frame.camera.from_image(frame.raw_keypoints))
    assert np.abs(frame.keypoints - frame.raw_keypoints).max() > 0.5
    assert (frame.depth == -1).all()


def test_frame_without_keypoints() -> None:
    """The original leaves it half built (OD-37)."""
    empty = extraction(np.full((HEIGHT, WIDTH), 99, dtype=np.uint8))
    for frame in (
        core.build_monocular_frame(context(), 0, 0.0, empty),
        core.build_stereo_frame(context(), 0, 0.0, empty, empty),
        core.build_rgbd_frame(context(), 0, 0.0, empty, np.ones((HEIGHT, WIDTH), np.float32)),
    ):
        assert frame.keypoints.shape == (0, 2)
        assert frame.descriptors.shape == (0, 32)
        assert core.TrackedFrame(frame).n_associated() == 0
