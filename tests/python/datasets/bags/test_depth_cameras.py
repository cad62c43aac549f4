# SPDX-License-Identifier: BSD-3-Clause
"""Depth of another camera than the images: registered, or refused."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import BagSequence
from support import bags, realsense

SIZE, FINE = (96, 72), (128, 96)
GREY = np.full(SIZE[::-1], 90, np.uint8)
#: The colour camera is 30 mm to the right of the depth camera.
T_COLOUR_DEPTH = np.eye(4)
T_COLOUR_DEPTH[0, 3] = -0.03
#: A slanted wall n X = 2 m in the depth camera.
WALL = np.array([0.3, 0.1, 1.0])


def seen(f: float, T: FloatArray, size: tuple[int, int] = SIZE) -> FloatArray:
    """Depth [m] of the wall from a camera at ``T_camera_depth``."""
    u, v = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    x, y = (u - (size[0] - 1) / 2) / f, (v - (size[1] - 1) / 2) / f
    return np.asarray((2 + WALL @ T[:3, 3]) / (WALL[0] * x + WALL[1] * y + WALL[2]))


DEPTH = np.round(seen(75, np.eye(4)) * 1000).astype(np.uint16)


def rgbd(
    path: Path,
    kind: str = "mcap",
    *,
    depth_f: float | None = 75,
    colour_f: float | None = 120,
    frames: tuple[str, str] = ("colour_optical", "depth_optical"),
    size: tuple[int, int] = SIZE,
    depth_topic: str = "/c/depth/image_rect_raw",
    more: tuple[bags.Made, ...] = (),
) -> Path:
    parent = depth_topic.rpartition("/")[0]
    grey = np.full(size[::-1], 90, np.uint8)
    made = [
        bags.raw_image("/c/color/image_raw", bags.START, grey, "mono8", frame=frames[0]),
        bags.raw_image(depth_topic, bags.START, DEPTH, "16UC1", frame=frames[1]),
    ]
    for topic, f, of in (("/c/color", colour_f, size), (parent, depth_f, SIZE)):
        if f is not None:
            K = realsense.camera_matrix(f, of)
            made.append(bags.camera_info(f"{topic}/camera_info", bags.START, size=of, K=K))
    return bags.write(path / "b", kind, [*made, *more])


def edge(T: FloatArray = T_COLOUR_DEPTH) -> bags.Made:
    return bags.frames("/tf_static", ("colour_optical", "depth_optical", T))


def registered_error(sequence: BagSequence, f: float, size: tuple[int, int] = SIZE) -> float:
    found = sequence.load(0).depth
    assert found is not None
    assert found.shape == size[::-1]
    known = found > 0
    assert known.mean() > 0.9
    true = seen(f, T_COLOUR_DEPTH, size)
    return float(np.abs(found / 1000 - true)[known].max())


@pytest.mark.parametrize("kind", bags.KINDS)
def test_registered(tmp_path: Path, kind: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO):
        sequence = BagSequence(rgbd(tmp_path, kind, more=(edge(),)))
    assert "fx 75 against 120" in caplog.text
    assert "30.0 mm apart" in caplog.text
    assert "wrong" not in caplog.text
    assert sequence.settings.camera.fx == 120
    assert registered_error(sequence, 120) < 0.02
    unregistered = np.abs(DEPTH / 1000 - seen(120, T_COLOUR_DEPTH)).max()
    assert unregistered > 0.1


def test_the_other_parent(tmp_path: Path) -> None:
    edge = bags.frames(
        "/tf_static", ("depth_optical", "colour_optical", np.linalg.inv(T_COLOUR_DEPTH))
    )
    assert registered_error(BagSequence(rgbd(tmp_path, more=(edge,))), 120) < 0.02


def test_another_size(tmp_path: Path) -> None:
    sequence = BagSequence(rgbd(tmp_path, colour_f=130, size=FINE, more=(edge(),)))
    assert registered_error(sequence, 130, FINE) < 0.02


def test_another_place_only(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """K and size are equal, and the transform says that the cameras are two."""
    with caplog.at_level(logging.INFO):
        sequence = BagSequence(rgbd(tmp_path, colour_f=75, more=(edge(),)))
    assert "(another place)" in caplog.text
    assert registered_error(sequence, 75) < 0.02


def test_one_place_is_left_as_it_is(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    T = np.eye(4)
    T[0, 3] = 1e-5
    sequence = BagSequence(rgbd(tmp_path, colour_f=75.0001, more=(edge(T),)))
    assert "wrong" not in caplog.text
    depth = sequence.load(0).depth
    assert depth is not None
    assert depth.dtype == np.uint16
    assert np.array_equal(depth, DEPTH)


def test_equal_frames(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Coordinates of one name are in one place, which may be a driver's mistake."""
    sequence = BagSequence(rgbd(tmp_path, frames=("camera", "camera")))
    assert "assumed to be at the same place" in caplog.text
    found = sequence.load(0).depth
    assert found is not None
    assert np.abs(found / 1000 - seen(120, np.eye(4)))[found > 0].max() < 0.02


def test_settings_of_the_user_say_where_pixels_are(tmp_path: Path) -> None:
    K = realsense.camera_matrix(115, SIZE)
    camera = orb.CameraSettings(
        fx=115, fy=115, cx=K[0, 2], cy=K[1, 2], width=SIZE[0], height=SIZE[1]
    )
    settings = orb.settings.settings_for_camera(camera, "rgbd", depth_factor=1000)
    bag = rgbd(tmp_path, colour_f=None, more=(edge(),))
    assert registered_error(BagSequence(bag, settings=settings), 115) < 0.02


def test_depth_of_another_camera_is_not_registered_to_a_fisheye(tmp_path: Path) -> None:
    camera = orb.CameraSettings(70, 70, 47.5, 35.5, model="fov", lens=(0.9,))
    settings = orb.settings.settings_for_camera(camera, "rgbd", depth_factor=1000)
    bag = rgbd(tmp_path, colour_f=None, more=(edge(),))
    with pytest.raises(orb.DatasetError, match=r"registered to a fisheye camera; .*--sensor mono"):
        BagSequence(bag, settings=settings)


@pytest.mark.parametrize("layout", ["viewer", "sdk"])
def test_recordings_of_the_sdk(tmp_path: Path, layout: str) -> None:
    depth, grey = [DEPTH, DEPTH], [GREY, GREY]
    made = realsense.viewer_stream if layout == "viewer" else realsense.sdk_stream
    messages = [
        *made("Depth_0", depth, 75, T_stream_reference=np.eye(4)),
        *made("Color_0", grey, 120, T_stream_reference=T_COLOUR_DEPTH),
    ]
    if layout == "viewer":
        sequence = BagSequence(bags.write(tmp_path / "b", "rosbag1", messages))
    else:
        sequence = BagSequence(realsense.write_sdk(tmp_path / "b", messages))
    assert len(sequence) == 2
    assert registered_error(sequence, 120) < 0.02


def test_a_registered_topic_goes_first(tmp_path: Path) -> None:
    topic = "/c/aligned_depth_to_color/image_raw"
    own = bags.raw_image(topic, bags.START, DEPTH, "16UC1", frame="colour_optical")
    info = bags.camera_info(
        topic.replace("image_raw", "camera_info"),
        bags.START,
        size=SIZE,
        K=realsense.camera_matrix(120, SIZE),
    )
    sequence = BagSequence(rgbd(tmp_path, more=(edge(), own, info)))
    assert sequence.topics.depth is not None
    assert sequence.topics.depth.topic.name == topic
    depth = sequence.load(0).depth
    assert depth is not None
    assert np.array_equal(depth, DEPTH)


MOVING = tuple(
    bags.frames("/tf", ("colour_optical", "depth_optical", T), stamp=bags.START + i)
    for i, T in enumerate((T_COLOUR_DEPTH, np.eye(4), T_COLOUR_DEPTH))
)
REFUSED: dict[str, tuple[dict[str, Any], list[str]]] = {
    "no transform": ({}, ["(fx 75 against 120)", "without the transform between the two cameras"]),
    "frames without names": ({"frames": ("0", "0")}, ["without the transform"]),
    "a transform to elsewhere": (
        {"more": (bags.frames("/tf_static", ("base", "depth_optical", np.eye(4))),)},
        ["without the transform between the two cameras (topic /tf_static)"],
    ),
    "a transform that is none": ({"more": (edge(np.full((4, 4), np.nan)),)}, ["the transform"]),
    "a transform that moves": ({"more": MOVING}, ["without the transform"]),
    "another size, no calibration of depth": (
        {"size": FINE, "depth_f": None, "more": (edge(),)},
        ["96 x 72 pixels against 128 x 96", "a CameraInfo for /c/depth/image_rect_raw"],
    ),
    "another size, no calibration of colour": (
        {"size": FINE, "colour_f": None, "more": (edge(),)},
        ["a CameraInfo for /c/color/image_raw"],
    ),
    "the name says otherwise": (
        {"depth_topic": "/c/aligned_depth_to_color/image_raw"},
        ["aligned_depth_to_color/image_raw is of another camera", "fx 75 against 120"],
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused(tmp_path: Path, case: str) -> None:
    options, expected = REFUSED[case]
    with pytest.raises(orb.DatasetError) as told:
        BagSequence(rgbd(tmp_path, **options))
    for text in (*expected, "align_depth.enable:=true", "--sensor mono"):
        assert text in str(told.value)
    assert len(BagSequence(tmp_path / "b", "mono")) == 1


def test_the_user_may_know_better(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The remedy that the message names: depth is taken as it is, and a warning says the risk."""
    bag = rgbd(tmp_path)
    with pytest.raises(orb.DatasetError, match="depth_info=/c/color/camera_info"):
        BagSequence(bag)
    sequence = BagSequence(bag, topics="depth_info=/c/color/camera_info")
    depth = sequence.load(0).depth
    assert depth is not None
    assert np.array_equal(depth, DEPTH)
    assert (
        "depth of /c/depth/image_rect_raw has a CameraInfo of another camera (fx 75 against 120): "
        "if it is not registered to the images, the result is wrong"
    ) in caplog.text


def test_equal_cameras_need_no_warning(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    bag = rgbd(tmp_path, colour_f=75, frames=("colour_optical", "colour_optical"))
    assert len(BagSequence(bag, topics="depth_info=/c/color/camera_info")) == 1
    assert not caplog.records


@pytest.mark.parametrize("pair", [True, False])
def test_recordings_of_the_viewer_get_a_remedy_that_works(tmp_path: Path, pair: bool) -> None:
    """The Viewer cannot align depth; an infrared pair can be run where there is one."""
    place = np.eye(4)
    messages = [
        *realsense.viewer_stream("Depth_0", [DEPTH], 75),
        *realsense.viewer_stream("Color_0", [GREY], 120),
    ]
    for name in ("Infrared_1", "Infrared_2") if pair else ():
        place[0, 3] -= 0.05
        messages += realsense.viewer_stream(name, [GREY], 75, T_stream_reference=place.copy())
    bag = bags.write(tmp_path / "b", "rosbag1", messages)
    with pytest.raises(orb.DatasetError) as told:
        BagSequence(bag, "rgbd")
    message = str(told.value)
    topics = "/device_0/sensor_1/Color_0/tf/... and /device_0/sensor_0/Depth_0/tf/..."
    assert f"the transform between the two cameras (topics {topics})" in message
    assert "the RealSense Viewer does not record aligned depth" in message
    assert ("--sensor stereo" in message) == pair
    assert len(BagSequence(bag, "mono")) == 1
    if pair:
        assert len(BagSequence(bag, "stereo")) == 1


@pytest.mark.parametrize("missing", ["depth_f", "colour_f"])
def test_nothing_says_otherwise(
    tmp_path: Path, missing: str, caplog: pytest.LogCaptureFixture
) -> None:
    """Without one of the calibrations depth is taken as it is, with a warning if frames differ."""
    bag = rgbd(tmp_path, **{missing: None})  # type: ignore[arg-type]
    sequence = BagSequence(bag, settings=None if missing == "depth_f" else "tum1")
    assert "if it is not registered to the" in caplog.text
    assert "the result is wrong" in caplog.text
    depth = sequence.load(0).depth
    assert depth is not None
    assert np.array_equal(depth, DEPTH)
