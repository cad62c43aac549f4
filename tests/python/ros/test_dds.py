# SPDX-License-Identifier: BSD-3-Clause
"""Topics over DDS, between two participants on the loopback interface."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from orbslam2py.ros.types import (
    SET_BOOL,
    from_cdr,
    message_class,
    to_cdr,
    type_hash,
    type_store,
)
from support.ros_messages import START, imu, raw_image

pytest.importorskip("cyclonedds")
from cyclonedds.core import Policy, Qos
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader

from orbslam2py.ros import dds
from orbslam2py.ros.dds import DdsTransport
from orbslam2py.ros.dds_types import struct_of

IMAGE, STRING = "sensor_msgs/msg/Image", "std_msgs/msg/String"


def _until(condition: Callable[[], object], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def pair(domain: int) -> Iterator[tuple[DdsTransport, DdsTransport]]:
    both = DdsTransport(str(domain)), DdsTransport(str(domain))
    yield both
    for one in both:
        one.close()


def test_the_user_hears_that_only_this_computer_is_reached(
    pair: tuple[DdsTransport, DdsTransport],
) -> None:
    assert pair[0].where == "lo (127.0.0.1), to nodes of this computer only"


def test_images_come_with_all_bytes(pair: tuple[DdsTransport, DdsTransport]) -> None:
    sender, receiver = pair
    publication = sender.publish("/cam/image_raw", IMAGE)
    _until(lambda: [one.name for one in receiver.topics()] == ["/cam/image_raw"])
    (topic,) = receiver.topics()
    assert (topic.kind, topic.reliable, topic.latched) == (IMAGE, True, False)
    assert sender.topics() == []  # its own do not count
    pixels = np.random.default_rng(0).integers(0, 255, (480, 752), np.uint8)
    got: list[bytes] = []
    receiver.subscribe(topic, got.append)
    time.sleep(0.5)
    content = to_cdr(raw_image(pixels, "mono8"))
    for _ in range(5):
        publication.send(content)
        time.sleep(0.02)
    _until(lambda: len(got) == 5)
    read = from_cdr(got[-1], IMAGE)
    np.testing.assert_array_equal(read.data.reshape(480, 752), pixels)
    assert read.header.stamp.sec * 10**9 + read.header.stamp.nanosec == START


def test_the_private_call_gives_what_the_public_one_does(
    pair: tuple[DdsTransport, DdsTransport],
) -> None:
    """Every type in use: what a public reader makes of our bytes is what we wrote."""
    sender, receiver = pair
    sample = imu(START, (0.1, 0.2, 0.3), (1.0, 2.0, 9.0))
    publication = sender.publish("/imu", sample.__msgtype__)
    topic = receiver._topic("rt/imu", sample.__msgtype__)
    qos = Qos(Policy.Reliability.Reliable(10**8), Policy.History.KeepLast(10))
    reader = DataReader(receiver._participant, topic, qos=qos)
    time.sleep(0.5)
    publication.send(to_cdr(sample))
    taken: list[object] = []
    _until(lambda: taken.extend(reader.take(N=5)) or taken)
    read = taken[0]
    assert read.header.stamp.nanosec == START % 10**9
    assert read.header.frame_id == "imu"
    assert read.angular_velocity.y == 0.2
    assert read.linear_acceleration.z == 9.0
    assert list(read.orientation_covariance) == [0.0] * 9


def test_what_a_public_writer_sends_is_read(pair: tuple[DdsTransport, DdsTransport]) -> None:
    sender, receiver = pair
    topic = sender._topic("rt/text", STRING)
    qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(10))
    writer = DataWriter(sender._participant, topic, qos=qos)
    _until(receiver.topics)
    (found,) = receiver.topics()
    assert not found.reliable  # so is the reader: they match
    got: list[bytes] = []
    receiver.subscribe(found, got.append)
    _until(lambda: writer.write(topic.data_type(data="words")) or got)
    assert from_cdr(got[0], STRING).data == "words"


def test_who_comes_later_gets_what_was_latched(pair: tuple[DdsTransport, DdsTransport]) -> None:
    sender, receiver = pair
    publication = sender.publish("/state", STRING, latched=True)
    for text in ("old", "new"):
        publication.send(to_cdr(message_class(STRING)(text)))
    _until(receiver.topics)
    (topic,) = receiver.topics()
    assert topic.latched
    got: list[bytes] = []
    receiver.subscribe(topic, got.append)
    _until(lambda: got)
    assert from_cdr(got[-1], STRING).data == "new"


@pytest.mark.parametrize("order", ["<", ">"])
def test_services_answer_as_rmw_cyclonedds_asks(
    pair: tuple[DdsTransport, DdsTransport], order: str
) -> None:
    server, client = pair
    asked: list[bool] = []

    def answer(request: bytes) -> bytes:
        asked.append(request[4] != 0)
        return to_cdr(message_class(f"{SET_BOOL}_Response")(True, "done"))

    server.serve("/orbslam2py/localize", SET_BOOL, answer)
    name = "/orbslam2py/localize"
    replies: list[bytes] = []
    topic = client._topic(f"rr{name}Reply", f"{SET_BOOL}_Response", is_request=True)
    client._read(DataReader(client._participant, topic, qos=dds._quality(5)), replies.append)
    topic = client._topic(f"rq{name}Request", f"{SET_BOOL}_Request", is_request=True)
    writer = dds._Writer(DataWriter(client._participant, topic, qos=dds._quality(5)), name)
    time.sleep(0.5)
    head = struct.pack(f"{order}Qq", 0x1122334455667788, 42)
    writer.send((b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + head + b"\1")
    _until(lambda: replies)
    assert asked == [True]
    assert struct.unpack_from("<Qq", replies[0], 4) == (0x1122334455667788, 42)
    read = from_cdr(replies[0][:4] + replies[0][20:], f"{SET_BOOL}_Response")
    assert (read.success, read.message) == (True, "done")


def test_writers_tell_the_hash_of_their_type(pair: tuple[DdsTransport, DdsTransport]) -> None:
    sender, receiver = pair
    sender.publish("/text", STRING)
    _until(receiver.topics)
    (found,) = [
        one for one in receiver._builtin.read(N=50) if getattr(one, "topic_name", "") == "rt/text"
    ]
    assert found.qos[Policy.Userdata].data == f"typehash={type_hash(STRING)};".encode()


def test_all_types_in_use_can_be_declared() -> None:
    for kind in ("nav_msgs/msg/Odometry", "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"):
        assert struct_of(kind).__idl_typename__.endswith(kind.rpartition("/")[2] + "_")
        assert kind in type_store().types


def test_closing_ends_all_threads(pair: tuple[DdsTransport, DdsTransport]) -> None:
    sender, receiver = pair
    sender.publish("/text", STRING)
    _until(receiver.topics)
    receiver.subscribe(receiver.topics()[0], lambda _: None)
    receiver.close()
    receiver.close()
    names = [thread.name for thread in threading.enumerate()]
    assert "dds reader" not in names
