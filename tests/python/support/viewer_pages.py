# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's page in a real browser: what is seen in it, and clicks on its switches."""

from __future__ import annotations

import contextlib
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray
from support.browser import Browser, BrowserError, Page

#: Seconds until something must be seen, on a computer that draws without graphics hardware.
PATIENCE = 60.0
WIDTH, HEIGHT = 1200, 800
#: Where the map is seen: between the two panels.
_MAP = slice(470, 890)

#: Run first in the process of the page, that gives way to nobody then.
AS_URGENT = "import os; os.nice = lambda increment: 0\n"

#: The page draws ten pictures a second instead of sixty: without graphics hardware they take all of
#: the processor, which the system and the page's messages need.
_DRAW_SELDOM = """
window.requestAnimationFrame = call => setTimeout(() => call(performance.now()), 100);
window.cancelAnimationFrame = number => clearTimeout(number);
"""

#: Clicks on one thing: the page may move it away between the look for it and the click.
_MOST_CLICKS = 5

#: Elements that show exactly this text, of all kinds that can be clicked; the innermost. The page
#: notes whether the next click hits it.
_FIND = """
(() => {
  const text = %s;
  const all = [...document.querySelectorAll("button, label, [role=tab], [role=option]")];
  const seen = all.filter(e => e.innerText.trim() === text && e.getClientRects().length);
  let found = seen[0];
  if (!found) return null;
  found.scrollIntoView({block: "center", behavior: "instant"});
  const target = document.getElementById(found.htmlFor) || found;
  const box = target.getBoundingClientRect();
  window.clickHit = false;
  document.addEventListener("click", event => {
    window.clickHit ||= target.contains(event.target) || found.contains(event.target);
  }, {capture: true});
  return [box.x + box.width / 2, box.y + box.height / 2];
})()
"""


def open_viewer(browser: Browser, address: str) -> Page:
    """Open the page and wait until it is connected and has its switches."""
    page = browser.open(address, width=WIDTH, height=HEIGHT, script=_DRAW_SELDOM)
    page.wait_for("document.body.innerText.includes('Whole map')", PATIENCE)
    return page


def click_on(page: Page, text: str) -> None:
    """Click on the button, switch or tab with a text."""
    for _ in range(_MOST_CLICKS):
        place = page.wait_for(_FIND % json.dumps(text), PATIENCE)
        page.mouse("mouseMoved", *place)
        page.mouse("mousePressed", *place)
        page.mouse("mouseReleased", *place)
        with contextlib.suppress(BrowserError):
            page.wait_for("window.clickHit", 2.0)
            return
    raise BrowserError(f"{_MOST_CLICKS} clicks missed what shows '{text}'")


def wait_until_checked(page: Page, text: str, *, checked: bool = True) -> None:
    """Wait until the switch with a text is on, or off."""
    page.wait_for(
        f"""[...document.querySelectorAll("label")]
        .filter(e => e.innerText.trim() === {json.dumps(text)})
        .some(e => document.getElementById(e.htmlFor)?.checked === {json.dumps(checked)})""",
        PATIENCE,
    )


def picture(page: Page) -> ByteArray:
    """What is seen, (h, w, 3) red, green, blue."""
    decoded = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    assert decoded is not None
    return np.asarray(decoded[:, :, ::-1], np.uint8)


def amount(seen: ByteArray, colour: tuple[int, int, int], tolerance: int = 12) -> int:
    """Number of pixels of about a colour."""
    off = np.abs(seen.astype(np.int64) - np.array(colour)).max(axis=2)
    return int(np.count_nonzero(off <= tolerance))


def map_part(seen: ByteArray) -> ByteArray:
    """The middle of the page, where the map is drawn."""
    return seen[200:, _MAP]


def wait_until_seen(page: Page, condition: Callable[[ByteArray], bool], what: str) -> ByteArray:
    """Look again and again until a condition on what is seen holds."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        seen = picture(page)
        if condition(seen):
            return seen
        page.evaluate("new Promise(done => setTimeout(done, 50))")
    path = Path(tempfile.mkdtemp(prefix="viewer-")) / "seen.png"
    page.screenshot(path)
    raise BrowserError(f"not seen within {PATIENCE} s: {what}; what was seen is in {path}")


def wait_until(condition: Callable[[], bool], what: str, patience: float = PATIENCE) -> None:
    """Wait for something that the page has asked for."""
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            raise AssertionError(f"not within {patience} s: {what}")
        time.sleep(0.02)  # between two looks
