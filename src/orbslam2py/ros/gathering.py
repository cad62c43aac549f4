# SPDX-License-Identifier: BSD-3-Clause
"""The first messages of live topics, kept as a bag: what reads bags chooses topics and settings."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from orbslam2py.datasets.bags.bag import Bag, Message, Topic
from orbslam2py.datasets.bags.messages import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    IMU,
    TRANSFORMS,
)
from orbslam2py.datasets.bags.parts import Place
from orbslam2py.errors import DatasetError
from orbslam2py.ros.transport import LiveTopic, Transport

_IMAGES = (IMAGE, COMPRESSED_IMAGE)
#: Messages that are kept of each topic of a type, and that are waited for.
_KEPT = {IMAGE: 6, COMPRESSED_IMAGE: 6, CAMERA_INFO: 3, IMU: 50, **dict.fromkeys(TRANSFORMS, 200)}
_WANTED = {IMAGE: 6, COMPRESSED_IMAGE: 6, CAMERA_INFO: 1, IMU: 20}
#: Seconds to wait for images to be offered, for the rest of the topics, and for messages.
DISCOVERY, _SETTLING, MESSAGES = 5.0, 1.0, 5.0
_SLICE = 0.05
#: Topics that a message lists at most.
_MOST_LISTED = 6


def title_of(name: str) -> str:
    """Name a source at the beginning of a sentence: ``ros2`` for ``ros2:``."""
    return name.removesuffix(":")


class GatheredMessages(Bag):
    """Messages in memory, in the place of a bag.

    Parameters
    ----------
    name
        What messages to the user call it: ``ros2:``.
    contents
        When each message came [ns] and its bytes, by topic.
    """

    def __init__(self, name: str, contents: Mapping[LiveTopic, list[tuple[int, bytes]]]) -> None:
        # Bag opens files, which there are none of.
        self.path = Path(title_of(name))
        self.doubts: list[str] = []
        self.layout = "live"
        given = sorted(contents.items())
        self.topics = [Topic(topic.name, topic.kind, "cdr", len(kept)) for topic, kept in given]
        self._contents = [kept for _, kept in given]

    def messages(self, topic: Topic) -> list[Message]:
        """Return the positions of the messages of a topic, in the order of arrival."""
        number = self.topics.index(topic)
        return [
            Message(came, number, Place(came, -1, position, len(content)))
            for position, (came, content) in enumerate(self._contents[number])
        ]

    def read(self, message: Message, most: int | None = None) -> bytes:
        """Read a message, or its first bytes."""
        return self._contents[message.file][message.place.offset][1][:most]


@dataclass(frozen=True)
class Gathered:
    """Messages published during some seconds.

    Attributes
    ----------
    bag
        The messages.
    topics
        All topics that were offered, by name.
    """

    bag: GatheredMessages
    topics: dict[str, LiveTopic]


def gather(transport: Transport, name: str, named: Mapping[str, str], *, imu: bool) -> Gathered:
    """Receive data about the cameras: some images, CameraInfo, transforms, samples of an IMU.

    Parameters
    ----------
    transport
        The connection.
    name
        Name of the source for messages.
    named
        Topics by role, as the user gave them; all images are received if he names none.
    imu
        Whether samples of an IMU are waited for.

    Raises
    ------
    DatasetError
        If there are no such topics, they are of the wrong type, or nothing is published on them.
    """
    wanted = {role: "/" + topic.strip("/") for role, topic in named.items()}
    topics = _discover(transport, name, wanted)
    images = {one for role, one in wanted.items() if role in ("left", "right", "depth")}
    kept: dict[LiveTopic, list[tuple[int, bytes]]] = {}
    for topic in topics.values():
        is_image = topic.kind in _IMAGES and (not images or topic.name in images)
        is_other = topic.kind in (CAMERA_INFO, *TRANSFORMS) or (imu and topic.kind == IMU)
        if is_image or is_other:
            kept[topic] = []
    _receive(transport, kept)
    title = title_of(name)
    silent = [one for one in wanted.values() if not kept.get(topics[one], [True])]
    if silent or not any(kept[topic] for topic in kept if topic.kind in _IMAGES):
        silent = silent or [topic.name for topic in kept if topic.kind in _IMAGES]
        raise DatasetError(
            f"{title}: nothing is published on {' and '.join(silent)}: no message came in "
            f"{MESSAGES:g} s; start the camera's node, or name other topics with --topics"
        )
    heard = {topic: messages for topic, messages in kept.items() if messages}
    return Gathered(GatheredMessages(name, heard), topics)


def _discover(transport: Transport, name: str, wanted: Mapping[str, str]) -> dict[str, LiveTopic]:
    """Wait until all wanted topics are offered, or some images are, and their neighbours."""
    begin = time.monotonic()
    complete_at: float | None = None
    while True:
        topics = {topic.name: topic for topic in transport.topics()}
        now = time.monotonic()
        images = [topic for topic in topics.values() if topic.kind in _IMAGES]
        is_complete = images and all(one in topics for one in wanted.values())
        complete_at = (complete_at or now) if is_complete else None
        if complete_at is not None and now >= complete_at + _SETTLING:
            break
        if now >= begin + DISCOVERY:
            break
        time.sleep(_SLICE)
    _check(transport, name, wanted, topics)
    return topics


def _check(
    transport: Transport, name: str, wanted: Mapping[str, str], topics: Mapping[str, LiveTopic]
) -> None:
    title = title_of(name)
    if not topics:
        raise DatasetError(
            f"{title}: there are no topics in domain {transport.domain} ({transport.where}); start "
            "the robot's nodes, or set ROS_DOMAIN_ID to the number of their domain"
        )
    for role, one in wanted.items():
        if one not in topics:
            raise DatasetError(
                f"{title}: there is no topic {one} ({role}) in domain {transport.domain}; give "
                f"--topics one of {_listed(topics)}"
            )
        needed = _needed_types(role)
        if topics[one].kind not in needed:
            fitting = {key: topic for key, topic in topics.items() if topic.kind in needed}
            raise DatasetError(
                f"{title}: {one} has the type {topics[one].kind}, but {role} needs "
                f"{' or '.join(needed)}; give --topics one of {_listed(fitting)}"
            )
    if not any(topic.kind in _IMAGES for topic in topics.values()):
        raise DatasetError(
            f"{title}: there are no images in domain {transport.domain}, only {_listed(topics)}; "
            "start the camera's node"
        )


def _needed_types(role: str) -> tuple[str, ...]:
    if role == "imu":
        return (IMU,)
    return (CAMERA_INFO,) if role.endswith("info") else _IMAGES


def _listed(topics: Mapping[str, LiveTopic]) -> str:
    if not topics:
        return "those that you start: there are none now"
    shown = [f"{topic.name} ({topic.kind})" for topic in sorted(topics.values())]
    more = len(shown) - _MOST_LISTED
    return ", ".join(shown[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")


def _receive(transport: Transport, kept: dict[LiveTopic, list[tuple[int, bytes]]]) -> None:
    """Fill the lists of messages until there are enough of all, or time is over."""
    changed = threading.Condition()

    def add(topic: LiveTopic, content: bytes) -> None:
        with changed:
            if len(kept[topic]) < _KEPT[topic.kind]:
                kept[topic].append((time.time_ns(), content))
                changed.notify_all()

    def is_complete() -> bool:
        return all(len(heard) >= _WANTED.get(one.kind, 0) for one, heard in kept.items())

    subscriptions = [
        transport.subscribe(topic, lambda content, topic=topic: add(topic, content))  # type: ignore[misc]
        for topic in kept
    ]
    try:
        with changed:
            changed.wait_for(is_complete, MESSAGES)
            if is_complete():  # latched transforms come at once, moving ones a little later
                changed.wait_for(lambda: False, _SETTLING / 2)
    finally:
        for subscription in subscriptions:
            subscription.close()
