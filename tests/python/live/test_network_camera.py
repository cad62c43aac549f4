# SPDX-License-Identifier: BSD-3-Clause
"""A camera on the network: real OpenCV with FFmpeg, and a server on this computer."""

from __future__ import annotations

import contextlib
import http.server
import threading
import time
from collections.abc import Iterator

import cv2
import numpy as np
import pytest

from orbslam2py.datasets import LiveFrame
from orbslam2py.live import open_source, stream
from support.numbered_images import MONO, coloured, number_of

pytestmark = pytest.mark.watchdog(90)


class MjpegServer(http.server.ThreadingHTTPServer):
    """Sends numbered JPEG images, one after the other, until it is closed."""

    daemon_threads = True
    block_on_close = False
    allow_reuse_address = True
    is_open = True


class Handler(http.server.BaseHTTPRequestHandler):
    server: MjpegServer

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=next")
        self.end_headers()
        with contextlib.suppress(OSError):
            for k in range(10**6):
                if not self.server.is_open:
                    return
                _, jpeg = cv2.imencode(".jpg", coloured(k % 30), [cv2.IMWRITE_JPEG_QUALITY, 98])
                head = f"--next\r\nContent-Type: image/jpeg\r\nContent-Length: {jpeg.size}\r\n\r\n"
                self.wfile.write(head.encode() + jpeg.tobytes() + b"\r\n")
                time.sleep(0.03)

    def log_message(self, *_: object) -> None:
        pass


@contextlib.contextmanager
def served(port: int = 0) -> Iterator[int]:
    server = MjpegServer(("127.0.0.1", port), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield server.server_address[1]
    finally:
        server.is_open = False
        server.shutdown()
        server.server_close()
        thread.join()


def frames_of(source: object, n: int) -> list[LiveFrame]:
    frames: list[LiveFrame] = []
    end = time.monotonic() + 40
    while len(frames) < n and time.monotonic() < end:
        frames += [frame] if (frame := source.take(0.1)) else []  # type: ignore[attr-defined]
    return frames


def test_images_of_a_server_that_goes_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "_RETRY", 0.1)
    with contextlib.ExitStack() as stack:
        with served() as port:
            address = f"http://me:secret@127.0.0.1:{port}/stream.mjpg"
            source = open_source(address, MONO, settings="tum1")
            stack.enter_context(source)  # type: ignore[arg-type]
            first = frames_of(source, 5)
        with served(port):
            again = frames_of(source, 60)
    assert len(first) == 5
    assert source.layout == "http"
    doubts = source.doubts  # type: ignore[union-attr]
    name = f"http://127.0.0.1:{port}/stream.mjpg"
    assert any(doubt.startswith(f"{name} is back after") for doubt in doubts), doubts
    assert not any("secret" in doubt for doubt in doubts)
    rgb = [frame.images.image for frame in (*first, *again)]
    numbers = [number_of(image[..., ::-1]) for image in rgb]
    steps = np.diff([number_of(image[..., ::-1]) for image in rgb[:5]]) % 30
    assert (steps >= 1).all(), numbers
    assert (np.diff([frame.timestamp for frame in (*first, *again)]) > 0).all()
