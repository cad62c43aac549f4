# SPDX-License-Identifier: BSD-3-Clause
"""On which addresses and ports this process can be reached (Linux)."""

from __future__ import annotations

import contextlib
import socket
import struct
from pathlib import Path

_LISTEN = "0A"


def listening() -> set[tuple[str, str, int]]:
    """Protocol, address and port of every TCP socket that listens and every UDP socket (IPv4)."""
    inodes = set()
    for descriptor in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            target = str(descriptor.readlink())
            if target.startswith("socket:["):
                inodes.add(target[8:-1])
    found = set()
    for protocol in ("tcp", "udp"):
        for line in Path(f"/proc/self/net/{protocol}").read_text().splitlines()[1:]:
            columns = line.split()
            if columns[9] in inodes and (protocol == "udp" or columns[3] == _LISTEN):
                address, _, port = columns[1].partition(":")
                packed = struct.pack("<I", int(address, 16))
                found.add((protocol, socket.inet_ntoa(packed), int(port, 16)))
    return found
