# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of the viewer for README and documentation, taken in a browser without a screen.

    .venv/bin/python scripts/draw_viewer_pictures.py SEQUENCE [--sensor S] [--output PNG]

Needs the extra ``viewer`` and Chromium. Without a sequence the demo's corridor is run. The picture
of the documentation: ``--frames 400 --look 2.9 -7.5 -7 2.9 0.5 -0.4 --point-size 2.4 --without
Covisibility``. Images are shown at the recording's rate, however busy the computer is.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

CHECKOUT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(CHECKOUT / "tests" / "python"))  # the tests' browser

import orbslam2py as orb  # noqa: E402
from orbslam2py.datasets import Sequence  # noqa: E402
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence  # noqa: E402
from support.browser import Browser, Page  # noqa: E402
from support.viewer_pages import (  # noqa: E402
    PATIENCE,
    click_on,
    open_viewer,
    picture,
    wait_until,
)

_WIDTH, _HEIGHT = 1600, 900

#: The field beside the slider with a label.
_NUMBER_OF = """
(() => {
  const text = %s;
  const all = [...document.querySelectorAll("label, div, p, span")];
  let row = all.filter(e => e.innerText?.trim() === text && e.getClientRects().length).at(-1);
  while (row && !row.querySelector("input")) row = row.parentElement;
  const field = row && [...row.querySelectorAll("input")].at(-1);
  if (!field) return null;
  field.scrollIntoView({block: "center", behavior: "instant"});
  const box = field.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
})()
"""


def open_source(arguments: argparse.Namespace) -> Sequence:
    """The sequence that is run."""
    if arguments.sequence is None:
        return SyntheticSequence(SyntheticOptions(world="corridor", sensor="stereo", speed=1.4))
    return orb.open_sequence(arguments.sequence, arguments.sensor)


def dismiss_notes(page: Page) -> None:
    """Close what the page says of a computer without graphics hardware."""
    page.evaluate(
        "document.querySelectorAll('.mantine-Notification-closeButton').forEach(b => b.click())"
    )


def wait_until_still(page: Page) -> None:
    """Wait until two pictures in a row are the same."""
    before = [np.zeros(0, np.uint8)]

    def still() -> bool:
        page.evaluate("new Promise(done => setTimeout(done, 700))")
        seen = picture(page)
        same = np.array_equal(seen, before[0])
        before[0] = seen
        return same

    wait_until(still, "a picture that stays")


def set_number(page: Page, label: str, number: float) -> None:
    """Type a number into the field with a label."""
    place = page.wait_for(_NUMBER_OF % json.dumps(label), PATIENCE)
    for count in (1, 2, 3):  # the third click chooses all that is there
        for kind in ("mousePressed", "mouseReleased"):
            page.mouse(kind, *place, clickCount=count)
    page.call("Input.insertText", {"text": f"{number:g}"})
    for kind in ("keyDown", "keyUp"):
        page.call("Input.dispatchKeyEvent", {"type": kind, "key": "Enter", "text": "\r"})


def draw(arguments: argparse.Namespace) -> None:
    """Run, and take the picture after the wanted number of images."""
    sequence = open_source(arguments)
    n_frames = min(arguments.frames or len(sequence), len(sequence))
    rate = 1 / float(np.median(np.diff(sequence.timestamps)))
    with (
        patch("orbslam2py.viewer.publisher._rate", lambda times: rate),
        orb.System(sequence.settings, sequence.sensor, wait_for_mapping=True) as slam,
        orb.Viewer(slam, port=0, truth=sequence.ground_truth(), open_browser=False) as viewer,
        Browser() as browser,
    ):
        page = open_viewer(browser, viewer.address)
        page.set_size(_WIDTH, _HEIGHT)
        dismiss_notes(page)
        for layer in arguments.without:
            click_on(page, layer)
        if arguments.point_size is not None:
            set_number(page, "Point size", arguments.point_size)
        slam.run(itertools.islice(sequence, n_frames))
        if arguments.look is not None:
            look_from(viewer, arguments.look)
        wait_until_still(page)
        cv2.imwrite(
            str(arguments.output), picture(page)[:, :, ::-1], [cv2.IMWRITE_PNG_COMPRESSION, 9]
        )
        print(arguments.output)


def look_from(viewer: orb.Viewer, look: list[float]) -> None:
    """Let the view be free and put it somewhere: eye and target, world of the map."""
    viewer.look_from(look[:3], look[3:])


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("sequence", nargs="?")
    parser.add_argument("--sensor")
    parser.add_argument("--frames", type=int)
    parser.add_argument("--without", nargs="*", default=[], help="layers that are switched off")
    parser.add_argument("--look", nargs=6, type=float, help="eye and target")
    parser.add_argument("--point-size", type=float, help="as the slider of the page sets it")
    parser.add_argument("--output", type=Path, default=CHECKOUT / "docs/images/viewer.png")
    draw(parser.parse_args())


if __name__ == "__main__":
    main()
