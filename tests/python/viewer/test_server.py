# SPDX-License-Identifier: BSD-3-Clause
"""Where the viewer's page is served: ports, addresses, what is said of them."""

from __future__ import annotations

import logging
import socket
import sys
import urllib.request
from collections.abc import Iterator

import pytest

from orbslam2py import StateError
from orbslam2py.viewer import server as server_module
from orbslam2py.viewer.server import address_of, open_page, start_server, stop_server

pytest.importorskip("viser", reason="the viewer's extra is not installed")


@pytest.fixture
def taken() -> Iterator[int]:
    """A port that somebody listens at."""
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        yield int(other.getsockname()[1])


def test_the_page_is_served_to_this_computer_and_nothing_is_printed(
    capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    server = start_server(port=0)
    address = address_of(server)
    with urllib.request.urlopen(address, timeout=30) as page:
        assert b"<html" in page.read()
    stop_server(server)
    assert address.startswith("http://127.0.0.1:")
    assert capfd.readouterr().out == ""
    assert [r for r in caplog.records if r.name.startswith("orbslam2py")] == []


def test_the_next_free_port_is_taken_and_that_is_said(
    taken: int, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(server_module, "DEFAULT_PORT", taken)
    server = start_server()
    found = server.get_port()
    stop_server(server)
    assert found > taken
    assert f"port {taken} is taken: the viewer is at port {found}" in caplog.text


def test_a_port_that_was_named_must_be_free(taken: int) -> None:
    with pytest.raises(StateError) as error:
        start_server(port=taken)
    assert str(error.value) == (
        f"the viewer cannot use port {taken}: address already in use; give another one with "
        "--viewer-port, or none to take the next free one"
    )


@pytest.mark.parametrize(
    ("host", "port", "text"),
    [
        ("no.such.host.invalid", None, "--viewer-host no.such.host.invalid is no address"),
        ("192.0.2.1", None, "the viewer cannot listen at 192.0.2.1: "),
        ("127.0.0.1", 70000, "--viewer-port must be from 0 to 65535, got 70000"),
    ],
)
def test_wrong_addresses_are_named(host: str, port: int | None, text: str) -> None:
    with pytest.raises(StateError, match="^" + text):
        start_server(host, port)


def test_who_listens_to_the_network_is_told_once_what_that_means(
    caplog: pytest.LogCaptureFixture,
) -> None:
    with caplog.at_level(logging.WARNING):
        server = start_server("0.0.0.0", 0)
        stop_server(server)
    warnings = [r.getMessage() for r in caplog.records if r.name.startswith("orbslam2py")]
    assert len(warnings) == 1
    assert "everyone who reaches this computer over the network sees the images" in warnings[0]


def test_without_viser_the_line_that_installs_it_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(StateError, match=r"pip install 'orbslam2py\[viewer\]'"):
        start_server()


def test_no_browser_is_opened_without_a_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []

    def open_it(address: str) -> bool:
        opened.append(address)
        return True

    monkeypatch.setattr("webbrowser.open", open_it)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SSH_CONNECTION"):
        monkeypatch.delenv(name, raising=False)
    assert not open_page("http://127.0.0.1:1")
    monkeypatch.setenv("DISPLAY", ":0")
    assert open_page("http://127.0.0.1:1")
    monkeypatch.setenv("SSH_CONNECTION", "from to")
    assert not open_page("http://127.0.0.1:1")
    assert opened == ["http://127.0.0.1:1"]
