# SPDX-License-Identifier: BSD-3-Clause
"""Cost of the viewer for tracking: real time, with a page connected and without, in pairs.

    python -m benchmarks.speed.viewer_cost [--pairs 5]

Who looks is a program at this computer that takes all that a browser would take and draws nothing,
since a browser runs on another computer or draws with its graphics hardware.
"""

from __future__ import annotations

import json
import queue
import statistics
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks.harness.arguments import add_width, console_of, new_parser
from benchmarks.harness.folders import MISSING, sequence_folder, shared_folder
from benchmarks.harness.onlooker import Onlooker
from benchmarks.harness.tables import new_table, verdict

#: p99 of tracking with a page connected, at most so many times that without.
TARGET = 1.1
SEQUENCES = (("7scenes_redkitchen_head250", "rgbd"), ("kitti_06_head51_stereo", "stereo"))


@dataclass(frozen=True)
class Watched:
    """One run in real time."""

    median: float
    """Milliseconds of tracking."""
    p99: float
    dropped: int
    megabytes: float
    """Sent to the page."""


def run_once(folder: Path, sensor: str, *, watched: bool) -> Watched:
    """Run a sequence in real time, with or without a client of the viewer.

    Raises
    ------
    RuntimeError
        With the program's words, if it fails.
    """
    with tempfile.TemporaryDirectory() as output:
        command = [sys.executable, "-m", "orbslam2py", "run", str(folder), "--sensor", sensor]
        command += ["--realtime", "--output", output, "--force", "--quiet"]
        if watched:
            command += ["--viewer", "--viewer-port", "0", "--viewer-exit"]
        onlooker = Onlooker() if watched else None  # has its libraries before the run begins
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        if onlooker is not None:
            onlooker.look(_address_of(process))
        _, errors = process.communicate()
        sent = 0 if onlooker is None else onlooker.n_bytes()
        if process.returncode != 0:
            raise RuntimeError(errors)
        report = json.loads((Path(output) / "report.json").read_text())
    track = report["milliseconds"]["track"]
    return Watched(track["median"], track["p99"], report["dropped_frames"], sent / 1e6)


def _address_of(process: subprocess.Popen[str]) -> str:
    """Wait until the viewer says where it is."""
    assert process.stdout is not None
    said: queue.Queue[str] = queue.Queue()
    reader = threading.Thread(target=lambda: said.put(process.stdout.readline()), daemon=True)
    reader.start()
    words = said.get(timeout=60).split()
    address = next((word.rstrip(":") for word in words if word.startswith("http://")), None)
    if address is None:
        raise RuntimeError(f"the viewer did not say where it is: {' '.join(words)}")
    return address


def viewer_tables(n_pairs: int) -> Iterator[object]:
    """The table of both sequences."""
    if shared_folder() is None:
        yield f"[yellow]Viewer: left out, {MISSING}"
        return
    table = new_table(
        f"Tracking in real time, watched and not ({n_pairs} pairs, median of the ratios)",
        ["sequence"],
        [
            "median ms\nwithout",
            "with",
            "p99 ms\nwithout",
            "with",
            "ratio of p99",
            "target",
            "met",
            "dropped\nwithout / with",
            "MB sent",
        ],
        "Page and onlooker ran on this machine's cores as well; the onlooker takes all that a "
        "browser takes, and draws nothing.",
    )
    for name, sensor in SEQUENCES:
        folder = sequence_folder(name)
        pairs = [
            (run_once(folder, sensor, watched=False), run_once(folder, sensor, watched=True))
            for _ in range(n_pairs)
        ]
        ratio = statistics.median(after.p99 / before.p99 for before, after in pairs)
        before, after = ([pair[i] for pair in pairs] for i in (0, 1))
        table.add_row(
            name,
            f"{statistics.median(run.median for run in before):.1f}",
            f"{statistics.median(run.median for run in after):.1f}",
            f"{statistics.median(run.p99 for run in before):.1f}",
            f"{statistics.median(run.p99 for run in after):.1f}",
            f"{ratio:.2f}",
            f"{TARGET:.2f}",
            verdict(ratio <= TARGET),
            f"{sum(run.dropped for run in before)} / {sum(run.dropped for run in after)}",
            f"{statistics.median(run.megabytes for run in after):.1f}",
        )
    yield table


def main() -> None:
    parser = new_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=5, help="runs of each kind")
    add_width(parser)
    arguments = parser.parse_args()
    console = console_of(arguments)
    for table in viewer_tables(arguments.pairs):
        console.print(table)


if __name__ == "__main__":
    main()
