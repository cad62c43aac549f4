# SPDX-License-Identifier: BSD-3-Clause
"""The page of everything that can be read, from the registries of the code.

python scripts/format_reference.py           write docs/reference/formats.md
python scripts/format_reference.py --check   fail if it says something else
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path

from orbslam2py.datasets.readable import (
    READABLE_IMU_SETTINGS,
    READABLE_LAYOUTS,
    READABLE_SAMPLES,
)
from orbslam2py.settings.foreign import FORMATS
from orbslam2py.trajectory.layouts import TRAJECTORY_LAYOUTS

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "formats.md"
_HEAD = """# What can it read?

This page is made from the code's own lists by `python scripts/format_reference.py`; a test compares
both.

"""
_PAIRS = {
    "file": "from the file",
    "right": "two files, `--right`",
    "baseline": "rectified, `--baseline`",
}


def reference() -> str:
    """Return the page."""
    parts = [_layouts(), _imus(), _calibrations(), _settings(), _trajectories()]
    return _HEAD + "\n\n".join(parts) + "\n"


def _layouts() -> str:
    rows = [
        (one.name, one.sensors, one.description, _code(one.example)) for one in READABLE_LAYOUTS
    ]
    head = ("layout", "sensors", "what it is", "example")
    return (
        "## Images\n\n`orbslam2py run PATH` recognises the layout by its files.\n\n"
        + _table(head, rows)
        + "\n\nA package can add its own layout: "
        "[Your own data set](../guide/own-dataset.md)."
    )


def _imus() -> str:
    samples, settings = (
        _table(("from", "what is read", "example"), rows)
        for rows in (
            [(one.name, one.description, _code(one.example)) for one in readable]
            for readable in (READABLE_SAMPLES, READABLE_IMU_SETTINGS)
        )
    )
    return (
        "## IMUs\n\nSamples come with the images: [Add an IMU](../guide/imu.md).\n\n"
        + samples
        + "\n\n`--imu-settings FILE` and `read_imu_settings` recognise the settings by their "
        "content.\n\n" + settings
    )


def _calibrations() -> str:
    rows = [
        (f"`{one.name}`", one.written_by, one.description, _PAIRS[one.pair], _code(one.example))
        for one in FORMATS
    ]
    head = ("`--format`", "written by", "what is read", "stereo pair", "example")
    return (
        "## Calibrations\n\n`orbslam2py import-camera FILE --output my.yaml` recognises the format "
        "by the content of the file. Lenses: pinhole, radial-tangential with 4 or 5 coefficients, "
        "rational with 8. Fisheye lenses of one camera: Kannala-Brandt (equidistant), double "
        "sphere, EUCM, Mei, FOV. Other lenses and fisheye pairs are refused with the reason.\n\n"
        + _table(head, rows)
    )


def _settings() -> str:
    return (
        "## Settings\n\n`--settings FILE` takes the files of ORB-SLAM2, of ORB-SLAM3 (0.x and 1.0) "
        "and of stella_vslam as they are, for pinhole cameras and single fisheye cameras: "
        "[Settings](settings.md)."
    )


def _trajectories() -> str:
    rows = [
        (one.name, one.written_by, one.description, _code(one.example))
        for one in TRAJECTORY_LAYOUTS
    ]
    head = ("layout", "written by", "what is special", "example")
    return (
        "## Trajectories\n\n`orbslam2py evaluate ESTIMATE TRUTH` and `read_trajectory` recognise "
        "the layout by the content.\n\n" + _table(head, rows)
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines
    )


def _code(example: str) -> str:
    return "<br>".join(f"`{line}`" for line in example.strip().splitlines())


def main() -> int:
    """Write the page, or compare it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    page = reference()
    if parser.parse_args().check:
        if PAGE.read_text(encoding="utf-8") == page:
            return 0
        print(f"{PAGE} is not what the code says; run python scripts/format_reference.py")
        return 1
    PAGE.write_text(page, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
