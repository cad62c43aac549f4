# SPDX-License-Identifier: BSD-3-Clause
"""Topics of ROS 2 over DDS, by Cyclone DDS."""

from __future__ import annotations

import logging
import os
import secrets
import sys
import threading
from typing import Any

from cyclonedds._clayer import ddspy_take, ddspy_write
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from orbslam2py.errors import DatasetError, StateError
from orbslam2py.ros.dds_types import struct_of
from orbslam2py.ros.interfaces import LOOPBACK, network_interfaces
from orbslam2py.ros.transport import (
    Answer,
    LiveTopic,
    Publication,
    Receive,
    Subscription,
    domain_of,
    is_local_only,
)
from orbslam2py.ros.types import is_known, ros_name, type_hash

_log = logging.getLogger(__name__)

_TOPIC, _REQUEST, _REPLY = "rt", "rq", "rr"
_ANY = SampleState.Any | ViewState.Any | InstanceState.Any
_MILLISECOND = 1_000_000
#: Time in which a thread notices that it is to end, and in which a writer gives up, nanoseconds.
_SLICE, _MOST_BLOCKING = 100 * _MILLISECOND, 10 * _MILLISECOND
#: Messages that wait at most: images are large, samples of an IMU must not be lost, and latched
#: messages of all publishers share the number.
_DEPTH, _DEPTH_OF = 10, {"sensor_msgs/msg/Imu": 2000}
_LATCHED_DEPTH = 100
#: Bytes before the content of a request or response: four with the byte order, then its head.
_ORDER_SIZE, _HEAD_SIZE = 4, 16
#: Publications that are listed at most.
_MOST_ENDPOINTS = 10_000

_RECEIVE_BUFFER = '<Internal><SocketReceiveBufferSize min="default" max="8MiB"/></Internal>'
_LOCAL = (
    f'<General><Interfaces><NetworkInterface address="{LOOPBACK}"/></Interfaces>'
    "<AllowMulticast>false</AllowMulticast></General>"
    "<Discovery><ParticipantIndex>auto</ParticipantIndex>"
    "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>"
    f'<Peers><Peer Address="{LOOPBACK}"/></Peers></Discovery>'
)
#: Domains of this process; each is configured once, and lives as long as the process.
_domains: dict[int, tuple[Domain | None, str]] = {}
_domains_lock = threading.Lock()


class DdsTransport:
    """A participant of a DDS domain; see `Transport`.

    Parameters
    ----------
    address
        Number of the domain; empty: that of ``ROS_DOMAIN_ID``, or 0.

    Raises
    ------
    DatasetError
        If the domain cannot be joined.
    """

    prefix = "ros2"

    def __init__(self, address: str = "") -> None:
        self.domain = domain_of(address, self.prefix)
        self._lock = threading.RLock()
        self._closed = False
        self._open: list[_Reader] = []
        self._writers: list[_Writer] = []
        self._topics: dict[tuple[str, str], Topic[Any]] = {}
        self.where = _configure(self.domain)
        try:
            self._participant = DomainParticipant(self.domain)
        except DDSException as error:
            raise _not_joined(self.domain) from error
        self._builtin = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)

    def topics(self) -> list[LiveTopic]:
        """List the topics that others publish now, by name."""
        found: dict[str, LiveTopic] = {}
        own = str(self._participant.guid)
        for one in self._builtin.read(N=_MOST_ENDPOINTS):
            valid = getattr(one, "sample_info", None) is not None and one.sample_info.valid_data
            alive = valid and one.sample_info.instance_state == InstanceState.Alive
            if not alive or str(getattr(one, "participant_key", "")) == own:
                continue
            prefix, _, name = one.topic_name.partition("/")
            kind = ros_name(one.type_name)
            if prefix != _TOPIC or kind is None:
                continue
            before = found.get(f"/{name}")
            reliable = isinstance(one.qos[Policy.Reliability], Policy.Reliability.Reliable)
            latched = one.qos[Policy.Durability] == Policy.Durability.TransientLocal
            found[f"/{name}"] = LiveTopic(
                f"/{name}",
                kind,
                reliable and (before is None or before.reliable),
                latched and (before is None or before.latched),
            )
        return sorted(found.values())

    def subscribe(self, topic: LiveTopic, receive: Receive) -> Subscription:
        """Receive the messages of a topic; see `Transport.subscribe`."""
        depth = _LATCHED_DEPTH if topic.latched else _DEPTH_OF.get(topic.kind, _DEPTH)
        qos = _quality(depth, reliable=topic.reliable, latched=topic.latched)
        made = self._topic(f"{_TOPIC}{topic.name}", topic.kind)
        return self._read(DataReader(self._participant, made, qos=qos), receive)

    def publish(self, name: str, kind: str, *, latched: bool = False) -> Publication:
        """Publish a topic; see `Transport.publish`."""
        depth, data = 1 if latched else _DEPTH, f"typehash={type_hash(kind)};"
        qos = _quality(depth, latched=latched, data=data)
        made = self._topic(f"{_TOPIC}{name}", kind)
        return self._write(DataWriter(self._participant, made, qos=qos), name)

    def serve(self, name: str, kind: str, answer: Answer) -> None:
        """Answer requests as rmw_cyclonedds sends them; see `Transport.serve`.

        rmw_fastrtps names the asking client in another place, which cannot be read from Python.
        """
        number = ".".join(f"{byte:x}" for byte in secrets.token_bytes(16))
        qos = _quality(_DEPTH, data=f"serviceid= {number};")
        replies = self._topic(f"{_REPLY}{name}Reply", f"{kind}_Response", is_request=True)
        requests = self._topic(f"{_REQUEST}{name}Request", f"{kind}_Request", is_request=True)
        writer = self._write(DataWriter(self._participant, replies, qos=qos), name)

        def receive(content: bytes) -> None:
            order, rest = content[:_ORDER_SIZE], content[_ORDER_SIZE:]
            head, request = rest[:_HEAD_SIZE], rest[_HEAD_SIZE:]
            response = answer(order + request)
            # The head is in the byte order of the client, the response in this computer's.
            if order[1] != response[1]:
                head = head[7::-1] + head[:7:-1]
            writer.send(response[:_ORDER_SIZE] + head + response[_ORDER_SIZE:])

        self._read(DataReader(self._participant, requests, qos=qos), receive)

    def close(self) -> None:
        """End all of it."""
        with self._lock:
            readers, self._open = self._open, []
            is_first, self._closed = not self._closed, True
        for reader in readers:
            reader.close()
        if is_first:  # with all that belongs to it: others notice at once
            self._participant.__del__()

    def _write(self, writer: DataWriter[Any], name: str) -> _Writer:
        made = _Writer(writer, name)
        with self._lock:
            self._writers.append(made)
        return made

    def _read(self, reader: DataReader[Any], receive: Receive) -> _Reader:
        made = _Reader(self._participant, reader, receive)
        with self._lock:
            self._open.append(made)
        return made

    def _topic(self, name: str, kind: str, *, is_request: bool = False) -> Topic[Any]:
        if not is_known(kind):
            raise DatasetError(f"{self.prefix}: messages of the type {kind} are not known")
        with self._lock:
            if (name, kind) not in self._topics:
                made = struct_of(kind, is_request=is_request)
                self._topics[name, kind] = Topic(self._participant, name, made)
            return self._topics[name, kind]


class _Reader:
    """Takes messages as bytes in a thread of its own.

    The public ``DataReader.take`` makes Python objects of all numbers, 20 ms for an image: the call
    below it gives the bytes. It is not public, so the version of the package is limited.
    """

    def __init__(
        self, participant: DomainParticipant, reader: DataReader[Any], receive: Receive
    ) -> None:
        self._receive = receive
        self._stopped = threading.Event()
        waits = WaitSet(participant)
        waits.attach(ReadCondition(reader, _ANY))
        #: What ends when nothing refers to it any more.
        self._entities: tuple[WaitSet, DataReader[Any]] | None = (waits, reader)
        self._thread = threading.Thread(target=self._run, name="dds reader", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stopped.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()
            self._entities = None

    def _run(self) -> None:
        assert self._entities is not None
        waits, reader = self._entities
        while not self._stopped.is_set():
            try:
                if not waits.wait(_SLICE):
                    continue
                taken = ddspy_take(reader._ref, _ANY, _DEPTH)
            except DDSException as error:
                _log.warning("ros2: %s", error)
                return
            if isinstance(taken, int):
                _log.warning("ros2: messages cannot be taken, error %d of Cyclone DDS", taken)
                return
            for content, info in taken:
                if info.valid_data and not self._stopped.is_set():
                    try:
                        self._receive(content)
                    except Exception:
                        _log.exception("ros2: a message could not be used")


class _Writer:
    """Writes messages that are bytes already."""

    def __init__(self, writer: DataWriter[Any], name: str) -> None:
        self._writer, self._name = writer, name

    def send(self, content: bytes, stamp: int | None = None) -> None:
        padded = content.ljust(-(-len(content) // 4) * 4, b"\0")
        code = ddspy_write(self._writer._ref, padded)
        if code < 0:
            raise StateError(f"{self._name} cannot be published: {DDSException(code).msg}")


def _quality(depth: int, *, reliable: bool = True, latched: bool = False, data: str = "") -> Qos:
    policies = [
        Policy.Reliability.Reliable(_MOST_BLOCKING) if reliable else Policy.Reliability.BestEffort,
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.DataRepresentation(use_cdrv0_representation=True),
    ]
    if latched:  # kept for later receivers
        policies.append(Policy.DurabilityService(0, Policy.History.KeepLast(depth), -1, -1, -1))
    if data:
        policies.append(Policy.Userdata(data.encode()))
    return Qos(*policies)


def _configure(number: int) -> str:
    """Configure a domain unless it is; returns the interfaces that it uses, for the user."""
    with _domains_lock:
        if number not in _domains:
            if os.environ.get("CYCLONEDDS_URI"):
                _domains[number] = None, "the interfaces that CYCLONEDDS_URI names"
            else:
                xml, where = _configuration()
                try:
                    _domains[number] = Domain(number, xml), where
                except DDSException as error:
                    raise _not_joined(number) from error
        return _domains[number][1]


def _configuration() -> tuple[str, str]:
    interfaces = [] if is_local_only() else network_interfaces()
    if not interfaces and not is_local_only() and sys.platform != "linux":
        general, where = "", "the network interface that Cyclone DDS chooses"
    elif not interfaces:
        general, where = _LOCAL, f"lo ({LOOPBACK}), to nodes of this computer only"
    else:
        named = "".join(f'<NetworkInterface name="{one.name}"/>' for one in interfaces)
        general = f"<General><Interfaces>{named}</Interfaces></General>"
        where = ", ".join(map(str, interfaces))
    return f"<CycloneDDS><Domain>{general}{_RECEIVE_BUFFER}</Domain></CycloneDDS>", where


def _not_joined(number: int) -> DatasetError:
    uri = os.environ.get("CYCLONEDDS_URI")
    remedy = (
        f"correct the configuration that CYCLONEDDS_URI names ({uri}), or unset it"
        if uri
        else "see whether the network is up; CYCLONEDDS_URI may name its interface"
    )
    return DatasetError(f"ros2: domain {number} cannot be joined; {remedy}")
