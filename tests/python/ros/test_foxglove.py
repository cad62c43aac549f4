# SPDX-License-Identifier: BSD-3-Clause
"""Foxglove: an MCAP file that public readers read, and a server for its app."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("foxglove")
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from orbslam2py import Sensor
from orbslam2py.errors import DatasetError, OutputFileError
from orbslam2py.ros.base_frame import base_of_camera
from orbslam2py.ros.connect import connect_foxglove
from orbslam2py.ros.output import RosOutput
from orbslam2py.ros.stamps import nanoseconds
from orbslam2py.ros.types import from_cdr
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory.robot_frames import RobotBase
from support.listening import listening
from support.small_sequences import new_system, play, sequence

N = 12


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[TrackingRecord]]:
    path = tmp_path_factory.mktemp("foxglove") / "run.mcap"
    with new_system(Sensor.STEREO, deterministic=True) as system:
        transport = connect_foxglove(file=path)
        with RosOutput(
            *(transport, system, base_of_camera(), nanoseconds, None),
            with_images=True,
            every_image=True,
        ):
            records = play(system, N)
            assert not path.exists()  # it appears when it is whole
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    return path, records


def test_rosbags_reads_what_the_run_gave(recorded: tuple[Path, list[TrackingRecord]]) -> None:
    path, records = recorded
    found: dict[str, list[tuple[int, object]]] = {}
    store = get_typestore(Stores.ROS2_HUMBLE)
    with AnyReader([path], default_typestore=store) as reader:
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp, message))
    stamps = [nanoseconds(t) for t in sequence(Sensor.STEREO).timestamps[:N]]
    for name in ("pose", "odom", "image", "keypoints"):
        assert [stamp for stamp, _ in found[f"/orbslam2py/{name}"]] == stamps, name
    assert found["/tf_static"][0][0] == stamps[0]
    odometry = found["/orbslam2py/odom"][-1][1]
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    # The covariance: of x, y, z, then of the rotations, in the axes of odom.
    record = records[-1]
    assert record.covariance is not None
    assert record.T_wc is not None
    base = RobotBase()
    pose = found["/orbslam2py/pose_with_covariance"][-1][1].pose
    expected = base.covariance(record.covariance, (base.T_base_camera @ record.T_wc)[:3, :3])
    np.testing.assert_allclose(pose.covariance.reshape(6, 6), expected, rtol=1e-12)
    at = base.pose(record.T_wc)[:3, 3]
    np.testing.assert_allclose([pose.pose.position.x, pose.pose.position.y], at[:2], rtol=1e-12)
    marker = found["/orbslam2py/keypoints"][-1][1]
    assert len(marker.points) == len(marker.outline_colors) > 200
    assert marker.header.frame_id == found["/orbslam2py/image"][-1][1].header.frame_id


def test_publishing_changes_no_result(recorded: tuple[Path, list[TrackingRecord]]) -> None:
    _, records = recorded
    with new_system(Sensor.STEREO, deterministic=True) as system:
        alone = play(system, N)
    for one, other in zip(records, alone, strict=True):
        np.testing.assert_array_equal(one.T_cw, other.T_cw)


def test_the_mcap_package_reads_schemas_and_profile(
    recorded: tuple[Path, list[TrackingRecord]],
) -> None:
    reader = pytest.importorskip("mcap.reader")
    path, _ = recorded
    with path.open("rb") as stream:
        opened = reader.make_reader(stream)
        assert opened.get_header().profile == "ros2"
        summary = opened.get_summary()
        kinds = {
            channel.topic: (
                summary.schemas[channel.schema_id].name,
                summary.schemas[channel.schema_id].encoding,
                channel.message_encoding,
            )
            for channel in summary.channels.values()
        }
        assert kinds["/orbslam2py/odom"] == ("nav_msgs/msg/Odometry", "ros2msg", "cdr")
        assert kinds["/tf"] == ("tf2_msgs/msg/TFMessage", "ros2msg", "cdr")
        assert kinds["/orbslam2py/image"][0] == "sensor_msgs/msg/CompressedImage"
        stamps = [one.log_time for _, _, one in opened.iter_messages("/orbslam2py/pose")]
    assert stamps == [nanoseconds(t) for t in sequence(Sensor.STEREO).timestamps[:N]]


def test_the_app_gets_topics_and_messages() -> None:
    websocket = pytest.importorskip("websocket")
    before = listening()
    transport = connect_foxglove()
    (served,) = (one for one in listening() - before if one[0] == "tcp")
    assert served[:2] == ("tcp", "127.0.0.1")
    assert transport.where == f"ws://127.0.0.1:{served[2]}"
    publication = transport.publish("/orbslam2py/state", "std_msgs/msg/String", latched=True)
    app = websocket.create_connection(
        transport.where, subprotocols=["foxglove.sdk.v1"], timeout=5, suppress_origin=True
    )
    channels = []
    while not channels:
        told = json.loads(app.recv())
        channels = told.get("channels", [])
    (channel,) = channels
    assert (channel["topic"], channel["encoding"]) == ("/orbslam2py/state", "cdr")
    assert (channel["schemaName"], channel["schemaEncoding"]) == ("std_msgs/msg/String", "ros2msg")
    subscription = {"id": 7, "channelId": channel["id"]}
    app.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))
    content = b"\0\1\0\0\3\0\0\0OK\0"
    received = b""
    for _ in range(50):
        publication.send(content, 123)
        app.settimeout(0.1)
        try:
            received = app.recv()
        except websocket.WebSocketTimeoutException:
            continue
        break
    # Operation 1, the subscription, the time, and the message.
    assert isinstance(received, bytes)
    assert received[:1] == b"\1"
    assert int.from_bytes(received[1:5], "little") == 7
    assert int.from_bytes(received[5:13], "little") == 123
    assert from_cdr(received[13:], "std_msgs/msg/String").data == "OK"
    app.close()
    transport.close()
    transport.close()
    end = time.monotonic() + 5
    while served in listening():  # the server ends in a thread of its own
        assert time.monotonic() < end
        time.sleep(0.02)


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(
            DatasetError, match=rf"127.0.0.1:{port} cannot be served .*; take another one with"
        ):
            connect_foxglove(port=port)


def test_an_address_of_another_computer_is_named() -> None:
    with pytest.raises(DatasetError, match=r"192.0.2.77:8765 .* with --foxglove-host"):
        connect_foxglove("192.0.2.77")


def test_a_file_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    with pytest.raises(OutputFileError, match="there is no folder"):
        connect_foxglove(file=tmp_path / "none" / "a.mcap")


def test_a_file_without_messages_does_not_appear(tmp_path: Path) -> None:
    connect_foxglove(file=tmp_path / "a.mcap").close()
    assert list(tmp_path.iterdir()) == []
