# SPDX-License-Identifier: BSD-3-Clause
"""Topics of ROS 2 for Foxglove: a server for its app, and MCAP files."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import foxglove
from foxglove import Channel, Context, Schema
from foxglove.mcap import MCAPWriteOptions

from orbslam2py.errors import DatasetError, StateError
from orbslam2py.recordings.output_file import OutputFile
from orbslam2py.ros.transport import Answer, LiveTopic, Receive, Subscription
from orbslam2py.ros.types import type_store

_log = logging.getLogger(__name__)

LOOPBACK, PORT = "127.0.0.1", 8765
#: Ports that are tried by default.
_MOST_PORTS = 20
#: Seconds after which latched messages are sent again: the app may have connected in between.
_AGAIN = 1.0
#: What starting a server raises; the package's own error is not public in each version.
_ERRORS = (RuntimeError, OSError, ValueError, getattr(foxglove, "FoxgloveError", RuntimeError))
#: Messages between two looks at the room on the disk.
_LOOK = 64


@dataclass(frozen=True)
class Serving:
    """Where Foxglove's app finds a run.

    Attributes
    ----------
    host
        Address; the loopback one can be reached from this computer only.
    port
        Its port; None: 8765 or the next free one.
    """

    host: str = LOOPBACK
    port: int | None = None


class FoxgloveTransport:
    """Publishes to Foxglove's app, or to a file; clients do not publish here: see `Transport`.

    Messages are those of ROS 2 (CDR), with their definitions, so that the file is also a bag.

    Parameters
    ----------
    serving
        Where to serve; None: nowhere.
    file
        MCAP file to write; None: none. It appears when it is whole.

    Raises
    ------
    DatasetError
        If the port is taken, or the address is not one of this computer.
    OutputFileError
        If the file cannot be written.
    """

    prefix, domain = "foxglove", 0

    def __init__(self, serving: Serving | None = None, file: Path | None = None) -> None:
        self._lock = threading.Lock()
        self._publications: list[_Publication] = []
        self._file = None if file is None else OutputFile(file, "recording", [".mcap"])
        self._contexts: list[Context] = []
        self._server: Any = None
        self._writer: Any = None
        self._n_sent, self._again_at = 0, 0.0
        if serving is not None:
            self._server = _served(serving, self._add_context())
            self.where = f"ws://{serving.host}:{self._server.port}"
            _log.info(
                "foxglove: %s; in Foxglove's app take Open connection, Foxglove WebSocket%s",
                self.where,
                ""
                if serving.host == LOOPBACK
                else ". Everyone who can reach this address sees the images",
            )
        else:
            self.where = str(file)
        if self._file is not None:
            options = MCAPWriteOptions(profile="ros2")
            self._writer = foxglove.open_mcap(
                self._file.temporary, context=self._add_context(), writer_options=options
            )

    def topics(self) -> list[LiveTopic]:
        """Return nothing: the app publishes nothing to us."""
        return []

    def subscribe(self, topic: LiveTopic, receive: Receive) -> Subscription:
        """Refuse: the app publishes nothing to us."""
        raise StateError(f"foxglove: {topic.name} cannot be received from Foxglove")

    def publish(self, name: str, kind: str, *, latched: bool = False) -> _Publication:
        """Publish a topic; see `Transport.publish`."""
        definition = type_store().generate_msgdef(kind, ros_version=2)[0]
        schema = Schema(name=kind, encoding="ros2msg", data=definition.encode())
        channels = [
            Channel(name, message_encoding="cdr", schema=schema, context=context)
            for context in self._contexts
        ]
        made = _Publication(self, channels, latched=latched and self._server is not None)
        self._publications.append(made)
        return made

    def serve(self, name: str, kind: str, answer: Answer) -> None:
        """Do nothing: the services are those of the nodes."""

    def close(self) -> None:
        """Stop serving, and finish the file."""
        with self._lock:
            server, self._server = self._server, None
            writer, self._writer = self._writer, None
        if server is not None:
            server.stop()
        if writer is not None and self._file is not None:
            writer.close()
            try:
                if self._n_sent:
                    self._file.publish()
            finally:
                self._file.discard()

    def sent(self) -> None:
        """Take note of a message: see to the room on the disk, and to what is latched."""
        self._n_sent += 1
        if self._file is not None and self._n_sent % _LOOK == 0:
            self._file.require_room()
        now = time.monotonic()
        if self._server is not None and now >= self._again_at:
            self._again_at = now + _AGAIN
            for publication in self._publications:
                publication.send_again()

    def _add_context(self) -> Context:
        self._contexts.append(Context())
        return self._contexts[-1]


class _Publication:
    """See `orbslam2py.ros.transport.Publication`."""

    def __init__(
        self, transport: FoxgloveTransport, channels: list[Channel], *, latched: bool
    ) -> None:
        self._transport, self._channels, self._latched = transport, channels, latched
        self._last: tuple[bytes, int] | None = None

    def send(self, content: bytes, stamp: int | None = None) -> None:
        at = time.time_ns() if stamp is None else stamp
        for channel in self._channels:
            channel.log(content, log_time=at)
        if self._latched:
            self._last = content, at
        self._transport.sent()

    def send_again(self) -> None:
        if self._last is not None:  # the first context is that of the server
            self._channels[0].log(self._last[0], log_time=self._last[1])


def _served(serving: Serving, context: Context) -> Any:
    """Start a server at the port, or at the first free one."""
    ports = range(PORT, PORT + _MOST_PORTS) if serving.port is None else (serving.port,)
    problem: Exception | None = None
    for port in ports:
        try:
            return foxglove.start_server(
                name="orbslam2py", host=serving.host, port=port, context=context
            )
        except _ERRORS as error:
            problem = error
    remedy = (
        "take another one with --foxglove-port"
        if serving.port is not None
        else "give an address of this computer, such as 0.0.0.0 for all, with --foxglove-host"
    )
    why = str(problem).rpartition(": ")[2].partition(" (os error")[0]  # without its wrapping
    raise DatasetError(
        f"foxglove: {serving.host}:{ports[0]} cannot be served ({why}); {remedy}"
    ) from problem
