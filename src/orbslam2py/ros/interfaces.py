# SPDX-License-Identifier: BSD-3-Clause
"""Network interfaces of this computer (Linux)."""

from __future__ import annotations

import contextlib
import socket
import struct
from dataclasses import dataclass

LOOPBACK = "127.0.0.1"
#: Requests of ioctl(2) on Linux, and flags of an interface: see netdevice(7).
_GET_FLAGS, _GET_ADDRESS = 0x8913, 0x8915
_UP, _LOOPBACK_FLAG, _RUNNING, _MULTICAST = 0x1, 0x8, 0x40, 0x1000
_NAME_SIZE, _REQUEST_SIZE = 16, 256


@dataclass(frozen=True)
class Interface:
    """An interface that is up.

    Attributes
    ----------
    name
        Such as ``eth0``.
    address
        Its IPv4 address.
    """

    name: str
    address: str

    def __str__(self) -> str:
        return f"{self.name} ({self.address})"


def network_interfaces() -> list[Interface]:
    """List the interfaces to other computers that are up and can multicast, by name."""
    try:
        import fcntl  # noqa: PLC0415  # not on Windows
    except ImportError:
        return []
    wanted = _UP | _RUNNING | _MULTICAST
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asked:
        for _, name in sorted(socket.if_nameindex(), key=lambda one: one[1]):
            request = struct.pack(f"{_REQUEST_SIZE}s", name.encode()[: _NAME_SIZE - 1])
            with contextlib.suppress(OSError):  # it has no address, or went away
                answer = fcntl.ioctl(asked.fileno(), _GET_FLAGS, request)
                flags = struct.unpack_from("H", answer, _NAME_SIZE)[0]
                if flags & _LOOPBACK_FLAG or flags & wanted != wanted:
                    continue
                answer = fcntl.ioctl(asked.fileno(), _GET_ADDRESS, request)
                found.append(Interface(name, socket.inet_ntoa(answer[20:24])))
    return found
