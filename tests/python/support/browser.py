# SPDX-License-Identifier: BSD-3-Clause
"""A real browser without a screen: Chromium, driven through its DevTools.

with Browser() as browser:
    page = browser.open(path.as_uri(), width=390)
    page.wait_for("document.querySelectorAll('svg').length > 3")
    assert page.errors == []
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import pytest
import websocket

#: Names under which Debian and others have it.
_PROGRAMS = ("chromium", "chromium-browser", "google-chrome")

_FLAGS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--disable-default-apps", "--disable-extensions", "--no-default-browser-check"),
    *("--mute-audio", "--hide-scrollbars", "--force-color-profile=srgb", "--no-proxy-server"),
    # WebGL by the processor: the same pictures whatever the machine has.
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
    *("--remote-debugging-port=0", "--remote-allow-origins=*"),
)

#: Seconds that an answer of the browser may take.
_PATIENCE = 60.0


def find_chromium() -> str:
    """The browser's program; skips the test where there is none."""
    for name in _PROGRAMS:
        program = shutil.which(name)
        if program is not None:
            return program
    pytest.skip("no chromium: scripts/install_system_packages.sh browser installs it")


class BrowserError(Exception):
    """The browser refused something, a script in it failed, or it is gone."""


class Browser:
    """A Chromium of its own, with a profile of its own that is removed at the end."""

    def __init__(self, *flags: str) -> None:
        program = find_chromium()
        self._profile = tempfile.TemporaryDirectory(prefix="browser-", ignore_cleanup_errors=True)
        command = [program, *_FLAGS, *flags, f"--user-data-dir={self._profile.name}", "about:blank"]
        self.process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            env={**os.environ, "TMPDIR": self._profile.name},  # a killed one leaves its sockets
        )
        self._wire = _Wire(_address(self.process))

    def open(
        self,
        address: str,
        *,
        width: int = 1440,
        height: int = 900,
        dark: bool = False,
        reduced_motion: bool = False,
        script: str = "",
    ) -> Page:
        """Open an address in a tab of its own, and wait until it is loaded.

        `script` runs before the scripts of the page.
        """
        target = self._wire.call("Target.createTarget", {"url": "about:blank"})["targetId"]
        attached = {"targetId": target, "flatten": True}
        session = self._wire.call("Target.attachToTarget", attached)["sessionId"]
        page = Page(self._wire, session, target)
        for domain in ("Page", "Runtime", "Network", "Log"):
            page.call(f"{domain}.enable")
        page.set_size(width, height)
        page.set_media(dark=dark, reduced_motion=reduced_motion)
        page.call("Page.addScriptToEvaluateOnNewDocument", {"source": script})
        page.go(address)
        return page

    def kill(self) -> None:
        """End it at once, as a crash does."""
        self.process.kill()
        self.process.wait(_PATIENCE)

    def close(self) -> None:
        """End it and remove its profile."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(10)
            except subprocess.TimeoutExpired:
                self.kill()
        self._wire.close()
        assert self.process.stderr is not None
        self.process.stderr.close()
        self._profile.cleanup()

    def __enter__(self) -> Browser:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class Page:
    """A tab, and what was heard from it."""

    def __init__(self, wire: _Wire, session: str, target: str) -> None:
        self._wire, self._session, self._target = wire, session, target
        self.errors: list[str] = []
        """Errors and warnings of its console, exceptions nobody caught, failed requests."""
        self.messages: list[str] = []
        """All that it wrote to its console."""
        self.requests: list[str] = []
        """Addresses it asked for, its own included."""
        self._loaded = threading.Event()
        wire.listen(session, self._hear)

    def call(self, method: str, parameters: dict[str, Any] | None = None) -> dict[str, Any]:
        """Send a command of the DevTools protocol and return its answer."""
        return self._wire.call(method, parameters, self._session)

    def go(self, address: str) -> None:
        """Go to an address, and wait until it is loaded."""
        self._loaded.clear()
        answer = self.call("Page.navigate", {"url": address})
        if "errorText" in answer:
            raise BrowserError(f"{address}: {answer['errorText']}")
        if "loaderId" in answer and not self._loaded.wait(_PATIENCE):
            raise BrowserError(f"{address} was not loaded within {_PATIENCE:.0f} s")

    def evaluate(self, expression: str) -> Any:
        """Value of a JavaScript expression; of what a promise gives, if it is one."""
        parameters = {"expression": expression, "returnByValue": True, "awaitPromise": True}
        answer = self.call("Runtime.evaluate", parameters)
        if "exceptionDetails" in answer:
            raise BrowserError(_describe(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def wait_for(self, expression: str, seconds: float = 30.0) -> Any:
        """Wait until an expression is true; returns its value."""
        value = self.evaluate(
            f"""new Promise((done, failed) => {{
              const end = performance.now() + {1000 * seconds};
              const look = () => {{
                let value;
                try {{ value = ({expression}); }} catch (error) {{ failed(error); return; }}
                if (value || performance.now() > end) done(value);
                else setTimeout(look, 20);
              }};
              look();
            }})"""
        )
        if not value:
            raise BrowserError(f"not within {seconds} s: {expression}")
        return value

    def wait_for_error(self, text: str, seconds: float = 30.0) -> str:
        """Wait until an error that holds a text was heard; returns it."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = [error for error in list(self.errors) if text in error]
            if found:
                return found[0]
            self.evaluate("new Promise(requestAnimationFrame)")
        raise BrowserError(f"not within {seconds} s: an error that says '{text}'")

    def set_size(self, width: int, height: int, *, scale: float = 1.0) -> None:
        """Give it the size of a screen [CSS px]; below 600 px wide it is a telephone."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale}
        self.call("Emulation.setDeviceMetricsOverride", {**metrics, "mobile": width < 600})
        self.call("Emulation.setTouchEmulationEnabled", {"enabled": width < 600})

    def set_media(self, *, dark: bool, reduced_motion: bool = False) -> None:
        """Say what its user prefers."""
        features = [
            {"name": "prefers-color-scheme", "value": "dark" if dark else "light"},
            {"name": "prefers-reduced-motion", "value": "reduce" if reduced_motion else ""},
        ]
        self.call("Emulation.setEmulatedMedia", {"features": features})

    def mouse(self, kind: str, x: float, y: float, **more: Any) -> None:
        """Send a mouse event: mouseMoved, mousePressed, mouseReleased, mouseWheel."""
        if kind in ("mousePressed", "mouseReleased"):
            more = {"button": "left", "clickCount": 1, **more}
        self.call("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, **more})

    def click(self, selector: str) -> None:
        """Click in the middle of an element, after it was scrolled into view."""
        x, y = self.middle_of(selector)
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)
        self.mouse("mouseReleased", x, y)

    def middle_of(self, selector: str) -> tuple[float, float]:
        """Scroll an element into view; returns the middle of its first box [CSS px]."""
        found = self.evaluate(
            f"""(() => {{
              const element = document.querySelector({json.dumps(selector)});
              if (!element) return null;
              element.scrollIntoView({{block: "center", behavior: "instant"}});
              const box = element.getClientRects()[0] ?? element.getBoundingClientRect();
              return [box.x + box.width / 2, box.y + box.height / 2];
            }})()"""
        )
        if found is None:
            raise BrowserError(f"nothing is {selector}")
        return float(found[0]), float(found[1])

    def drag(self, selector: str, dx: float, dy: float) -> None:
        """Press in the middle of an element, move [CSS px], release."""
        x, y = self.middle_of(selector)
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y)
        for part in (0.5, 1.0):
            self.mouse("mouseMoved", x + part * dx, y + part * dy, button="left", buttons=1)
        self.mouse("mouseReleased", x + dx, y + dy)

    def screenshot(self, path: Path | None = None, *, whole: bool = False) -> bytes:
        """PNG of what is seen, or of the whole page; also written to a file if one is named."""
        parameters: dict[str, Any] = {"format": "png"}
        if whole:
            size = self.call("Page.getLayoutMetrics")["cssContentSize"]
            clip = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
            parameters |= {"captureBeyondViewport": True, "clip": clip}
        picture = base64.b64decode(self.call("Page.captureScreenshot", parameters)["data"])
        if path is not None:
            path.write_bytes(picture)
        return picture

    def close(self) -> None:
        """Close the tab."""
        self._wire.call("Target.closeTarget", {"targetId": self._target})

    def _hear(self, method: str, event: dict[str, Any]) -> None:
        if method == "Network.requestWillBeSent":
            self.requests.append(event["request"]["url"])
        elif method == "Network.loadingFailed" and not event.get("canceled"):
            self.errors.append(f"request failed: {event['errorText']}")
        elif method == "Network.webSocketCreated":
            self.requests.append(event["url"])
        elif method == "Runtime.exceptionThrown":
            self.errors.append(_describe(event["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled":
            words = (
                argument.get("value", argument.get("description")) for argument in event["args"]
            )
            text = " ".join(str(word) for word in words)
            self.messages.append(text)
            if event["type"] in ("error", "assert", "warning"):
                self.errors.append(text)
        elif method == "Log.entryAdded" and event["entry"]["level"] in ("error", "warning"):
            self.errors.append(event["entry"]["text"])
        elif method == "Page.loadEventFired":
            self._loaded.set()


class _Wire:
    """The connection: answers go to who asked, events to who listens."""

    def __init__(self, address: str) -> None:
        self._socket = websocket.create_connection(address, timeout=None, max_size=None)
        self._lock = threading.Lock()
        self._changed = threading.Condition(self._lock)
        self._last_id = 0
        self._answers: dict[int, dict[str, Any]] = {}
        self._listeners: dict[str, Callable[[str, dict[str, Any]], None]] = {}
        self._is_open = True
        self._reader = threading.Thread(target=self._read, name="browser", daemon=True)
        self._reader.start()

    def listen(self, session: str, listener: Callable[[str, dict[str, Any]], None]) -> None:
        self._listeners[session] = listener

    def call(
        self, method: str, parameters: dict[str, Any] | None = None, session: str | None = None
    ) -> dict[str, Any]:
        message: dict[str, Any] = {"method": method, "params": parameters or {}}
        if session is not None:
            message["sessionId"] = session
        with self._lock:
            self._last_id += 1
            number = self._last_id
        try:
            self._socket.send(json.dumps({"id": number, **message}))
        except (OSError, websocket.WebSocketException) as error:
            raise BrowserError(f"the browser is gone: {method}") from error
        with self._changed:
            self._changed.wait_for(lambda: number in self._answers or not self._is_open, _PATIENCE)
            answer = self._answers.pop(number, None)
        if answer is None:
            raise BrowserError(f"no answer to {method}")
        if "error" in answer:
            raise BrowserError(f"{method}: {answer['error']['message']}")
        result: dict[str, Any] = answer["result"]
        return result

    def close(self) -> None:
        self._socket.close()
        self._reader.join(_PATIENCE)

    def _read(self) -> None:
        try:
            while text := self._socket.recv():
                message = json.loads(text)
                if "id" in message:
                    with self._changed:
                        self._answers[message["id"]] = message
                        self._changed.notify_all()
                elif message.get("sessionId") in self._listeners:
                    self._listeners[message["sessionId"]](message["method"], message["params"])
        except (OSError, websocket.WebSocketException):
            pass  # closed, by us or by its end: who waits is told below
        finally:
            with self._changed:
                self._is_open = False
                self._changed.notify_all()


def _address(process: subprocess.Popen[bytes]) -> str:
    """Wait for the line in which the browser says where it listens."""
    assert process.stderr is not None
    said: list[str] = []
    for line in process.stderr:
        said.append(line.decode(errors="replace").strip())
        if said[-1].startswith("DevTools listening on "):
            # What it says later must not fill the pipe.
            threading.Thread(target=_drain, args=(process.stderr,), daemon=True).start()
            return said[-1].removeprefix("DevTools listening on ")
    raise BrowserError("the browser did not start: " + " / ".join(said[-3:]))


def _drain(stream: Any) -> None:
    try:
        for _ in stream:
            pass
    except ValueError:
        pass  # closed


def _describe(details: dict[str, Any]) -> str:
    exception = details.get("exception", {})
    return str(exception.get("description") or exception.get("value") or details["text"])
