# SPDX-License-Identifier: BSD-3-Clause
"""A network of nodes in memory: what is published comes to those who subscribe, at once."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from orbslam2py.ros.transport import Answer, LiveTopic, Receive
from orbslam2py.ros.types import from_cdr, to_cdr


@dataclass
class MemoryNetwork:
    """Topics with their types, what was published, and who hears it."""

    offered: dict[str, LiveTopic] = field(default_factory=dict)
    sent: dict[str, list[bytes]] = field(default_factory=lambda: defaultdict(list))
    heard_by: dict[str, list[Receive]] = field(default_factory=lambda: defaultdict(list))
    services: dict[str, Answer] = field(default_factory=dict)
    #: Called after each subscription, to publish what is wanted then.
    on_subscribe: Callable[[str], None] = lambda _: None

    def offer(self, name: str, kind: str) -> None:
        self.offered[name] = LiveTopic(name, kind)

    def send(self, name: str, message: Any) -> None:
        content = message if isinstance(message, bytes) else to_cdr(message)
        self.sent[name].append(content)
        for receive in list(self.heard_by[name]):
            receive(content)

    def messages(self, name: str, kind: str) -> list[Any]:
        return [from_cdr(content, kind) for content in self.sent[name]]


class MemoryTransport:
    """See `orbslam2py.ros.transport.Transport`."""

    prefix, domain, where = "ros2", 0, "memory"

    def __init__(self, network: MemoryNetwork) -> None:
        self.network = network
        self.is_closed = False

    def topics(self) -> list[LiveTopic]:
        return sorted(self.network.offered.values())

    def subscribe(self, topic: LiveTopic, receive: Receive) -> _Subscription:
        heard = self.network.heard_by[topic.name]
        heard.append(receive)
        self.network.on_subscribe(topic.name)
        return _Subscription(heard, receive)

    def publish(self, name: str, kind: str, *, latched: bool = False) -> _Publication:
        self.network.offered[name] = LiveTopic(name, kind, latched=latched)
        return _Publication(self.network, name)

    def serve(self, name: str, kind: str, answer: Answer) -> None:
        self.network.services[name] = answer

    def close(self) -> None:
        self.is_closed = True


@dataclass
class _Subscription:
    heard: list[Receive]
    receive: Receive

    def close(self) -> None:
        if self.receive in self.heard:
            self.heard.remove(self.receive)


@dataclass
class _Publication:
    network: MemoryNetwork
    name: str

    def send(self, content: bytes, stamp: int | None = None) -> None:
        self.network.send(self.name, content)
