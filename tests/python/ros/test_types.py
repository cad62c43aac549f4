# SPDX-License-Identifier: BSD-3-Clause
"""Names, hashes and bytes of types, as ROS 2 has them."""

from __future__ import annotations

import pytest

from orbslam2py.errors import DatasetError
from orbslam2py.ros.connect import connect
from orbslam2py.ros.transport import domain_of
from orbslam2py.ros.types import (
    SET_BOOL,
    TRIGGER,
    dds_name,
    from_cdr,
    message_class,
    ros_name,
    to_cdr,
    type_hash,
)


@pytest.mark.parametrize(
    ("kind", "digits"),
    [
        # As ``ros2 topic info --verbose`` and rmw_zenoh's design document show them.
        (
            "std_msgs/msg/String",
            "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        ),
        (
            "sensor_msgs/msg/Image",
            "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
        ),
        (TRIGGER, "eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"),
    ],
)
def test_hashes_are_those_of_ros(kind: str, digits: str) -> None:
    assert type_hash(kind) == f"RIHS01_{digits}"


def test_names_of_types_go_both_ways() -> None:
    assert dds_name("sensor_msgs/msg/Image") == "sensor_msgs::msg::dds_::Image_"
    assert ros_name("std_srvs::srv::dds_::SetBool_") == SET_BOOL
    assert ros_name("DCPSTopic") is None
    assert ros_name("my::Type") is None


def test_a_response_is_cdr_of_a_bool_and_a_text() -> None:
    made = message_class(f"{TRIGGER}_Response")(True, "hi")
    content = to_cdr(made)
    assert content == b"\0\1\0\0" + b"\1\0\0\0" + b"\3\0\0\0hi\0"
    assert from_cdr(content, f"{TRIGGER}_Response").message == "hi"


def test_the_domain_is_that_of_the_name_or_of_the_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    assert domain_of("", "ros2") == 7
    assert domain_of("12", "ros2") == 12
    monkeypatch.delenv("ROS_DOMAIN_ID")
    assert domain_of("", "ros2") == 0


@pytest.mark.parametrize("text", ["999", "robot", "-1"])
def test_what_is_no_domain_is_named(text: str) -> None:
    with pytest.raises(DatasetError, match=rf"ros2:{text}: '{text}' is no domain; give a whole"):
        domain_of(text, "ros2")


@pytest.mark.parametrize("name", ["ros", "dds:0", "", "tcp/127.0.0.1:7447"])
def test_what_is_no_network_is_named(name: str) -> None:
    with pytest.raises(DatasetError, match="is no network of nodes; give ros2: or ros2:DOMAIN"):
        connect(name)
