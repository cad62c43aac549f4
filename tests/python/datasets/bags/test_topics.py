# SPDX-License-Identifier: BSD-3-Clause
"""Which topics are taken, what is asked, and what belongs together by time."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from orbslam2py.settings import Sensor
from support import bags

GREY = np.full((24, 32), 90, np.uint8)
COLOUR = np.full((24, 32, 3), 90, np.uint8)
DEPTH = np.full((24, 32), 900, np.uint16)


def image(topic: str, stamp: int = bags.START, *, frame: str = "camera") -> bags.Made:
    if topic.endswith("compressed"):
        return bags.packed_image(topic, stamp, bags.encoded(COLOUR, ".jpg"), "jpeg")
    if "depth" in topic:
        return bags.raw_image(topic, stamp, DEPTH, "16UC1", frame=frame)
    grey = "color" not in topic and "rgb" not in topic
    array, encoding = (GREY, "mono8") if grey else (COLOUR, "rgb8")
    return bags.raw_image(topic, stamp, array, encoding, frame=frame)


def opened(
    path: Path, *topics: str, sensor: str | None = None, named: str | None = None
) -> BagSequence:
    bag = bags.write(path / "b", "mcap", [image(topic) for topic in topics])
    return BagSequence(bag, sensor, topics=named)


@pytest.mark.parametrize(
    ("topics", "sensor", "chosen"),
    [
        (["/camera/image_raw"], "mono", ["/camera/image_raw"]),
        (["/image", "/image/compressed"], "mono", ["/image"]),
        (["/camera/image_rect", "/camera/image_raw"], "mono", ["/camera/image_rect"]),
        (["/cam0/image_raw", "/cam1/image_raw"], "stereo", ["/cam0/image_raw", "/cam1/image_raw"]),
        (["/camera_right", "/camera_left"], "stereo", ["/camera_left", "/camera_right"]),
        (
            ["/camera/infra2/image_rect_raw", "/camera/infra1/image_rect_raw"],
            "stereo",
            ["/camera/infra1/image_rect_raw", "/camera/infra2/image_rect_raw"],
        ),
        (
            [
                "/s/left/image_raw",
                "/s/left/image_rect",
                "/s/right/image_raw",
                "/s/right/image_rect",
            ],
            "stereo",
            ["/s/left/image_rect", "/s/right/image_rect"],
        ),
        (
            ["/cam0/image_raw", "/cam1/image_raw", "/cam2/image_raw"],
            "stereo",
            ["/cam0/image_raw", "/cam1/image_raw"],
        ),
        (["/camera/rgb/image_color", "/camera/depth/image"], "rgbd", None),
        (
            [
                "/c/depth/image_rect_raw",
                "/c/aligned_depth_to_color/image_raw",
                "/c/color/image_raw",
            ],
            "rgbd",
            ["/c/color/image_raw", "/c/aligned_depth_to_color/image_raw"],
        ),
        (
            ["/c/infra1/image", "/c/infra2/image", "/c/color/image", "/c/depth/image"],
            "rgbd",
            ["/c/color/image", "/c/depth/image"],
        ),
        (
            ["/c/infra2/image", "/c/infra1/image", "/c/depth/image"],
            "rgbd",
            ["/c/infra1/image", "/c/depth/image"],
        ),
        (
            [
                "/c/aligned_depth_to_infra1/image_raw",
                "/c/aligned_depth_to_color/image_raw",
                "/c/color/image_raw",
            ],
            "rgbd",
            ["/c/color/image_raw", "/c/aligned_depth_to_color/image_raw"],
        ),
    ],
)
def test_guess(tmp_path: Path, topics: list[str], sensor: str, chosen: list[str] | None) -> None:
    sequence = opened(tmp_path, *topics)
    assert sequence.sensor is Sensor(sensor)
    roles = sequence.topics
    found = [one.topic.name for one in (roles.left, roles.right, roles.depth) if one is not None]
    assert found == (chosen or topics)


@pytest.mark.parametrize(
    ("topics", "sensor", "what", "example"),
    [
        (
            ["/front/image_raw", "/back/image_raw"],
            "mono",
            "are the images;",
            "image=/back/image_raw",
        ),
        (["/a/image", "/b/image"], "stereo", "left and right", "left=/a/image,right=/b/image"),
        (
            ["/a_left", "/a_right", "/b_left", "/b_right"],
            "stereo",
            "the left and right images",
            "left=/a_left,right=/a_right",
        ),
        (["/a_rgb", "/b_depth", "/c_depth"], "rgbd", "the depth", "image=/a_rgb,depth=/b_depth"),
        (
            ["/a_rgb", "/b_rgb", "/c_depth"],
            "rgbd",
            "belong to the dep",
            "image=/a_rgb,depth=/c_depth",
        ),
    ],
)
def test_not_certain(
    tmp_path: Path, topics: list[str], sensor: str, what: str, example: str
) -> None:
    with pytest.raises(orb.DatasetError) as told:
        opened(tmp_path, *topics, sensor=sensor)
    message = str(told.value)
    assert what in message
    assert message.endswith(f"--topics {example}")
    for topic in topics:
        assert f"\n  {topic} (sensor_msgs/msg/Image, " in message
    assert "32 x 24, 1)" in message


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("/camera/fisheye1/image_raw", "/camera/fisheye2/image_raw"),
        (
            "/device_0/sensor_0/Infrared_1/image/data",
            "/device_0/sensor_0/Infrared_2/image/data",
        ),
        ("/cam0/image0", "/cam1/image1"),
        ("/rig/cameraLeft", "/rig/cameraRight"),
        ("/LEFT/image", "/RIGHT/image"),
        ("/stereo/l/image_raw", "/stereo/r/image_raw"),
        ("/oak/mono_1", "/oak/mono_2"),
    ],
)
@pytest.mark.parametrize("kind", bags.KINDS)
def test_pairs_by_one_word(tmp_path: Path, left: str, right: str, kind: str) -> None:
    bag = bags.write(tmp_path / "b", kind, [image(right), image(left)])
    roles = BagSequence(bag, "stereo").topics
    assert roles.right is not None
    assert (roles.left.topic.name, roles.right.topic.name) == (left, right)
    assert BagSequence(bag).sensor is Sensor.STEREO
    assert BagSequence(bag, "mono").topics.left.topic.name == left


@pytest.mark.parametrize(
    ("left", "right"),
    [
        ("/cam0/image1", "/cam1/image2"),  # two numbers, which differ in different ways
        ("/cam0/image", "/cam2/image"),
        ("/cam1/image", "/cam10/image"),
        ("/left/image", "/right/picture"),
        ("/left/image", "/front/image"),
    ],
)
def test_no_pairs(tmp_path: Path, left: str, right: str) -> None:
    with pytest.raises(orb.DatasetError) as told:
        opened(tmp_path, left, right, sensor="stereo")
    example = ",".join(
        f"{role}={name}"
        for role, name in zip(("left", "right"), sorted((left, right)), strict=True)
    )
    assert str(told.value).endswith(f"--topics {example}")
    assert opened(tmp_path / "again", left, right, named=example).sensor is Sensor.STEREO


def test_named(tmp_path: Path) -> None:
    topics = ["/a_left", "/a_right", "/b_left", "/b_right"]
    sequence = opened(tmp_path, *topics, named="left=/b_left,right=a_right")
    assert sequence.sensor is Sensor.STEREO
    assert sequence.topics.right is not None
    assert sequence.topics.left.topic.name == "/b_left"
    assert sequence.topics.right.topic.name == "/a_right"


def test_one_named_finds_its_partner(tmp_path: Path) -> None:
    topics = ["/a_left", "/a_right", "/b_left", "/b_right"]
    sequence = opened(tmp_path, *topics, sensor="stereo", named="left=/b_left")
    assert sequence.topics.right is not None
    assert sequence.topics.right.topic.name == "/b_right"


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("left", "'left' is no ROLE=/TOPIC"),
        (
            "middle=/a_left",
            "the role 'middle' of 'middle=/a_left' is unknown; roles are image or left, right, "
            "depth, info or left_info, right_info, depth_info, truth",
        ),
        ("left=/a_left,image=/a_right", "'image=/a_right' is there twice"),
        ("left=/none", r"has no messages of /none \(left\); it has /a_left"),
        ("truth=/a_left", "has no poses; true poses are of the types geometry_msgs"),
    ],
)
def test_wrong_names(tmp_path: Path, named: str, message: str) -> None:
    with pytest.raises(orb.DatasetError, match=message):
        opened(tmp_path, "/a_left", "/a_right", named=named)


def test_an_unknown_role_of_a_dictionary(tmp_path: Path) -> None:
    bag = bags.write(tmp_path / "b", "mcap", [image("/a_left")])
    with pytest.raises(orb.DatasetError, match="the role 'middle' is unknown; roles are image or"):
        BagSequence(bag, topics={"middle": "/a_left"})


def test_pairs_by_time(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """The right camera is 3 ms late, and two of its images are missing."""
    messages = []
    for i in range(6):
        stamp = bags.START + i * bags.STEP
        left = np.full((24, 32), i, np.uint8)
        messages.append(bags.raw_image("/left", stamp, left, "mono8"))
        if i not in (1, 4):
            right = bags.raw_image("/right", stamp + 3_000_000, left + 100, "mono8")
            messages.append(right)
    bag = bags.write(tmp_path / "b", "rosbag2", messages)
    settings = orb.Settings.load(write_settings(tmp_path), "stereo")
    sequence = BagSequence(bag, "stereo", settings=settings)
    assert len(sequence) == 4
    for index, number in enumerate((0, 2, 3, 5)):
        images = sequence.load(index)
        assert images.right is not None
        assert (images.image[0, 0], images.right[0, 0]) == (number, 100 + number)
    assert "2 images of /left have none of /right, left out" in caplog.text
    assert "up to 3.0 ms apart" in caplog.text


def write_settings(folder: Path) -> Path:
    camera = orb.CameraSettings(fx=20, fy=20, cx=15.5, cy=11.5, width=32, height=24, bf=2)
    path = folder / "pair.yaml"
    orb.settings.settings_for_camera(camera, "stereo").save(path)
    return path


def test_clocks_that_do_not_agree(tmp_path: Path) -> None:
    messages = [image("/left"), image("/right", bags.START + 10**9)]
    with pytest.raises(orb.DatasetError, match=r"no image of /left was taken within .* 1.000 s"):
        BagSequence(bags.write(tmp_path / "b", "mcap", messages), "stereo")


def test_stamps_that_nobody_set(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Then the times of recording count."""
    rows = GREY.reshape(-1)
    messages = [
        bags.Made(
            "/i", bags.IMAGE, 0, (24, 32, "mono8", 0, 32, rows), recorded=bags.START + i * 10**8
        )
        for i in range(4)
    ]
    sequence = BagSequence(bags.write(tmp_path / "b", "rosbag1", messages))
    assert np.allclose(np.diff(sequence.timestamps), 0.1)
    assert "the times of recording are taken" in caplog.text


def test_a_gap_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    times = [0, 1, 2, 3, 103, 104, 105]
    messages = [image("/i", bags.START + t * bags.STEP) for t in times]
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages))
    assert len(sequence) == len(times)
    assert "missing in 1 places; the longest gap is 5.0 s after frame 3" in caplog.text


def test_equal_stamps_are_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    messages = [image("/i", bags.START + t * bags.STEP) for t in (0, 1, 1, 2)]
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages))
    assert len(sequence) == 3
    assert "1 images of /i have the stamp of another one, left out" in caplog.text


def test_depth_of_another_camera(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    messages = [image("/rgb", frame="rgb_optical"), image("/depth", frame="depth_optical")]
    BagSequence(bags.write(tmp_path / "b", "mcap", messages))
    assert "depth of /depth has the frame_id 'depth_optical', and the images have" in caplog.text
    caplog.clear()
    with caplog.at_level(logging.INFO):
        BagSequence(bags.write(tmp_path / "c", "mcap", [image("/rgb"), image("/depth")]))
    assert "1 frames of /rgb and /depth" in caplog.text
    assert "coordinates" not in caplog.text


def test_depth_of_another_size(tmp_path: Path) -> None:
    small = bags.raw_image("/depth", bags.START, DEPTH[::2, ::2].copy(), "16UC1")
    with pytest.raises(orb.DatasetError, match=r"16 x 12 pixels against 32 x 24.*align_depth"):
        BagSequence(bags.write(tmp_path / "b", "mcap", [image("/rgb"), small]))
