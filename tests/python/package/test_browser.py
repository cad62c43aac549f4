# SPDX-License-Identifier: BSD-3-Clause
"""The browser that tests of pages drive: it sees what they are to be free of."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.browser import Browser, BrowserError

PAGE = """<!doctype html><meta name="viewport" content="width=device-width"><title>A page</title>
<body style="margin:0"><div id="wide" style="width:600px;height:40px;background:#f00"></div>
<button onclick="document.title = 'clicked'">press</button>
<script>{script}</script>"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as opened:
        yield opened


def write(folder: Path, script: str = "") -> str:
    page = folder / "page.html"
    page.write_text(PAGE.format(script=script))
    return page.as_uri()


def test_a_quiet_page(browser: Browser, tmp_path: Path) -> None:
    address = write(tmp_path)
    page = browser.open(address, width=390, height=700, dark=True)
    assert page.evaluate("[innerWidth, matchMedia('(prefers-color-scheme: dark)').matches]") == [
        # the wide box makes a telephone zoom out
        pytest.approx(600, abs=1),
        True,
    ]
    assert page.evaluate("document.documentElement.clientWidth") == 390
    assert page.evaluate("document.documentElement.scrollWidth") == 600
    page.click("button")
    page.wait_for("document.title === 'clicked'")
    assert (page.errors, page.requests) == ([], [address])
    picture = page.screenshot(tmp_path / "page.png")
    assert picture[:4] == b"\x89PNG"
    page.close()


@pytest.mark.parametrize(
    ("script", "error"),
    [
        ("console.error('told')", "told"),
        ("throw new Error('thrown')", "Error: thrown"),
        ("Promise.reject(new Error('nobody waits'))", "nobody waits"),
        ("fetch('http://127.0.0.1:9/x')", "request failed"),
    ],
)
def test_errors_are_seen(browser: Browser, tmp_path: Path, script: str, error: str) -> None:
    page = browser.open(write(tmp_path, script))
    page.wait_for_error(error)
    assert ("http://127.0.0.1:9/x" in page.requests) == ("fetch" in script)
    page.close()


def test_what_cannot_be_done(browser: Browser, tmp_path: Path) -> None:
    with pytest.raises(BrowserError, match="ERR_FILE_NOT_FOUND"):
        browser.open((tmp_path / "none.html").as_uri())
    page = browser.open(write(tmp_path))
    with pytest.raises(BrowserError, match="ReferenceError"):
        page.evaluate("nobody.knows")
    with pytest.raises(BrowserError, match="not within"):
        page.wait_for("false", 0.1)
    with pytest.raises(BrowserError, match="nothing is #none"):
        page.click("#none")
    page.close()


def test_a_crash_is_told() -> None:
    with Browser() as browser:
        page = browser.open("about:blank")
        browser.kill()
        with pytest.raises(BrowserError):
            page.evaluate("1")
