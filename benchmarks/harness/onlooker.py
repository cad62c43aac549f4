# SPDX-License-Identifier: BSD-3-Clause
"""A client of the viewer's page that draws nothing."""

from __future__ import annotations

import subprocess
import sys
from types import TracebackType

# Takes what a browser takes; says where it looks from, as every page does when it has loaded.
_ONLOOKER = """
import os
import sys
import msgspec
import viser
from websockets.sync.client import connect

if hasattr(os, "SCHED_IDLE"):
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
camera = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, -3.0),
    "fov": 0.9, "near": 0.01, "far": 1000.0, "image_height": 900, "image_width": 1600,
    "look_at": (0.0, 0.0, 0.0), "up_direction": (0.0, -1.0, 0.0),
}
protocol = f"viser-v{viser.__version__}"
print("ready", flush=True)
address = sys.stdin.readline().strip().replace("http", "ws")
with connect(address, subprotocols=[protocol], max_size=None) as page:
    page.send(msgspec.msgpack.encode(camera))
    n_bytes = 0
    try:
        for message in page:
            if not n_bytes:
                print("looks", flush=True)
            n_bytes += len(message)
    finally:
        print(n_bytes, flush=True)
"""


class Onlooker:
    """A process that takes what a browser takes, until the page ends or the block does.

    It runs with low priority: a browser is at another computer, or has cores to itself.

    Parameters
    ----------
    address : str, optional
        Of the page; else `look` says it.

    Raises
    ------
    RuntimeError
        With its words, if it cannot look.
    """

    def __init__(self, address: str | None = None) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _ONLOOKER],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._expect("ready")
        if address is not None:
            self.look(address)

    def look(self, address: str) -> None:
        """Look at a page.

        Raises
        ------
        RuntimeError
            With its words, if it cannot.
        """
        assert self._process.stdin is not None
        self._process.stdin.write(f"{address}\n")
        self._process.stdin.flush()
        self._expect("looks")

    def _expect(self, word: str) -> None:
        assert self._process.stdout is not None
        if self._process.stdout.readline().strip() != word:
            raise RuntimeError(f"the client of the viewer failed: {self._process.communicate()[1]}")

    def n_bytes(self) -> int:
        """Bytes that it was sent, once the page has ended.

        Raises
        ------
        RuntimeError
            With its words, if it has not looked.
        """
        printed, complaints = self._process.communicate(timeout=60)
        if not printed.strip().isdigit():
            raise RuntimeError(f"the client of the viewer failed: {complaints}")
        return int(printed)

    def __enter__(self) -> Onlooker:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._process.kill()
        self._process.communicate()
