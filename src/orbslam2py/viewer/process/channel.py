# SPDX-License-Identifier: BSD-3-Clause
"""Plain data from one process to another, through an inherited socket.

A message is pickled (protocol 5, PEP 574): arrays are sent directly from memory, and nothing is
copied while the interpreter lock is held.
"""

from __future__ import annotations

import contextlib
import pickle
import socket
import struct
import threading
from typing import Any

#: Lengths that a message begins with: of the pickle and of every array.
_COUNT = struct.Struct("<I")
#: Buffers that one call sends at most; systems allow 1024.
_AT_ONCE = 512
#: Room for messages on their way [bytes], as far as the system grants it.
_ROOM = 1 << 22
#: Seconds that are waited at a time. A process that stood still itself counts one of them.
SLICE = 0.5
#: Slices in which nothing is taken, until the other end is said to hang.
_PATIENCE = 120


class Channel:
    """One end of a socket, for complete messages: tuples of a name and its arguments.

    Several threads may send; one receives.

    Parameters
    ----------
    end : socket.socket
        Connected socket; closed with the channel.
    """

    def __init__(self, end: socket.socket) -> None:
        self._socket = end
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ROOM)
        slice_ = struct.pack("ll", int(SLICE), int(SLICE % 1 * 1e6))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, slice_)
        self._sending = threading.Lock()

    def send(self, *message: Any) -> None:
        """Send a message; returns when the operating system has accepted it.

        Raises
        ------
        TimeoutError
            If the other end accepts nothing.
        OSError
            If it is closed.
        """
        arrays: list[pickle.PickleBuffer] = []
        data = pickle.dumps(message, protocol=5, buffer_callback=arrays.append)
        parts = [memoryview(data), *(array.raw() for array in arrays)]
        lengths = struct.pack(f"<{len(parts)}Q", *(part.nbytes for part in parts))
        head = memoryview(_COUNT.pack(len(parts)) + lengths)
        with self._sending:
            self._send_all([head, *(part for part in parts if part.nbytes)])

    def _send_all(self, parts: list[memoryview]) -> None:
        in_vain = 0
        while parts:
            try:
                sent, in_vain = self._socket.sendmsg(parts[:_AT_ONCE]), 0
            except BlockingIOError:
                sent, in_vain = 0, in_vain + 1
                if in_vain == _PATIENCE:
                    raise TimeoutError from None
            while parts and sent >= parts[0].nbytes:
                sent -= parts.pop(0).nbytes
            if sent:
                parts[0] = parts[0][sent:]

    def receive(self) -> tuple[Any, ...] | None:
        """Wait for the next message; None if the other end is closed."""
        try:
            (count,) = _COUNT.unpack(self._read(_COUNT.size))
            lengths = struct.unpack(f"<{count}Q", self._read(8 * count))
            data, *arrays = (self._read(length) for length in lengths)
        except (EOFError, OSError):
            return None
        message: tuple[Any, ...] = pickle.loads(data, buffers=arrays)
        return message

    def _read(self, n_bytes: int) -> bytearray:
        data = bytearray(n_bytes)
        left = memoryview(data)
        while left.nbytes:
            n_read = self._socket.recv_into(left)
            if not n_read:
                raise EOFError
            left = left[n_read:]
        return data

    def close(self) -> None:
        """Close it, which ends waits at both ends."""
        with contextlib.suppress(OSError):  # the other end is gone already
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()
