# SPDX-License-Identifier: BSD-3-Clause
"""A stand-in of rclpy with the calls that the example node uses, over a network in memory."""

from __future__ import annotations

import sys
import threading
from dataclasses import dataclass
from enum import Enum
from types import ModuleType, SimpleNamespace
from typing import Any

from orbslam2py.ros.transport import LiveTopic
from orbslam2py.ros.types import from_cdr, message_class, to_cdr
from support.memory_transport import MemoryNetwork, MemoryTransport


class ReliabilityPolicy(Enum):
    RELIABLE = 1
    BEST_EFFORT = 2


class DurabilityPolicy(Enum):
    TRANSIENT_LOCAL = 1
    VOLATILE = 2


@dataclass
class QoSProfile:
    depth: int
    reliability: ReliabilityPolicy
    durability: DurabilityPolicy


class Node:
    def __init__(self, network: MemoryNetwork) -> None:
        self._transport = MemoryTransport(network)
        self._network = network
        self._own: set[str] = set()

    def get_name(self) -> str:
        return "orbslam2py"

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(one.name, [one.kind]) for one in self._transport.topics()]

    def get_publishers_info_by_topic(self, name: str) -> list[Any]:
        profile = QoSProfile(10, ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE)
        node = "orbslam2py" if name in self._own else "camera"
        return [SimpleNamespace(node_name=node, qos_profile=profile)]

    def create_subscription(
        self, kind: str, name: str, receive: Any, quality: QoSProfile, *, raw: bool
    ) -> Any:
        assert raw
        assert isinstance(quality, QoSProfile)
        return self._transport.subscribe(LiveTopic(name, kind), receive)

    def destroy_subscription(self, made: Any) -> None:
        made.close()

    def create_publisher(self, kind: str, name: str, quality: QoSProfile) -> Any:
        assert isinstance(quality, QoSProfile)
        self._own.add(name)
        made = self._transport.publish(name, kind)
        return SimpleNamespace(publish=made.send)

    def create_service(self, service: Any, name: str, respond: Any) -> None:
        def answer(request: bytes) -> bytes:
            response = respond(from_cdr(request, f"{service.kind}_Request"), None)
            return to_cdr(response)

        self._network.services[name] = answer

    def destroy_node(self) -> None:
        self._own.clear()


class MultiThreadedExecutor:
    def __init__(self) -> None:
        self._ended = threading.Event()

    def add_node(self, node: Node) -> None:
        assert isinstance(node, Node)

    def spin(self) -> None:
        self._ended.wait()

    def shutdown(self) -> None:
        self._ended.set()


def _service(kind: str) -> Any:
    return SimpleNamespace(kind=kind, Response=message_class(f"{kind}_Response"))


def install(monkeypatch: Any, network: MemoryNetwork) -> None:
    """Put the stand-in in the place of rclpy."""
    members: dict[str, dict[str, Any]] = {
        "rclpy": {
            "init": lambda: None,
            "shutdown": lambda: None,
            "create_node": lambda _: Node(network),
        },
        "rclpy.executors": {"MultiThreadedExecutor": MultiThreadedExecutor},
        "rclpy.qos": {
            "DurabilityPolicy": DurabilityPolicy,
            "QoSProfile": QoSProfile,
            "ReliabilityPolicy": ReliabilityPolicy,
        },
        "rclpy.serialization": {
            "serialize_message": to_cdr,
            "deserialize_message": lambda content, kind: from_cdr(content, kind.__msgtype__),
        },
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": lambda kind: kind, "get_service": _service},
    }
    for name, content in members.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
