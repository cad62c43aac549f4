# SPDX-License-Identifier: BSD-3-Clause
"""Images and time stamps of every kind: refused without harm, or taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from orbslam2py import ImageError, Reason, Sensor, System, TrackingState
from orbslam2py.datasets import Images
from support.small_sequences import images, new_system, play, sequence, track

pytestmark = pytest.mark.watchdog(30)


def test_bad_time_stamps(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        track(system, 0, timestamp=1.0)
        for bad in (1.0, 0.5, float("nan"), float("inf"), -float("inf"), 10**400):
            with pytest.raises(ImageError, match="time stamp"):
                track(system, 1, timestamp=bad)
        assert track(system, 1, timestamp=1.05).frame_id == 1, "refused images are not counted"
        system.reset()
        assert track(system, 2, timestamp=1.0).frame_id == 0, "a new map begins its own time"


def test_nanoseconds_are_tracked_and_told_once(
    sensor: Sensor, caplog: pytest.LogCaptureFixture
) -> None:
    with new_system(sensor, deterministic=True) as system:
        for k in range(3):
            state = track(system, k, timestamp=1_403_636_579_763_555_584 + k * 50_000_000).state
            assert state is TrackingState.OK
    told = [text for text in caplog.messages if "too large for seconds" in text]
    assert len(told) == 1
    assert "divide nanoseconds by 1e9" in told[0]


GREY = np.zeros((240, 320), np.uint8)

BAD_IMAGES = {
    "no array": ([[1, 2], [3, 4]], "NumPy array, got list"),
    "None": (None, "got NoneType"),
    "float": (GREY.astype(np.float32), "uint8, got float32"),
    "16 bits": (GREY.astype(np.uint16), "uint8, got uint16"),
    "empty": (np.zeros((0, 0), np.uint8), "empty"),
    "one dimension": (np.zeros(100, np.uint8), "shape"),
    "two channels": (np.zeros((240, 320, 2), np.uint8), "shape"),
    "four dimensions": (np.zeros((1, 240, 320, 3), np.uint8), "shape"),
    "another size": (np.zeros((200, 320), np.uint8), "size"),
}


@pytest.mark.parametrize("place", ["image", "second"])
@pytest.mark.parametrize("kind", BAD_IMAGES)
def test_bad_images_change_nothing(sensor: Sensor, kind: str, place: str) -> None:
    """The original notices neither empty images nor another type or size (OD-24, OD-25)."""
    bad, message = BAD_IMAGES[kind]
    if sensor is Sensor.RGBD and place == "second":
        if kind in {"float", "16 bits", "another size"}:
            pytest.skip("allowed for depth, or tested below")
        message = "depth"
    with new_system(sensor, deterministic=True) as system:
        play(system, 3)
        before = system.map_hash()
        good = images(sensor, 3)
        second = good.right if sensor is Sensor.STEREO else good.depth
        image, second = (bad, second) if place == "image" else (good.image, bad)
        shown = Images(image, second, second)  # type: ignore[arg-type]
        call = system.track_stereo if sensor is Sensor.STEREO else system.track_rgbd
        with pytest.raises(ImageError, match=message):
            call(shown.image, second, 10.0)  # type: ignore[operator]
        assert system.map_hash() == before
        record = track(system, 3)
        assert (record.state, record.frame_id) == (TrackingState.OK, 3)


def test_stereo_images_of_different_size() -> None:
    shown = images(Sensor.STEREO, 0)
    assert shown.right is not None
    with new_system(Sensor.STEREO) as system:
        with pytest.raises(ImageError, match="left image has size 320x240, the right 300x240"):
            system.track_stereo(shown.image, shown.right[:, :300], 0.0)
        with pytest.raises(ImageError, match="differ"):
            system.track_stereo(np.dstack([shown.image] * 3), shown.right, 0.0)
        assert track(system, 0).state is TrackingState.OK


@pytest.mark.parametrize("size", [(1, 1), (5, 4), (30, 30), (240, 1), (1, 320)])
def test_a_refused_first_image_does_not_fix_the_size(sensor: Sensor, size: tuple[int, int]) -> None:
    tiny = np.zeros(size, np.uint8)
    with new_system(sensor) as system:
        shown = Images(tiny, tiny, tiny.astype(np.uint16))
        with pytest.raises(ImageError, match=r"too small: .* 62 per side .* give whole images"):
            track(system, 0, shown=shown)
        record = track(system, 0)
        assert record.frame_id == 0
        assert record.reason is not Reason.TOO_FEW_KEYPOINTS


def padded(shown: Images) -> Images:
    """The same images on a larger black ground."""
    grey = np.zeros((260, 352), np.uint8)
    grey[:240, :320] = shown.image
    right = depth = None
    if shown.right is not None:
        right = np.zeros_like(grey)
        right[:240, :320] = shown.right
    if shown.depth is not None:
        depth = np.zeros(grey.shape, shown.depth.dtype)
        depth[:240, :320] = shown.depth
    return Images(grey, right, depth)


def test_reset_frees_the_size(sensor: Sensor) -> None:
    larger = padded(images(sensor, 3))
    with new_system(sensor, deterministic=True) as system:
        play(system, 3)
        with pytest.raises(
            ImageError, match="size 352x260, the first image had 320x240; give images of one"
        ):
            track(system, 3, shown=larger)
        system.reset()
        record = track(system, 3, shown=larger)
        assert (record.frame_id, record.map_index) == (0, 1)
        with pytest.raises(ImageError, match="size 320x240, the first image had 352x260"):
            track(system, 4)
        for index in range(4, 20):
            last = track(system, index, shown=padded(images(sensor, index)))
        assert last.state is TrackingState.OK
        assert system.check_map() == []


@pytest.mark.parametrize(
    "depth",
    [
        np.zeros((240, 320), np.uint16),
        np.full((240, 320), np.nan, np.float32),
        np.full((240, 320), np.inf, np.float32),
        np.full((240, 320), -1.0, np.float64),
    ],
    ids=["zero", "NaN", "infinite", "negative"],
)
def test_depth_without_information(depth: np.ndarray) -> None:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        first = images(Sensor.RGBD, 0)
        record = track(system, 0, shown=Images(first.image, depth=depth))
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason is Reason.TOO_FEW_DEPTHS
        play(system, 10, first=1)
        # In the middle the map carries on: the points are known already.
        shown = images(Sensor.RGBD, 11)
        for i in (11, 12):
            assert (
                track(system, i, shown=Images(shown.image, depth=depth)).state is TrackingState.OK
            )
        assert track(system, 13).state is TrackingState.OK
        assert system.check_map() == []
        assert np.isfinite(system.trajectory().T_wc).all()


@pytest.mark.parametrize("metres", [1e-30, 1e-3, 1e6, 1e30])
def test_absurd_depth_does_no_harm(metres: float) -> None:
    shown = images(Sensor.RGBD, 0)
    absurd = Images(shown.image, depth=np.full((240, 320), metres * 5000, np.float32))
    with new_system(Sensor.RGBD, deterministic=True) as system:
        for i in range(3):
            track(system, i, shown=absurd)
        assert np.isfinite(system.map_snapshot().point_positions).all()
        system.reset()
        play(system, 10, first=3)
        for i in (13, 14):
            track(system, i, shown=absurd)
        records = play(system, 5, first=15)
        assert records[-1].state is TrackingState.OK
        assert system.check_map() == []
        assert np.isfinite(system.trajectory().T_wc).all()
        assert np.isfinite(system.map_snapshot().point_positions).all()


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i4", "i8", "f2", "f4", "f8", ">u2", ">f4"])
def test_depth_of_any_number_type(dtype: str) -> None:
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    metres = np.asarray(shown.depth, np.float64) / 5000
    raw = np.minimum(np.rint(metres * 20), 255).astype(dtype)
    settings = sequence(Sensor.RGBD).settings
    assert settings.depth is not None
    settings = replace(settings, depth=replace(settings.depth, raw_per_metre=20.0))
    with System(settings, "rgbd", deterministic=True) as system:
        record = system.track_rgbd(shown.image, raw, 0.0, details=True)
    assert record.features is not None
    depths = record.features.depths
    assert 0.3 < np.median(depths[depths > 0]) < 20


def test_arrays_of_any_layout_give_the_same_result() -> None:
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    image, depth = shown.image, shown.depth
    frozen = image.copy()
    frozen.setflags(write=False)
    colour = np.dstack([image] * 3)
    layouts = {
        "as is": (image, depth),
        "with one channel": (image[:, :, None], depth),
        "Fortran order": (np.asfortranarray(image), np.asfortranarray(depth)),
        "reversed twice": (image[::-1].copy()[::-1], depth[:, ::-1].copy()[:, ::-1]),
        "every second column": (np.repeat(image, 2, axis=1)[:, ::2], depth),
        "read-only": (frozen, depth),
        "colour": (colour, depth),
        "colour with alpha": (np.dstack([colour, image]), depth),
        "a view of a larger image": (np.pad(image, 7)[7:-7, 7:-7], depth),
    }
    hashes = {}
    for name, (first, second) in layouts.items():
        with new_system(Sensor.RGBD, deterministic=True) as system:
            system.track_rgbd(first, second, 0.0)
        hashes[name] = system.map_hash()
    assert len(set(hashes.values())) == 1, hashes
