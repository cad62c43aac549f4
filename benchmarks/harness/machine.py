# SPDX-License-Identifier: BSD-3-Clause
"""What the figures are measured on."""

from __future__ import annotations

import os
import platform
from pathlib import Path

import cv2
from rich.console import Console

from benchmarks.harness import reference
from benchmarks.harness.yardstick import Yardstick


def print_machine(console: Console, yardstick: Yardstick) -> None:
    """Processor, load, versions, the yardsticks here and there, and whether others disturb."""
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    console.print(
        f"{_processor()}, {os.cpu_count()} processors, load {load}; "
        f"Python {platform.python_version()}, opencv-python {cv2.__version__}"
    )
    for name, (n, there) in reference.YARDSTICK.items():
        measured = yardstick.compare(lambda name=name: yardstick.run(name), name, 15)  # type: ignore[misc]
        console.print(
            f"yardstick {name} ({n} features): {measured.yardstick.median:.2f} ms here "
            f"(least {measured.yardstick.least:.2f}), {there} there"
        )
        if measured.yardstick.median > 1.2 * measured.yardstick.least:
            console.print(
                "[yellow]Other programs disturb: short steps suffer less than the yardstick, long "
                "ones more. Trust the least times, or come back later."
            )
    if not yardstick.exact:
        console.print(
            "[yellow]The extra data are missing (ORBSLAM2PY_SHARED): synthetic images stand in for "
            "the photographs, and the sequences are left out. Figures carried over are rough."
        )


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.processor()
