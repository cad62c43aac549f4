# SPDX-License-Identifier: BSD-3-Clause
"""Topics as a live source: which are chosen, what is delivered, and with which stamps."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py.errors import DatasetError
from orbslam2py.live.device import Request
from orbslam2py.ros import gathering
from orbslam2py.ros.device import TopicsDevice
from orbslam2py.settings import Sensor
from support.memory_transport import MemoryNetwork, MemoryTransport
from support.ros_messages import (
    START,
    STEP,
    camera_info,
    imu,
    packed_image,
    raw_image,
    static_transform,
)

IMAGE, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
INFO, IMU, TF = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Imu", "tf2_msgs/msg/TFMessage"
SIZE = (32, 24)
GREY = np.arange(SIZE[0] * SIZE[1], dtype=np.uint8).reshape(SIZE[1], SIZE[0])


class RecordingSink:
    def __init__(self) -> None:
        self.images: list[tuple[str, np.ndarray, float, float | None]] = []
        self.samples: dict[str, list[np.ndarray]] = {"imu": [], "gyro": [], "accel": []}
        self.warnings: list[str] = []

    def image(self, stream: str, array: Any, stamp: float, exposure: float | None = None) -> None:
        self.images.append((stream, array, stamp, exposure))

    def imu(self, samples: np.ndarray) -> None:
        self.samples["imu"].append(samples)

    def gyro(self, samples: np.ndarray) -> None:
        self.samples["gyro"].append(samples)

    def accel(self, samples: np.ndarray) -> None:
        self.samples["accel"].append(samples)

    def fault(self, text: str) -> None:
        raise AssertionError(text)

    def warning(self, text: str) -> None:
        self.warnings.append(text)


class Nodes:
    """Messages that are published again and again, once for each who subscribes."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for name, seconds in (("DISCOVERY", 0.1), ("MESSAGES", 0.2), ("_SETTLING", 0.0)):
            monkeypatch.setattr(gathering, name, seconds)
        self.network = MemoryNetwork()
        self.given: dict[str, list[Any]] = {}
        self.network.on_subscribe = self._publish

    def add(self, name: str, kind: str, *messages: Any) -> None:
        self.network.offer(name, kind)
        self.given[name] = list(messages)

    def open(self, **asked: Any) -> TopicsDevice:
        return TopicsDevice(lambda: MemoryTransport(self.network), "ros2", Request(**asked))

    def _publish(self, name: str) -> None:
        for message in self.given.get(name, ()):
            self.network.send(name, message)


@pytest.fixture
def nodes(monkeypatch: pytest.MonkeyPatch) -> Nodes:
    return Nodes(monkeypatch)


def _images(
    encoding: str = "mono8", array: Any = GREY, n: int = 6, frame: str = "cam"
) -> list[Any]:
    return [raw_image(array, encoding, START + i * STEP, frame) for i in range(n)]


def _add_pair(nodes: Nodes) -> None:
    for side, bf in (("left", 0.0), ("right", 12.0)):
        nodes.add(f"/cam/{side}/image_raw", IMAGE, *_images())
        nodes.add(f"/cam/{side}/camera_info", INFO, camera_info(SIZE, bf=bf))


def test_a_pair_is_found_by_names_and_its_settings_by_camera_info(nodes: Nodes) -> None:
    _add_pair(nodes)
    nodes.add("/scan", "sensor_msgs/msg/LaserScan")
    device = nodes.open(sensor=Sensor.STEREO)
    assert device.streams == ("left", "right")
    settings = device.settings()
    assert settings is not None
    camera = settings.camera
    assert (camera.fx, camera.cx, camera.cy, camera.bf) == (100.0, 15.5, 11.5, 12.0)
    assert (camera.width, camera.height, camera.fps, camera.rgb) == (*SIZE, 20.0, False)
    sink = RecordingSink()
    device.start(sink)
    streams = [stream for stream, *_ in sink.images]
    assert streams == ["left"] * 6 + ["right"] * 6
    _, array, stamp, exposure = sink.images[1]
    np.testing.assert_array_equal(array, GREY)
    assert stamp == (START + STEP) / 1e9
    assert device.nanoseconds_of(stamp) == START + STEP
    assert exposure is None  # the stamps are years old


def test_nothing_is_delivered_after_a_stop_and_a_start_goes_on(nodes: Nodes) -> None:
    _add_pair(nodes)
    device, sink = nodes.open(), RecordingSink()
    device.start(sink)
    device.stop()
    n = len(sink.images)
    nodes.network.send("/cam/left/image_raw", raw_image(GREY, "mono8", START + 99 * STEP))
    assert len(sink.images) == n
    device.start(sink)
    assert len(sink.images) == 2 * n
    device.stop()
    del nodes.network.offered["/cam/right/image_raw"]
    with pytest.raises(DatasetError, match="ros2: nobody publishes /cam/right/image_raw"):
        device.start(sink)


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("rgb8", np.full((24, 32, 3), (200, 100, 50), np.uint8), (50, 100, 200)),
        ("bgr8", np.full((24, 32, 3), (50, 100, 200), np.uint8), (50, 100, 200)),
        ("bayer_rggb8", np.full((24, 32), 90, np.uint8), (90, 90, 90)),
        ("mono16", np.full((24, 32), 30000, np.uint16), (30000,)),
    ],
)
def test_colours_come_as_bgr_and_16_bits_as_they_are(
    nodes: Nodes, encoding: str, pixels: np.ndarray, expected: tuple[int, ...]
) -> None:
    nodes.add("/image_raw", IMAGE, *_images(encoding, pixels))
    nodes.add("/camera_info", INFO, camera_info(SIZE))
    device, sink = nodes.open(), RecordingSink()
    assert device.streams == ("image",)
    device.start(sink)
    array = sink.images[0][1]
    assert array.dtype == pixels.dtype
    np.testing.assert_array_equal(np.atleast_1d(array[12, 16]), expected)


def test_compressed_images_are_decoded(nodes: Nodes) -> None:
    content = cv2.imencode(".png", GREY)[1].tobytes()
    packed = [packed_image(content, "mono8; png compressed", START + i * STEP) for i in range(6)]
    nodes.add("/image_raw/compressed", COMPRESSED, *packed)
    nodes.add("/camera_info", INFO, camera_info(SIZE))
    device, sink = nodes.open(sensor=Sensor.MONOCULAR), RecordingSink()
    device.start(sink)
    np.testing.assert_array_equal(sink.images[0][1], GREY)


def test_depth_comes_in_its_units(nodes: Nodes) -> None:
    depth = np.full((24, 32), 1500, np.uint16)
    nodes.add("/camera/color/image_raw", IMAGE, *_images())
    nodes.add("/camera/color/camera_info", INFO, camera_info(SIZE))
    name = "/camera/aligned_depth_to_color/image_raw"
    nodes.add(name, IMAGE, *_images("16UC1", depth))
    device, sink = nodes.open(), RecordingSink()
    assert device.streams == ("image", "depth")
    settings = device.settings()
    assert settings is not None
    assert settings.depth_factor == 1000.0
    device.start(sink)
    np.testing.assert_array_equal(sink.images[-1][1], depth)


def test_samples_of_an_imu_come_as_rows(nodes: Nodes) -> None:
    _add_pair(nodes)
    samples = [imu(START + i * 5_000_000, (0.1, 0.2, 0.3), (1.0, 2.0, 9.0)) for i in range(20)]
    nodes.add("/imu/data", IMU, *samples)
    device, sink = nodes.open(imu=True), RecordingSink()
    assert device.streams == ("left", "right", "imu")
    device.start(sink)
    rows = np.concatenate(sink.samples["imu"])
    assert rows.shape == (20, 7)
    np.testing.assert_allclose(rows[3, 1:], [0.1, 0.2, 0.3, 1.0, 2.0, 9.0])
    assert rows[3, 0] == pytest.approx(START / 1e9 + 0.015, abs=1e-6)


def test_gyro_and_accelerometer_may_be_topics_of_their_own(nodes: Nodes) -> None:
    _add_pair(nodes)
    nodes.add("/camera/gyro/sample", IMU, *[imu(START, (1.0, 0.0, 0.0), (0.0,) * 3)] * 20)
    nodes.add("/camera/accel/sample", IMU, *[imu(START, (0.0,) * 3, (0.0, 0.0, 9.8))] * 20)
    device, sink = nodes.open(imu=True), RecordingSink()
    device.start(sink)
    np.testing.assert_allclose(sink.samples["gyro"][0][0, 1:], [1, 0, 0])
    np.testing.assert_allclose(sink.samples["accel"][0][0, 1:], [0, 0, 9.8])


def test_frames_are_followed_through_static_transforms(nodes: Nodes) -> None:
    _add_pair(nodes)
    up, forward = np.eye(4), np.eye(4)
    up[2, 3], forward[0, 3] = 0.5, 0.2
    nodes.add(
        "/tf_static",
        TF,
        static_transform("base_link", "mount", up),
        static_transform("mount", "cam", forward),
    )
    device = nodes.open()
    T = device.between("base_link", device.frame)
    assert T is not None
    np.testing.assert_allclose(T[:3, 3], [0.2, 0, 0.5])
    assert device.parent_of("cam") == "mount"
    assert device.parent_of("base_link") is None
    assert device.root_of("cam")[0] == "base_link"


def test_a_damaged_image_is_left_out_with_a_message(nodes: Nodes) -> None:
    _add_pair(nodes)
    device, sink = nodes.open(), RecordingSink()
    device.start(sink)
    sink.images.clear()
    broken = raw_image(GREY, "mono8")
    broken.data = broken.data[:100]
    nodes.network.send("/cam/left/image_raw", broken)
    nodes.network.send("/cam/left/image_raw", b"\0\1\0\0nothing")
    assert not sink.images
    assert len(sink.warnings) == 2
    assert "an image of /cam/left/image_raw cannot be used: it is damaged" in sink.warnings[0]


@pytest.mark.parametrize(
    ("topics", "message"),
    [
        (
            {"left": "/nowhere", "right": "/cam/right/image_raw"},
            r"there is no topic /nowhere \(left\)",
        ),
        ("left=/scan,right=/cam/right/image_raw", "/scan has the type sensor_msgs/msg/LaserScan"),
        ("left=/cam/left/image_raw,right=/silent", "nothing is published on /silent: no message"),
        ("imu=/scan", "imu needs sensor_msgs/msg/Imu"),
        ("middle=/cam/left/image_raw", "the role 'middle' of .* is unknown"),
    ],
)
def test_topics_that_cannot_be_used_are_named(nodes: Nodes, topics: str, message: str) -> None:
    _add_pair(nodes)
    nodes.add("/scan", "sensor_msgs/msg/LaserScan")
    nodes.add("/silent", IMAGE)
    with pytest.raises(DatasetError, match=message):
        nodes.open(topics=topics)


def test_an_empty_domain_names_the_remedy(nodes: Nodes) -> None:
    with pytest.raises(DatasetError, match=r"no topics in domain 0 .* set ROS_DOMAIN_ID"):
        nodes.open()


def test_topics_without_images_name_the_remedy(nodes: Nodes) -> None:
    nodes.add("/scan", "sensor_msgs/msg/LaserScan")
    with pytest.raises(DatasetError, match=r"there are no images .*; start the camera's node"):
        nodes.open()


def test_several_imus_must_be_named(nodes: Nodes) -> None:
    _add_pair(nodes)
    for name in ("/imu_a", "/imu_b"):
        nodes.add(name, IMU, imu(START, (0.0,) * 3, (0.0, 0.0, 9.8)))
    with pytest.raises(DatasetError, match=r"cannot decide which .*: --topics imu=/imu_a"):
        nodes.open(imu=True)
    assert nodes.open(topics="imu=/imu_b").streams == ("left", "right", "imu")
