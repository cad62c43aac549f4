# SPDX-License-Identifier: BSD-3-Clause
"""A web server for the page, and its address."""

from __future__ import annotations

import contextlib
import errno
import ipaddress
import logging
import os
import socket
import sys
import threading
import warnings
import weakref
import webbrowser
from collections.abc import Iterator
from typing import TYPE_CHECKING

from orbslam2py._files import reason_of
from orbslam2py.errors import StateError
from orbslam2py.viewer.unwanted_requests import UnwantedRequests

if TYPE_CHECKING:
    import viser

_log = logging.getLogger(__name__)

#: What is kept off the log, by the server that it was sent to.
_unwanted: weakref.WeakKeyDictionary[viser.ViserServer, UnwantedRequests] = (
    weakref.WeakKeyDictionary()
)

#: Where it listens if nobody says anything else.
LOOPBACK = "127.0.0.1"
DEFAULT_PORT = 8080
#: Ports after the first one that are tried.
_TRIES = 100
#: Time to notify browsers that it ends [s].
_GOODBYE = 0.3


def start_server(host: str = LOOPBACK, port: int | None = None) -> viser.ViserServer:
    """Serve an empty page.

    Parameters
    ----------
    host : str
        Address of this computer to listen at; by default only this computer can connect.
    port : int, optional
        The port, which must be free; 0: any free one. By default 8080 or the next free one.

    Raises
    ------
    StateError
        If viser is not installed, the port is in use or the host is no address of this computer.
    """
    require_viser()
    chosen = _find_port(host, DEFAULT_PORT if port is None else port, only=port is not None)
    if port is None and chosen != DEFAULT_PORT:
        _log.warning("port %d is taken: the viewer is at port %d", DEFAULT_PORT, chosen)
    if not _is_loopback(host):
        _log.warning(
            "the viewer listens at %s: everyone who reaches this computer over the network sees "
            "the images and can use every button; without --viewer-host only this computer can "
            "open it",
            host,
        )
    import viser  # noqa: PLC0415

    with _quiet():
        server = viser.ViserServer(host=host, port=chosen, verbose=False)
    _unwanted[server] = UnwantedRequests(server.get_port())
    # A browser may close at any moment, also between two lines that move its view.
    warnings.filterwarnings("ignore", r"Queued a \w+ on a closed connection", UserWarning)
    # It offers to share the page through somebody's server.
    server.request_share_url = lambda verbose=True: None  # type: ignore[method-assign]
    return server


def stop_server(server: viser.ViserServer) -> None:
    """Stop it; the pages in browsers stay open."""
    unwanted = _unwanted.pop(server, None)

    def stop() -> None:
        with _quiet():
            server.stop()

    # It waits seconds for the goodbye of every browser that was ever there, also of closed ones.
    stopping = threading.Thread(target=stop, name="viewer stop", daemon=True)
    stopping.start()
    stopping.join(_GOODBYE)
    if unwanted is not None:
        unwanted.stop()


def address_of(server: viser.ViserServer) -> str:
    """Address of the page for a browser on this computer."""
    host = server.get_host()
    if host in ("0.0.0.0", "::", ""):
        host = "localhost"
    if ":" in host:
        host = f"[{host}]"
    return f"http://{host}:{server.get_port()}"


def open_page(address: str) -> bool:
    """Open the page in the user's browser, if there is a screen."""
    if os.environ.get("SSH_CONNECTION") or not _has_screen():
        return False
    try:
        return webbrowser.open(address)
    except webbrowser.Error as error:
        _log.debug("no browser: %s", error)
        return False


def _has_screen() -> bool:
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def require_viser() -> None:
    """Check that viser is installed.

    Raises
    ------
    StateError
        With the command that installs it.
    """
    try:
        import viser  # noqa: F401, PLC0415  # optional, and slow to load
    except ModuleNotFoundError as error:
        raise StateError(
            f"the viewer needs the package {error.name}; install it with: "
            "pip install 'orbslam2py[viewer]'"
        ) from error


def _find_port(host: str, first: int, *, only: bool) -> int:
    if only and not 0 <= first < 1 << 16:
        raise StateError(f"--viewer-port must be from 0 to 65535, got {first}")
    for port in range(first, first + (1 if only else _TRIES)):
        try:
            return _bind(host, port)
        except socket.gaierror as error:
            raise StateError(f"--viewer-host {host} is no address of this computer") from error
        except OSError as error:
            if error.errno not in (errno.EADDRINUSE, errno.EACCES):
                raise StateError(
                    f"the viewer cannot listen at {host}: {reason_of(error)}; "
                    "give an address of this computer with --viewer-host"
                ) from error
            why = reason_of(error).lower()
    if only:
        raise StateError(
            f"the viewer cannot use port {first}: {why}; give another one with --viewer-port, "
            "or none to take the next free one"
        )
    raise StateError(
        f"no port from {first} to {first + _TRIES - 1} is free; give one with --viewer-port"
    )


def _bind(host: str, port: int) -> int:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as probe:
        # As servers do: one that has just ended does not hold its port.
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((host, port))
        return int(probe.getsockname()[1])


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the output of viser: we print the address once ourselves."""
    import rich  # noqa: PLC0415  # only with viser

    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
