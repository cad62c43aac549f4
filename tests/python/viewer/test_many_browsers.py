# SPDX-License-Identifier: BSD-3-Clause
"""Ten who look at once: all see the same, tracking goes on, and those who leave change nothing."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest

from orbslam2py import Sensor, TrackingState, Viewer
from support.browser import Browser
from support.small_sequences import new_system, play
from support.viewer_pages import open_viewer, wait_until

pytestmark = pytest.mark.watchdog(200)
viser = pytest.importorskip("viser", reason="the viewer's extra is not installed")

N_BROWSERS = 10


class Reader:
    """Takes what a browser takes, in a thread; counts what it is told."""

    def __init__(self, address: str) -> None:
        from websockets.sync.client import connect  # noqa: PLC0415  # comes with viser

        protocol = f"viser-v{viser.__version__}"
        self._page = connect(address.replace("http", "ws"), subprotocols=[protocol], max_size=None)
        self.n_messages = self.n_bytes = 0
        self.failed: Exception | None = None
        self._say_where_it_looks_from()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _say_where_it_looks_from(self) -> None:
        import msgspec  # noqa: PLC0415  # comes with viser

        camera = {
            "type": "ViewerCameraMessage",
            "wxyz": (1.0, 0.0, 0.0, 0.0),
            "position": (0.0, 0.0, -3.0),
            "fov": 0.9,
            "near": 0.01,
            "far": 1000.0,
            "image_height": 900,
            "image_width": 1600,
            "look_at": (0.0, 0.0, 0.0),
            "up_direction": (0.0, -1.0, 0.0),
        }
        self._page.send(msgspec.msgpack.encode(camera))

    def _read(self) -> None:
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415

        try:
            for message in self._page:
                self.n_messages += 1
                self.n_bytes += len(message)
        except ConnectionClosed:
            pass  # the page has ended, or we have
        except Exception as error:
            self.failed = error

    def close(self) -> None:
        """Go away."""
        self._page.close()
        self._thread.join()


@contextmanager
def readers(address: str, n: int) -> Iterator[list[Reader]]:
    """Several who look."""
    with ExitStack() as stack:
        found = []
        for _ in range(n):
            found.append(Reader(address))
            stack.callback(found[-1].close)
        yield found


def test_ten_look_at_once() -> None:
    with (
        new_system(Sensor.RGBD, wait_for_mapping=True) as system,
        Viewer(system, port=0, open_browser=False) as viewer,
        Browser() as browser,
    ):
        page = open_viewer(browser, viewer.address)
        with readers(viewer.address, N_BROWSERS - 1) as others:
            records = play(system, 20)
            assert system.wait_until_idle(60)
            # Whoever of them came first: positions and colours of all points, 15 bytes each.
            least = 15 * system.n_map_points
            wait_until(lambda: min(each.n_bytes for each in others) > least, "the map at all ten")
            for each in others[:5]:
                each.close()
            before = np.array([each.n_messages for each in others])
            records += play(system, 10, first=20)
            wait_until(
                lambda: all(
                    each.n_messages > n for each, n in zip(others[5:], before[5:], strict=True)
                ),
                "what is new at those who stayed",
            )
        n_keyframes = system.n_keyframes
        page.wait_for(f"document.body.innerText.includes('{n_keyframes} keyframes')", 60)
        assert all(each.failed is None for each in others)
        assert all(record.state is TrackingState.OK for record in records)
