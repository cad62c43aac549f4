# SPDX-License-Identifier: BSD-3-Clause
"""Types of ROS 2 messages and services without ROS: bytes (CDR), names and hashes."""

from __future__ import annotations

import platform
from functools import lru_cache
from typing import Any

from orbslam2py.datasets.bags.messages import read_message
from orbslam2py.errors import DatasetError

#: The typestore of the definitions. Types that are used here are the same from Humble to Kilted.
_STORE = "ROS2_HUMBLE"
#: Computers that Cyclone DDS has wheels for, beside those of Apple.
_MACHINES = ("x86_64", "AMD64")
TRIGGER = "std_srvs/srv/Trigger"
SET_BOOL = "std_srvs/srv/SetBool"
#: Parts of services, which this store does not have. An empty message has one byte in CDR, and
#: ``char`` of a definition is uint8 in the hash of its type.
_SERVICE_PARTS = {
    "service_msgs/msg/ServiceEventInfo": "uint8 event_type\nbuiltin_interfaces/Time stamp\n"
    "uint8[16] client_gid\nint64 sequence_number",
    f"{TRIGGER}_Request": "uint8 structure_needs_at_least_one_member",
    f"{TRIGGER}_Response": "bool success\nstring message",
    f"{SET_BOOL}_Request": "bool data",
    f"{SET_BOOL}_Response": "bool success\nstring message",
}


def missing_extra(package: str, prefix: str) -> DatasetError:
    """Make the error for a package that is not installed."""
    system, machine = platform.system(), platform.machine()
    has_wheels = machine in _MACHINES or (system, machine) == ("Darwin", "arm64")
    if package.startswith("cyclonedds") and not has_wheels:
        return DatasetError(
            f"{prefix}: needs the package cyclonedds, which is not built for this computer "
            f"({system} on {machine}); run the robot's nodes with "
            "RMW_IMPLEMENTATION=rmw_zenoh_cpp, and take zenoh: in its place"
        )
    return DatasetError(
        f"{prefix}: needs the package {package}, which is not installed; install it: "
        'pip install "orbslam2py[ros2]"'
    )


@lru_cache(maxsize=1)
def type_store() -> Any:
    """Return rosbags' types of ROS 2, with the services that are used here.

    Raises
    ------
    DatasetError
        If rosbags is not installed, with the line that installs it.
    """
    try:
        from rosbags import typesys  # noqa: PLC0415
    except ImportError as error:
        raise missing_extra("rosbags", "ros2") from error
    store = typesys.get_typestore(typesys.Stores[_STORE])
    parsed: dict[str, Any] = {}
    for name, text in _SERVICE_PARTS.items():
        parsed.update(typesys.get_types_from_msg(text, name))
    for service in (TRIGGER, SET_BOOL):
        event = (
            "service_msgs/ServiceEventInfo info\n"
            f"{service}_Request[<=1] request\n{service}_Response[<=1] response"
        )
        whole = (
            f"{service}_Request request_message\n{service}_Response response_message\n"
            f"{service}_Event event_message"
        )
        parsed.update(typesys.get_types_from_msg(event, f"{service}_Event"))
        parsed.update(typesys.get_types_from_msg(whole, service))
    store.register(_with_names_of_services(parsed))
    return store


def _with_names_of_services(parsed: Any) -> Any:
    """Undo that rosbags puts ``msg`` into every name: ``std_srvs/srv/msg/Trigger``."""
    if isinstance(parsed, str):
        return parsed.replace("/srv/msg/", "/srv/")
    if isinstance(parsed, dict):
        return {_with_names_of_services(k): _with_names_of_services(v) for k, v in parsed.items()}
    if isinstance(parsed, (list, tuple)):
        return type(parsed)(map(_with_names_of_services, parsed))
    return parsed


def message_class(kind: str) -> Any:
    """Return the class of a message type, such as ``sensor_msgs/msg/Image``."""
    return type_store().types[kind]


def to_cdr(message: Any) -> bytes:
    """Serialise a message: four bytes with the byte order, then CDR."""
    return bytes(type_store().serialize_cdr(message, message.__msgtype__))


def from_cdr(content: bytes, kind: str) -> Any:
    """Read a message of a type.

    Raises
    ------
    DatasetError
        If it is damaged.
    """
    return read_message(content, kind, "cdr", type_store())


def is_known(kind: str) -> bool:
    """Return whether messages of a type can be read."""
    return kind in type_store().types


def dds_name(kind: str) -> str:
    """Name a type as DDS and rmw_zenoh do: ``sensor_msgs::msg::dds_::Image_``."""
    package, group, name = kind.split("/")
    return f"{package}::{group}::dds_::{name}_"


def ros_name(dds: str) -> str | None:
    """Name a type of DDS as ROS does; None if it is none of ROS."""
    parts = dds.split("::")
    if len(parts) != 4 or parts[2] != "dds_" or not parts[3].endswith("_"):
        return None
    return f"{parts[0]}/{parts[1]}/{parts[3][:-1]}"


@lru_cache(maxsize=64)
def type_hash(kind: str) -> str:
    """Hash a type as ROS 2 does from Iron on (REP 2016): ``RIHS01_`` and 64 digits."""
    return str(type_store().hash_rihs01(kind))
