# SPDX-License-Identifier: BSD-3-Clause
"""Topics over Zenoh, as rmw_zenoh lays them out, through a router on the loopback interface."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from orbslam2py.errors import DatasetError
from orbslam2py.ros.types import TRIGGER, from_cdr, message_class, to_cdr, type_hash
from support.listening import listening

zenoh = pytest.importorskip("zenoh")
from orbslam2py.ros.zenoh import ZenohTransport, attachment_of, topic_of_token  # noqa: E402

STRING = "std_msgs/msg/String"
HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
#: A token of rmw_zenoh's design document.
TALKER = (
    "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/10/MP/%/%/talker/%chatter/"
    f"std_msgs::msg::dds_::String_/{HASH}/::,7:,:,:,,"
)


def _until(condition: Callable[[], object], seconds: float = 5.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.fixture
def transport(router: str) -> Iterator[ZenohTransport]:
    made = ZenohTransport(router)
    yield made
    made.close()


@pytest.fixture
def robot(router: str) -> Iterator[Any]:
    """A plain session, which does by hand what a node with rmw_zenoh does."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{router}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    yield session
    session.close()


def test_tokens_of_publishers_are_read() -> None:
    topic = topic_of_token(TALKER)
    assert topic is not None
    assert (topic.name, topic.kind, topic.key) == ("/chatter", STRING, HASH)
    assert topic.reliable
    assert not topic.latched
    quiet = topic_of_token(TALKER.replace("::,7:", "2:1:,7:").replace("%chatter", "%a%b"))
    assert quiet is not None
    assert (quiet.name, quiet.reliable, quiet.latched) == ("/a/b", False, True)
    assert topic_of_token(TALKER.replace("/MP/", "/MS/")) is None
    assert topic_of_token(TALKER, "aac3178e146ba6f1fc6e6a4085e77f21") is None


def test_an_attachment_is_number_time_and_identifier() -> None:
    content = attachment_of(7, 123, TALKER)
    assert struct.unpack("<qqB", content[:17]) == (7, 123, 16)
    assert len(content) == 33


def test_a_node_with_rmw_zenoh_is_heard(transport: ZenohTransport, robot: Any) -> None:
    token = robot.liveliness().declare_token(TALKER.replace("/2/", "/0/", 1))
    _until(lambda: [one.name for one in transport.topics()] == ["/chatter"])
    got: list[bytes] = []
    transport.subscribe(transport.topics()[0], got.append)
    content = to_cdr(message_class(STRING)("hello"))
    key = f"0/chatter/std_msgs::msg::dds_::String_/{HASH}"
    _until(lambda: robot.put(key, content, attachment=attachment_of(1, 2, TALKER)) or got)
    assert from_cdr(got[0], STRING).data == "hello"
    token.undeclare()
    _until(lambda: transport.topics() == [])


def test_nodes_find_and_hear_what_is_published(transport: ZenohTransport, robot: Any) -> None:
    heard: list[Any] = []
    kept = robot.declare_subscriber("0/orbslam2py/**", heard.append)
    publication = transport.publish("/orbslam2py/state", STRING)
    tokens: list[str] = []

    def look() -> bool:
        replies = robot.liveliness().get("@ros2_lv/0/**", timeout=1.0)
        tokens[:] = [str(reply.ok.key_expr) for reply in replies]
        return len(tokens) == 2

    _until(look)
    node, publisher = sorted(tokens, key=len)
    session = str(transport._session.info.zid())
    assert node == f"@ros2_lv/0/{session}/0/0/NN/%/%/orbslam2py"
    assert publisher == (
        f"@ros2_lv/0/{session}/0/1/MP/%/%/orbslam2py/%orbslam2py%state/"
        f"std_msgs::msg::dds_::String_/{HASH}/::,10:,:,:,,"
    )
    publication.send(to_cdr(message_class(STRING)("OK")))
    _until(lambda: heard)
    sample = heard[0]
    assert str(sample.key_expr) == f"0/orbslam2py/state/std_msgs::msg::dds_::String_/{HASH}"
    assert from_cdr(sample.payload.to_bytes(), STRING).data == "OK"
    number, stamp, size = struct.unpack("<qqB", sample.attachment.to_bytes()[:17])
    assert (number, size) == (1, 16)
    assert abs(stamp / 1e9 - time.time()) < 60
    kept.undeclare()


def test_nodes_of_humble_have_no_hashes(transport: ZenohTransport, robot: Any) -> None:
    token = TALKER.replace("/2/", "/0/", 1).replace(HASH, "TypeHashNotSupported")
    kept = robot.liveliness().declare_token(token)
    _until(transport.topics)
    heard: list[Any] = []
    hearing = robot.declare_subscriber("0/orbslam2py/**", heard.append)
    publication = transport.publish("/orbslam2py/state", STRING)
    _until(lambda: publication.send(to_cdr(message_class(STRING)("OK"))) or heard)
    key = "0/orbslam2py/state/std_msgs::msg::dds_::String_/TypeHashNotSupported"
    assert str(heard[0].key_expr) == key
    got: list[bytes] = []
    transport.subscribe(transport.topics()[0], got.append)
    key = "0/chatter/std_msgs::msg::dds_::String_/TypeHashNotSupported"
    _until(lambda: robot.put(key, to_cdr(message_class(STRING)("hello"))) or got)
    kept.undeclare()
    hearing.undeclare()


def test_who_comes_later_gets_what_was_latched(transport: ZenohTransport, router: str) -> None:
    publication = transport.publish("/orbslam2py/state", STRING, latched=True)
    for text in ("old", "new"):
        publication.send(to_cdr(message_class(STRING)(text)))
    late = ZenohTransport(router)
    _until(late.topics)
    (topic,) = late.topics()
    assert topic.latched
    got: list[bytes] = []
    late.subscribe(topic, got.append)
    _until(lambda: got)
    assert [from_cdr(one, STRING).data for one in got] == ["new"]
    late.close()


def test_services_answer_with_the_number_of_the_request(
    transport: ZenohTransport, robot: Any
) -> None:
    response = to_cdr(message_class(f"{TRIGGER}_Response")(True, "done"))
    transport.serve("/orbslam2py/reset", TRIGGER, lambda request: response)
    key = f"0/orbslam2py/reset/std_srvs::srv::dds_::Trigger_/{type_hash(TRIGGER)}"
    replies: list[Any] = []

    def ask() -> bool:
        asked = attachment_of(42, 1, "client")
        replies[:] = list(robot.get(key, payload=b"\0\1\0\0\0", attachment=asked, timeout=2.0))
        return bool(replies)

    _until(ask)
    (reply,) = replies
    assert from_cdr(reply.ok.payload.to_bytes(), f"{TRIGGER}_Response").message == "done"
    number, _, size, client = struct.unpack("<qqB16s", reply.ok.attachment.to_bytes())
    assert (number, size) == (42, 16)
    assert client == attachment_of(42, 1, "client")[17:]


def test_it_listens_on_no_port(router: str) -> None:
    before = listening()
    transport = ZenohTransport(router)
    assert transport.where.endswith("no port of its own")
    assert listening() == before
    transport.close()


@pytest.mark.parametrize("address", ["tcp/127.0.0.1:9", "robot"])
def test_a_router_that_does_not_answer_is_named(
    address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from orbslam2py.ros import zenoh as module  # noqa: PLC0415

    monkeypatch.setattr(module, "_PATIENCE", 300)
    with pytest.raises(DatasetError, match=rf"no router answers at {address}; start it \(ros2 run"):
        ZenohTransport(address)
