# SPDX-License-Identifier: BSD-3-Clause
"""Runs of the command-line program over whole sequences, each in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


def run(folder: Path, sensor: str, *options: str, preload: Path | None = None) -> dict[str, Any]:
    """``orbslam2py run`` with these options; returns report.json.

    Raises
    ------
    RuntimeError
        With the program's words, if it fails.
    """
    with tempfile.TemporaryDirectory() as output:
        command = [sys.executable, "-m", "orbslam2py", "run", str(folder), "--sensor", sensor]
        command += [*options, "--output", output, "--force", "--quiet"]
        environment = dict(os.environ)
        if preload is not None:
            environment["LD_PRELOAD"] = str(preload)
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
        report: dict[str, Any] = json.loads((Path(output) / "report.json").read_text())
        return report


@dataclass(frozen=True)
class LockTimes:
    """Sections under the map's lock, microseconds."""

    written: np.ndarray
    """(n, 3): waited, held, processor time used while held."""
    read: np.ndarray

    @staticmethod
    def measure(folder: Path, sensor: str, library: Path, *options: str) -> LockTimes:
        """Run the sequence with the measuring library in front of the C library."""
        with tempfile.TemporaryDirectory() as temporary:
            log = Path(temporary) / "locks.txt"
            os.environ["ORBSLAM2PY_LOCK_TIMES"] = str(log)
            try:
                run(folder, sensor, *options, preload=library.resolve())
            finally:
                del os.environ["ORBSLAM2PY_LOCK_TIMES"]
            rows = [line.split() for line in log.read_text().splitlines()]
        kinds = np.array([row[0] for row in rows])
        times = np.array([row[1:] for row in rows], np.float64).reshape(-1, 3)
        return LockTimes(times[kinds == "w"], times[kinds == "r"])
