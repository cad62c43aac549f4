# SPDX-License-Identifier: BSD-3-Clause
"""Take the pictures of the pages of runs that the documentation shows.

    python scripts/draw_report_pictures.py          # of the demo, which is made on the spot
    python scripts/draw_report_pictures.py RUN      # of a finished run

Chromium is needed, and websocket-client (`pip install .[test]`).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from orbslam2py.runs import RunOptions, SystemOptions, run_sequence
from orbslam2py.runs.report_page import write_report_page
from orbslam2py.settings import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests/python"))

from support.browser import Browser  # noqa: E402  # beside the tests, which drive it as well

#: Width of the page, and how much of it is shown, on a desk and on a telephone [CSS px].
DESK, PHONE = (1200, 1000), (390, 1000)


def run_demo(folder: Path) -> Path:
    """The world of ``orbslam2py demo``, in the deterministic mode."""
    options = SyntheticOptions(world="corridor", sensor=Sensor.STEREO, speed=1.4, noise=2)
    wanted = RunOptions(Sensor.STEREO, SystemOptions(deterministic=True))
    done = run_sequence(
        SyntheticSequence(options), wanted, output=folder / "demo", command="orbslam2py demo"
    )
    if done.result.error is not None:
        sys.exit(f"the run failed: {done.result.error}")
    return folder / "demo"


def photograph(page: Path, path: Path) -> None:
    """The upper part of a page, light on a desk beside dark on a telephone."""
    shots = []
    with Browser() as browser:
        for (width, height), dark in ((DESK, False), (PHONE, True)):
            tab = browser.open(page.as_uri(), width=width, height=height, dark=dark)
            tab.wait_for("document.getElementById('solid').dataset.drawn")
            tab.evaluate("new Promise(requestAnimationFrame)")
            shots.append(cv2.imdecode(np.frombuffer(tab.screenshot(), np.uint8), cv2.IMREAD_COLOR))
            tab.close()
    gap = np.full((DESK[1], 20, 3), 255, np.uint8)
    cv2.imwrite(str(path), np.hstack([shots[0], gap, shots[1]]), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path, nargs="?", help="folder of a run [the demo's]")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images/report.png")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        run = arguments.run or run_demo(Path(folder))
        page = Path(folder) / "report.html"
        write_report_page(page, run)
        photograph(page, arguments.output)


if __name__ == "__main__":
    main()
