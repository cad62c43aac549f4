# SPDX-License-Identifier: BSD-3-Clause
"""The pages of runs in a browser, without a network, on a desk and on a telephone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from orbslam2py.runs.report_page import compare_runs, write_comparison
from support.browser import Browser, Page
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.page

#: Every drawing has marks of some size; the solid one pixels that are not its ground.
EMPTY_DRAWINGS = """[...document.querySelectorAll("figure.plot svg, svg.boxplot")].filter((svg) => {
  const marks = [...svg.querySelectorAll("path, rect")].filter((mark) => !mark.closest(".grid"));
  const seen = marks.filter((mark) => {
    const box = mark.getBoundingClientRect(), style = getComputedStyle(mark);
    return Math.max(box.width, box.height) > 0 || style.strokeLinecap === "round";
  });
  return seen.length === 0;
}).map((svg) => svg.getAttribute("aria-label"))"""
COLOURS = """(() => {
  const canvas = document.getElementById("solid"), pen = canvas.getContext("2d");
  const { data } = pen.getImageData(0, 0, canvas.width, canvas.height), found = new Set();
  for (let k = 0; k < data.length; k += 4) {
    if (data[k + 3] > 200) found.add(`${data[k]},${data[k + 1]},${data[k + 2]}`);
  }
  return found.size;
})()"""
PICTURE = "document.getElementById('solid').toDataURL()"
DRAWN = "document.getElementById('solid').dataset.drawn"
FRAME = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Pages by what is special about their runs."""
    folder = tmp_path_factory.mktemp("pages")
    full = made_up_run(folder / "full", "nn" + "k" * 40 + "rll" + "k" * 30 + "d")
    noisy = made_up_run(folder / "noisy", "nn" + "k" * 74, noise=0.1)
    maps = made_up_run(
        folder / "maps", "kkkkkn" * 4 + "kkkk", maps="000000111111222222333333" + "4444",
        sensor="mono", has_truth=False,
    )  # fmt: skip
    nothing = made_up_run(folder / "nothing", "n" * 20)
    odd = made_up_run(
        folder / "odd", "kkkkkk", name="<script>document.title='ran'</script>" + "x" * 90
    )
    both = folder / "both.html"
    write_comparison(both, compare_runs([full, noisy, nothing]))
    pages = {run.name: run / "report.html" for run in (full, maps, nothing, odd)}
    return {**pages, "both": both}


def opened(browser: Browser, file: Path, width: int = 1440, *, dark: bool = False) -> Page:
    page = browser.open(file.as_uri(), width=width, dark=dark)
    page.wait_for("document.body.dataset.ready")
    page.wait_for(f"!document.getElementById('solid') || {DRAWN}")
    return page


@pytest.mark.parametrize("width", [1440, 390])
@pytest.mark.parametrize("name", ["full", "maps", "nothing", "odd", "both"])
def test_every_page_works(browser: Browser, runs: dict[str, Path], name: str, width: int) -> None:
    page = opened(browser, runs[name], width, dark=width == 390)
    asked = [address for address in page.requests if not address.startswith("data:")]
    assert asked == [runs[name].as_uri()], "nothing else is asked for"
    assert page.errors == []
    assert page.evaluate(EMPTY_DRAWINGS) == []
    n_drawings = page.evaluate("document.querySelectorAll('figure.plot svg').length")
    assert n_drawings >= (2 if name == "nothing" else 5)
    assert page.evaluate("document.documentElement.scrollWidth") == width, "no sideways scrolling"
    if name != "nothing":
        assert page.evaluate(COLOURS) > 10
    assert page.evaluate("document.title") != "ran"
    page.close()


def test_dark_and_light(browser: Browser, runs: dict[str, Path]) -> None:
    ground = "getComputedStyle(document.body).backgroundColor"
    page = opened(browser, runs["full"])
    assert page.evaluate(ground) == "rgb(255, 255, 255)"
    page.set_media(dark=True)
    dark = page.evaluate(ground)
    assert dark != "rgb(255, 255, 255)"
    page.click("#theme")
    page.wait_for(f"{ground} === 'rgb(255, 255, 255)'")
    page.click("#theme")
    page.wait_for(f"{ground} === '{dark}'")
    assert page.errors == []
    page.evaluate("localStorage.clear()")
    page.close()


def test_the_path_turns(browser: Browser, runs: dict[str, Path]) -> None:
    page = opened(browser, runs["full"])
    pictures = [page.evaluate(PICTURE)]

    def changes(action: str) -> None:
        page.evaluate(FRAME)
        pictures.append(page.evaluate(PICTURE))
        assert pictures[-1] != pictures[-2], action

    page.drag("#solid", 120, 40)
    changes("drag")
    for view in ("above", "side", "behind", "near", "far"):
        page.click(f"[data-view={view}]")
        changes(view)
    for layer in ("points", "keyframes", "truth", "loops"):
        page.click(f"[data-layer={layer}]")
        changes(layer)
    page.evaluate("document.getElementById('solid').focus()")
    for key in ("ArrowLeft", "+"):
        page.call("Input.dispatchKeyEvent", {"type": "keyDown", "key": key, "text": key[:1]})
        changes(key)
    assert page.errors == []
    page.close()


#: The smallest distance of the path to the border of the canvas, and its largest extent in parts.
ROOM = """(() => {
  const places = JSON.parse(document.getElementById("solid").dataset.reach);
  const [left, top, right, bottom] = places;
  return [Math.min(left, top, 1 - right, 1 - bottom), Math.max(right - left, bottom - top)];
})()"""


@pytest.mark.parametrize("width", [1440, 700, 390])
def test_the_whole_path_is_seen_in_every_view(
    browser: Browser, runs: dict[str, Path], width: int
) -> None:
    page = opened(browser, runs["full"], width)
    for view in ("", "above", "side", "behind"):
        if view:
            page.click(f"[data-view={view}]")
            page.evaluate(FRAME)
        room, extent = page.evaluate(ROOM)
        assert room > 0.02, view
        assert extent > 0.6, "and not as a dot"
    page.close()


def test_one_cursor_over_all_plots(browser: Browser, runs: dict[str, Path]) -> None:
    page = opened(browser, runs["full"])
    said = "document.getElementById('cursor').innerText"
    shown = "[...document.querySelectorAll('.hair')].filter((hair) => !hair.hidden).length"
    assert page.evaluate(shown) == 0
    x, y = page.middle_of("#plot-inliers .canvas")
    page.mouse("mouseMoved", x, y)
    page.wait_for(f"{shown} === document.querySelectorAll('[data-time]').length")
    assert "inliers" in page.evaluate(said)
    page.evaluate("location.hash = '#frame-43'")
    page.wait_for(f"{said}.includes('frame 43')")
    assert "lost" in page.evaluate(said)
    assert "not found in the map" in page.evaluate(said)
    place = "[...document.querySelectorAll('.hair')].map((hair) => parseFloat(hair.style.left))"
    assert page.evaluate(place) == pytest.approx([100 * 43 / 75] * page.evaluate(shown), abs=0.01)
    page.click(".moments a")
    page.wait_for("document.querySelectorAll('.here-too').length === 1")
    assert page.evaluate("document.querySelector('.here').hidden") is False
    page.click("#cursor button")
    page.wait_for("document.getElementById('cursor').hidden")
    assert page.errors == []
    page.close()


def test_one_cursor_over_the_plots_of_several_runs(browser: Browser, runs: dict[str, Path]) -> None:
    page = opened(browser, runs["both"])
    x, y = page.middle_of("#plot-error .canvas")
    page.mouse("mouseMoved", x, y)
    hairs = "[...document.querySelectorAll('.hair')].filter((hair) => !hair.hidden)"
    page.wait_for(f"{hairs}.length === document.querySelectorAll('[data-time]').length")
    places = page.evaluate(f"{hairs}.map((hair) => parseFloat(hair.style.left))")
    assert places == pytest.approx([50.0] * len(places), abs=0.5)
    full, noisy, nothing = (
        page.evaluate(f"document.querySelectorAll('#cursor .of-run')[{k}].innerText.trim()")
        for k in range(3)
    )
    assert full.startswith("full: ")
    assert noisy.startswith("noisy: error ")
    assert "inliers" in noisy
    assert nothing == "nothing: ended"  # it is shorter than the others
    assert page.evaluate("document.querySelectorAll('#above .here').length") == 2
    page.click("#cursor button")
    page.wait_for("document.getElementById('cursor').hidden")
    assert page.evaluate("document.querySelectorAll('.here').length") == 0
    assert page.errors == []
    page.close()


def test_a_link_to_a_frame_opens_there(browser: Browser, runs: dict[str, Path]) -> None:
    page = browser.open(runs["full"].as_uri() + "#frame-10", width=390)
    page.wait_for("document.getElementById('cursor').innerText.includes('frame 10')")
    assert page.errors == []
    page.close()
