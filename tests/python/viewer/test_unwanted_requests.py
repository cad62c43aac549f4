# SPDX-License-Identifier: BSD-3-Clause
"""What is no request of the page: nothing of it is printed, and the page goes on being served."""

from __future__ import annotations

import logging
import socket
import urllib.request
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from orbslam2py.viewer.server import address_of, start_server, stop_server
from orbslam2py.viewer.unwanted_requests import UnwantedRequests

viser = pytest.importorskip("viser", reason="the viewer's extra is not installed")
LIBRARY = logging.getLogger("websockets.server")


@pytest.fixture
def address() -> Iterator[str]:
    server = start_server(port=0)
    yield address_of(server)
    stop_server(server)


def send(address: str, content: bytes) -> bytes:
    """Send bytes, and take what comes until the other end closes."""
    port = int(address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=20) as connection:
        connection.sendall(content)
        connection.shutdown(socket.SHUT_WR)
        answer = b""
        while more := connection.recv(4096):
            answer += more
    return answer


def check_served(address: str) -> None:
    with urllib.request.urlopen(address, timeout=30) as page:
        assert b"<html" in page.read()


@pytest.mark.parametrize(
    "content",
    [
        b"HEAD / HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\n\r\na=b",
        b"OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(200)),
        b"\xff" * 100_000,
        b"GET / HTTP/1.1\r\nUpgrade: websocket\r\n\r\n",
        b"",
    ],
    ids=["HEAD", "POST", "OPTIONS", "TLS", "bytes", "no handshake", "nothing"],
)
def test_what_is_no_request(
    address: str, content: bytes, capfd: pytest.CaptureFixture[str], caplog: Any
) -> None:
    for _ in range(2):
        send(address, content)
    check_served(address)
    send(address, content)
    check_served(address)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
    assert [record for record in caplog.records if record.levelno > logging.INFO] == []


@pytest.mark.parametrize(
    "message",
    [b"\xc1", b"no message", b"\x81\xa4type\xa4none", b"\x05", b"\x80", "text", b""],
    ids=["no msgpack", "words", "unknown type", "a number", "no type", "text", "empty"],
)
def test_what_is_no_message(
    address: str, message: bytes | str, capfd: pytest.CaptureFixture[str], caplog: Any
) -> None:
    from websockets.exceptions import ConnectionClosed  # noqa: PLC0415
    from websockets.sync.client import connect  # noqa: PLC0415
    from websockets.typing import Subprotocol  # noqa: PLC0415

    port = address.rpartition(":")[2]
    version = Subprotocol(f"viser-v{viser.__version__}")
    with (
        connect(f"ws://127.0.0.1:{port}", subprotocols=[version], max_size=None) as page,
        pytest.raises(ConnectionClosed),
    ):
        page.send(message)
        while True:
            page.recv(timeout=20)
    check_served(address)
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
    assert [record for record in caplog.records if record.levelno > logging.INFO] == []


def record_of(message: str, port: int, error: Exception | None = None) -> logging.LogRecord:
    trace = None if error is None else (type(error), error, error.__traceback__)
    record = logging.LogRecord("websockets.server", logging.ERROR, "", 0, message, (), trace)
    record.websocket = SimpleNamespace(local_address=("127.0.0.1", port))
    return record


def test_mistakes_of_our_own_and_other_servers_are_told() -> None:
    def _message_consumer() -> None:
        raise ValueError("what was sent")

    def ours() -> None:
        raise ValueError("ours")

    unwanted = UnwantedRequests(8080)
    unwanted.stop()
    failed = "connection handler failed"
    for port, told in ((8080, [False, True]), (8081, [True, True])):
        found = []
        for fail in (_message_consumer, ours):
            with pytest.raises(ValueError, match=r"sent|ours") as caught:
                fail()
            found.append(unwanted.filter(record_of(failed, port, caught.value)))
        assert found == told
    assert not unwanted.filter(record_of("opening handshake failed", 8080))
    assert unwanted.filter(record_of("opening handshake failed", 8081))
    assert unwanted.filter(record_of("keepalive ping failed", 8080))
    nobody = logging.LogRecord("websockets.server", logging.ERROR, "", 0, failed, (), None)
    assert unwanted.filter(nobody)


def test_nothing_is_left_behind() -> None:
    before = list(LIBRARY.filters)
    stop_server(start_server(port=0))
    assert LIBRARY.filters == before
