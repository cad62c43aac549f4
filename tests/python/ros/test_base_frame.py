# SPDX-License-Identifier: BSD-3-Clause
"""Where the camera is on the robot: by TF, by the user, or assumed with a warning."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.errors import DatasetError
from orbslam2py.live import Request
from orbslam2py.ros import gathering
from orbslam2py.ros.base_frame import choose_base, for_viewers, read_transform
from orbslam2py.ros.device import TopicsDevice
from orbslam2py.ros.interfaces import network_interfaces
from orbslam2py.settings import Sensor, builtin_settings
from orbslam2py.trajectory.robot_frames import R_ROBOT_OPTICAL, pose_of_forward_camera
from support.memory_transport import MemoryNetwork, MemoryTransport
from support.ros_messages import START, STEP, camera_info, raw_image, static_transform

TF = "tf2_msgs/msg/TFMessage"
MONO = builtin_settings("tum1", Sensor.MONOCULAR)


def _at(x: float, y: float, z: float, *, optical: bool = False) -> np.ndarray:
    T = pose_of_forward_camera() if optical else np.eye(4)
    T[:3, 3] = x, y, z
    return T


@pytest.fixture
def network(monkeypatch: pytest.MonkeyPatch) -> MemoryNetwork:
    for name, seconds in (("DISCOVERY", 0.1), ("MESSAGES", 0.1), ("_SETTLING", 0.0)):
        monkeypatch.setattr(gathering, name, seconds)
    made = MemoryNetwork()
    made.offer("/image_raw", "sensor_msgs/msg/Image")
    made.offer("/camera_info", "sensor_msgs/msg/CameraInfo")
    grey = np.zeros((24, 32), np.uint8)

    def publish(name: str) -> None:
        if name == "/image_raw":
            for i in range(6):
                made.send(name, raw_image(grey, "mono8", START + i * STEP, "cam_optical"))
        elif name == "/camera_info":
            made.send(name, camera_info((32, 24)))
        else:
            for content in list(made.sent[name]):
                made.send(name, content)

    made.on_subscribe = publish
    return made


def _device(network: MemoryNetwork, *edges: tuple[str, str, np.ndarray]) -> TopicsDevice:
    if edges:
        network.offer("/tf_static", TF)
    for parent, child, T in edges:
        network.send("/tf_static", static_transform(parent, child, T))
    return TopicsDevice(lambda: MemoryTransport(network), "ros2", Request())


def test_the_robots_own_transform_is_taken_and_not_published_again(
    network: MemoryNetwork,
) -> None:
    mount, optical = _at(0.3, 0, 0.5), _at(0, 0.1, 0, optical=True)
    device = _device(network, ("base_link", "mount", mount), ("mount", "cam_optical", optical))
    base = choose_base(MONO, device, None, None)
    assert (base.name, base.camera, base.publishes_tf) == ("base_link", "cam_optical", True)
    assert base.T_base_child is None
    np.testing.assert_allclose(base.robot.T_base_camera, mount @ optical, atol=1e-12)
    shown = for_viewers(base)
    np.testing.assert_allclose(shown.T_base_child, mount @ optical, atol=1e-12)


def test_the_users_transform_leads_to_the_root_of_the_drivers_tree(network: MemoryNetwork) -> None:
    driver = _at(0, 0.05, 0, optical=True)
    device = _device(network, ("cam_link", "cam_optical", driver))
    base = choose_base(MONO, device, "body", "0.2,0,0.4")
    assert (base.name, base.child) == ("body", "cam_link")
    T = _at(0.2, 0, 0.4, optical=True)
    np.testing.assert_allclose(base.robot.T_base_camera, T, atol=1e-12)
    # Through the driver's transform the camera is where the user says.
    np.testing.assert_allclose(base.T_base_child @ driver, T, atol=1e-12)


def test_a_base_that_has_a_parent_gets_no_second_one(
    network: MemoryNetwork, caplog: pytest.LogCaptureFixture
) -> None:
    device = _device(
        network,
        ("odom", "base_link", np.eye(4)),
        ("base_link", "cam_optical", _at(0.1, 0, 0, optical=True)),
    )
    base = choose_base(MONO, device, None, None)
    assert not base.publishes_tf
    assert "/tf has base_link as a child of odom already" in caplog.text


def test_without_any_transform_the_base_is_at_the_camera_and_a_warning_says_so(
    network: MemoryNetwork, caplog: pytest.LogCaptureFixture
) -> None:
    base = choose_base(MONO, _device(network), None, None)
    assert "base_link is assumed to be at the camera" in caplog.text
    np.testing.assert_array_equal(base.robot.T_base_camera, pose_of_forward_camera())
    assert base.child == "cam_optical"
    with pytest.raises(DatasetError, match="--base-frame body: no static transform"):
        choose_base(MONO, _device(network), "body", None)


def test_a_rectified_camera_is_turned_against_its_driver() -> None:
    settings = builtin_settings("euroc", Sensor.STEREO)
    assert settings.rectification is not None
    base = choose_base(settings, None, None, "0,0,0")
    R = settings.rectification.left.R
    # A direction of the raw camera is R times it in the rectified one.
    np.testing.assert_allclose(base.robot.T_base_camera[:3, :3] @ R, R_ROBOT_OPTICAL, atol=1e-6)
    plain = choose_base(replace(settings, rectification=None), None, None, "0,0,0")
    np.testing.assert_allclose(plain.robot.T_base_camera[:3, :3], R_ROBOT_OPTICAL)


def test_transforms_are_three_seven_or_sixteen_numbers(tmp_path: Path) -> None:
    np.testing.assert_allclose(read_transform("0.1,0.2,0.3")[:3, 3], [0.1, 0.2, 0.3])
    turned = read_transform("1,2,3,-0.5,0.5,-0.5,0.5")
    np.testing.assert_allclose(turned[:3, :3], R_ROBOT_OPTICAL, atol=1e-12)
    file = tmp_path / "camera.txt"
    file.write_text("\n".join(" ".join(map(str, row)) for row in turned.tolist()))
    np.testing.assert_allclose(read_transform(str(file)), turned)


@pytest.mark.parametrize(
    "text", ["", "1,2", "1,2,3,0,0,0,0", "nan,0,0", "a,b,c", "nowhere.txt", "1 " * 16]
)
def test_what_is_no_transform_is_named(text: str) -> None:
    with pytest.raises(DatasetError, match="is no place of the camera; give X,Y,Z in metres"):
        read_transform(text)


def test_interfaces_to_other_computers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cyclonedds")
    from orbslam2py.ros.dds import _configuration  # noqa: PLC0415

    xml, where = _configuration()
    assert 'address="127.0.0.1"' in xml
    assert "to nodes of this computer only" in where
    monkeypatch.delenv("ROS_AUTOMATIC_DISCOVERY_RANGE")
    interfaces = network_interfaces()
    assert all(not one.address.startswith("127.") for one in interfaces)
    xml, where = _configuration()
    for one in interfaces:
        assert f'name="{one.name}"' in xml
        assert f"{one.name} ({one.address})" in where
    if not interfaces:
        assert 'address="127.0.0.1"' in xml
