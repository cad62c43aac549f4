# SPDX-License-Identifier: BSD-3-Clause
"""Topics of ROS 2 over Zenoh, as rmw_zenoh's design document lays them out."""

from __future__ import annotations

import contextlib
import hashlib
import itertools
import logging
import os
import queue
import struct
import threading
import time
from typing import Any

import zenoh
from zenoh import ext

from orbslam2py.errors import DatasetError
from orbslam2py.ros.transport import (
    NODE,
    Answer,
    LiveTopic,
    Publication,
    Receive,
    Subscription,
    domain_of,
)
from orbslam2py.ros.types import dds_name, is_known, ros_name, type_hash

_log = logging.getLogger(__name__)

#: Where the router of rmw_zenoh listens if nothing else is said.
_ROUTER = "tcp/localhost:7447"
#: Milliseconds to wait for the router, and seconds for the list of topics.
_PATIENCE, _LISTING = 3000, 2.0
#: Key of the tokens by which nodes are found.
_TOKENS = "@ros2_lv"
#: Parts of the token of a publisher: space, domain, session, node, entity, kind, enclave,
#: namespace, name of the node, topic, type, hash, quality of service.
_TOKEN_PARTS = 13
_PUBLISHER, _SUBSCRIBER, _SERVER = "MP", "MS", "SS"
#: Sequence number, time in nanoseconds, length of the identifier that follows, 16 bytes of it.
_ATTACHMENT = struct.Struct("<qqB16s")
#: Messages that wait at most: see `orbslam2py.ros.dds`.
_DEPTH, _DEPTH_OF = 10, {"sensor_msgs/msg/Imu": 2000}
_LATCHED_DEPTH = 100
#: What nodes of Humble write in the place of a hash.
_NO_HASH = "TypeHashNotSupported"
_BEST_EFFORT, _TRANSIENT_LOCAL = "2", "1"


class ZenohTransport:
    """A session that ROS 2 nodes with rmw_zenoh see as a node; see `Transport`.

    It is a client of a router and listens on no port.

    Parameters
    ----------
    address
        Where the router (or a node) listens, such as ``tcp/192.168.1.5:7447``; empty: the router of
        this computer. The domain is that of ``ROS_DOMAIN_ID``, or 0.

    Raises
    ------
    DatasetError
        If there is no router, or the address is invalid.
    """

    prefix = "zenoh"

    def __init__(self, address: str = "") -> None:
        self.domain = domain_of("", self.prefix)
        router = address or _ROUTER
        self.where = f"a connection to {router}, no port of its own"
        self._session = _opened(router, given=bool(address))
        self._id = str(self._session.info.zid())
        self._numbers = itertools.count(1)
        self._lock = threading.Lock()
        self._kept: list[Any] = []
        self._readers: list[_Reader] = []
        node = f"{_TOKENS}/{self.domain}/{self._id}/0/0/NN/%/%/{NODE}"
        self._declare(node)

    def topics(self) -> list[LiveTopic]:
        """List the topics that others publish now, by name."""
        found: dict[str, LiveTopic] = {}
        replies = self._session.liveliness().get(f"{_TOKENS}/{self.domain}/**", timeout=_LISTING)
        for reply in replies:
            if reply.ok is None:
                continue
            topic = topic_of_token(str(reply.ok.key_expr), self._id)
            if topic is None:
                continue
            before = found.get(topic.name, topic)
            found[topic.name] = LiveTopic(
                topic.name,
                topic.kind,
                topic.reliable and before.reliable,
                topic.latched and before.latched,
                topic.key if before.key == topic.key else "*",
            )
        return sorted(found.values())

    def subscribe(self, topic: LiveTopic, receive: Receive) -> Subscription:
        """Receive the messages of a topic; see `Transport.subscribe`."""
        self._require(topic.kind)
        key = f"{self.domain}{topic.name}/{dds_name(topic.kind)}/{topic.key or '*'}"
        depth = _LATCHED_DEPTH if topic.latched else _DEPTH_OF.get(topic.kind, _DEPTH)
        reader = _Reader(receive, depth)
        if topic.latched:
            history = ext.HistoryConfig(detect_late_publishers=True)
            declared: Any = ext.declare_advanced_subscriber(
                self._session, key, reader.take, history=history
            )
        else:
            declared = self._session.declare_subscriber(key, reader.take)
        reader.declared = declared
        token_hash = topic.key if topic.key not in ("", "*") else type_hash(topic.kind)
        quality = _quality(depth, reliable=topic.reliable, latched=topic.latched)
        self._announce(_SUBSCRIBER, topic.name, topic.kind, token_hash, quality)
        with self._lock:
            self._readers.append(reader)
        return reader

    def publish(self, name: str, kind: str, *, latched: bool = False) -> Publication:
        """Publish a topic; see `Transport.publish`."""
        self._require(kind)
        hashed = self._hash(kind)
        key = f"{self.domain}{name}/{dds_name(kind)}/{hashed}"
        if latched:
            publisher: Any = ext.declare_advanced_publisher(
                self._session, key, cache=ext.CacheConfig(max_samples=1), publisher_detection=True
            )
        else:
            publisher = self._session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.DROP
            )
        quality = _quality(1 if latched else _DEPTH, latched=latched)
        token = self._announce(_PUBLISHER, name, kind, hashed, quality)
        return _Writer(publisher, token)

    def serve(self, name: str, kind: str, answer: Answer) -> None:
        """Answer the requests of a service; see `Transport.serve`."""
        hashed = self._hash(kind)
        key = f"{self.domain}{name}/{dds_name(kind)}/{hashed}"
        waiting: queue.SimpleQueue[Any] = queue.SimpleQueue()

        def run() -> None:
            while (query := waiting.get()) is not None:
                with query:
                    _reply(query, key, answer)

        threading.Thread(target=run, name="zenoh service", daemon=True).start()
        queryable = self._session.declare_queryable(key, waiting.put, complete=True)
        with self._lock:
            self._kept += [queryable, _Ending(waiting)]
        self._announce(_SERVER, name, kind, hashed, _quality(_DEPTH))

    def close(self) -> None:
        """End all of it."""
        with self._lock:
            readers, self._readers = self._readers, []
            kept, self._kept = self._kept, []
        for reader in readers:
            reader.close()
        for one in kept:
            with contextlib.suppress(Exception):  # the session may be gone
                one.undeclare()
        with contextlib.suppress(Exception):
            self._session.close()

    def _hash(self, kind: str) -> str:
        """Return the hash of a type as the other nodes write it: those of Humble have none."""
        if any(topic.key == _NO_HASH for topic in self.topics()):
            return _NO_HASH
        return type_hash(kind)

    def _require(self, kind: str) -> None:
        if not is_known(kind):
            raise DatasetError(f"{self.prefix}: messages of the type {kind} are not known")

    def _announce(self, entity: str, name: str, kind: str, hashed: str, quality: str) -> str:
        mangled = name.replace("/", "%")
        token = (
            f"{_TOKENS}/{self.domain}/{self._id}/0/{next(self._numbers)}/{entity}/%/%/{NODE}/"
            f"{mangled}/{dds_name(kind)}/{hashed}/{quality}"
        )
        self._declare(token)
        return token

    def _declare(self, token: str) -> None:
        declared = self._session.liveliness().declare_token(token)
        with self._lock:
            self._kept.append(declared)


def topic_of_token(token: str, own_id: str = "") -> LiveTopic | None:
    """Read the token of a publisher; None for another kind, or for this session."""
    parts = token.split("/")
    if len(parts) != _TOKEN_PARTS or parts[5] != _PUBLISHER or parts[2] == own_id:
        return None
    kind = ros_name(parts[10])
    if kind is None:
        return None
    quality = parts[12].split(":")
    return LiveTopic(
        parts[9].replace("%", "/"),
        kind,
        reliable=quality[0] != _BEST_EFFORT,
        latched=len(quality) > 1 and quality[1] == _TRANSIENT_LOCAL,
        key=parts[11],
    )


def attachment_of(number: int, time_ns: int, token: str) -> bytes:
    """Make what rmw_zenoh sends beside a message: its number, its time, and its sender."""
    identifier = hashlib.md5(token.encode(), usedforsecurity=False).digest()
    return _ATTACHMENT.pack(number, time_ns, len(identifier), identifier)


class _Reader:
    """Passes messages on in its own thread: the threads of Zenoh are not to wait."""

    def __init__(self, receive: Receive, depth: int) -> None:
        self.declared: Any = None
        self._receive = receive
        self._waiting: queue.Queue[bytes | None] = queue.Queue(depth)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name="zenoh reader", daemon=True)
        self._thread.start()

    def take(self, sample: Any) -> None:
        self._put(sample.payload.to_bytes())

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        with contextlib.suppress(Exception):  # the session may be gone
            self.declared.undeclare()
        self._put(None)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _put(self, content: bytes | None) -> None:
        while True:
            try:
                self._waiting.put_nowait(content)
                return
            except queue.Full:
                with contextlib.suppress(queue.Empty):
                    self._waiting.get_nowait()  # the oldest

    def _run(self) -> None:
        while (content := self._waiting.get()) is not None:
            if self._closed:
                return
            try:
                self._receive(content)
            except Exception:
                _log.exception("zenoh: a message could not be used")


class _Writer:
    def __init__(self, publisher: Any, token: str) -> None:
        self._publisher, self._token = publisher, token
        self._numbers = itertools.count(1)

    def send(self, content: bytes, stamp: int | None = None) -> None:
        attachment = attachment_of(next(self._numbers), time.time_ns(), self._token)
        self._publisher.put(content, attachment=attachment)


class _Ending:
    """Ends the thread of a service."""

    def __init__(self, waiting: queue.SimpleQueue[Any]) -> None:
        self._waiting = waiting

    def undeclare(self) -> None:
        self._waiting.put(None)


def _reply(query: Any, key: str, answer: Answer) -> None:
    try:
        asked = None if query.attachment is None else query.attachment.to_bytes()
        request = b"" if query.payload is None else query.payload.to_bytes()
        response = answer(request)
        attachment = None
        if asked is not None and len(asked) == _ATTACHMENT.size:
            number, _, size, client = _ATTACHMENT.unpack(asked)
            attachment = _ATTACHMENT.pack(number, time.time_ns(), size, client)
        query.reply(key, response, attachment=attachment)
    except Exception:
        _log.exception("zenoh: a request could not be answered")


def _quality(depth: int, *, reliable: bool = True, latched: bool = False) -> str:
    """Write a quality of service as tokens have it: default values stay empty."""
    reliability = "" if reliable else _BEST_EFFORT
    durability = _TRANSIENT_LOCAL if latched else ""
    return f"{reliability}:{durability}:,{depth}:,:,:,,"


def _opened(router: str, *, given: bool) -> Any:
    path = os.environ.get("ZENOH_SESSION_CONFIG_URI", "")
    try:
        if path and not given:
            config = zenoh.Config.from_file(path)
        else:
            config = zenoh.Config()
            config.insert_json5("mode", '"client"')
            config.insert_json5("connect/endpoints", f'["{router}"]')
            config.insert_json5("connect/timeout_ms", str(_PATIENCE))
            config.insert_json5("scouting/multicast/enabled", "false")
            config.insert_json5("timestamping/enabled", "true")  # latched topics need it
        return zenoh.open(config)
    except zenoh.ZError as error:
        if path and not given:
            why = str(error).partition(" at /")[0]  # where in Zenoh's code
            raise DatasetError(
                f"zenoh: no session by the file of ZENOH_SESSION_CONFIG_URI, {path}: {why}; "
                "correct it, or unset the variable"
            ) from error
        raise DatasetError(
            f"zenoh: no router answers at {router}; start it (ros2 run rmw_zenoh_cpp rmw_zenohd), "
            "or give the address of the robot's: zenoh:tcp/192.168.1.5:7447"
        ) from error
