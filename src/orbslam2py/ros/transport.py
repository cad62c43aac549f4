# SPDX-License-Identifier: BSD-3-Clause
"""What DDS and Zenoh have in common for this package: topics, messages as bytes, services."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from orbslam2py.errors import DatasetError

#: Name of the node, and first part of the names of its topics and services.
NODE = "orbslam2py"
#: Largest number of a domain: of a larger one the ports would be beyond 65535.
_MOST_DOMAINS = 232

#: Takes the bytes of a message (CDR) as they came. Called in a thread of the transport.
Receive = Callable[[bytes], None]
#: Takes the bytes of a request (CDR), returns those of the response.
Answer = Callable[[bytes], bytes]


@dataclass(frozen=True, order=True)
class LiveTopic:
    """A published topic.

    Attributes
    ----------
    name
        Name with a ``/`` before it.
    kind
        Type of its messages, as ``sensor_msgs/msg/Image``.
    reliable
        Whether all publishers send lost messages again.
    latched
        Whether all publishers give their last messages to those that come later.
    key
        Hash of the type, where the transport needs it.
    """

    name: str
    kind: str
    reliable: bool = True
    latched: bool = False
    key: str = ""


class Subscription(Protocol):
    """A topic that is being received."""

    def close(self) -> None:
        """Receive no more; no call comes after the return. Safe to call twice."""
        ...


class Publication(Protocol):
    """A topic that is being published."""

    def send(self, content: bytes, stamp: int | None = None) -> None:
        """Publish a message, serialised as CDR. Does not wait for subscribers.

        Parameters
        ----------
        content
            The bytes.
        stamp
            Time that it is about, nanoseconds, for files; now if it is None.
        """
        ...


class Transport(Protocol):
    """A connection to the nodes of a robot. All methods may be called from any thread.

    Attributes
    ----------
    prefix
        ``ros2`` or ``zenoh``.
    domain
        Number of the domain (``ROS_DOMAIN_ID``).
    where
        On which interfaces it sends and listens, for the user.
    """

    @property
    def prefix(self) -> str: ...  # noqa: D102
    @property
    def domain(self) -> int: ...  # noqa: D102
    @property
    def where(self) -> str: ...  # noqa: D102

    def topics(self) -> list[LiveTopic]:
        """List the topics that others publish now, by name."""
        ...

    def subscribe(self, topic: LiveTopic, receive: Receive) -> Subscription:
        """Receive the messages of a topic, with the quality of service that it is published with.

        Of messages that come while `receive` runs the oldest are dropped.
        """
        ...

    def publish(self, name: str, kind: str, *, latched: bool = False) -> Publication:
        """Publish a topic, reliably.

        Parameters
        ----------
        name, kind
            Name with a ``/`` before it, and type.
        latched
            Whether later subscribers get the last message.
        """
        ...

    def serve(self, name: str, kind: str, answer: Answer) -> None:
        """Answer the requests of a service until the transport is closed."""
        ...

    def close(self) -> None:
        """End all of it; safe to call twice."""
        ...


def domain_of(text: str, prefix: str) -> int:
    """Read the number of a domain; the one of ``ROS_DOMAIN_ID``, or 0, if the text is empty.

    Raises
    ------
    DatasetError
        If it is invalid.
    """
    source = f"{prefix}:{text}" if text else "ROS_DOMAIN_ID"
    given = text or os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not (given.isdecimal() and int(given) <= _MOST_DOMAINS):
        raise DatasetError(
            f"{source}: '{given}' is no domain; give a whole number from 0 to {_MOST_DOMAINS}, "
            f"such as {prefix}:0"
        )
    return int(given)


def is_local_only() -> bool:
    """Return whether the variables of ROS 2 limit discovery to this computer."""
    wanted = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    return wanted in ("LOCALHOST", "OFF") or os.environ.get("ROS_LOCALHOST_ONLY", "") == "1"
