# SPDX-License-Identifier: BSD-3-Clause
"""Small batches, and their tables without what was measured."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import orbslam2py as orb
from orbslam2py.batches.table import is_measured
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


def make_sequences(folder: Path) -> Path:
    """Write two sequences of eight frames."""
    for name, seed in (("one", 0), ("two", 1)):
        options = SyntheticOptions(
            world="corridor", sensor="rgbd", frames=8, size=(160, 120), seed=seed
        )
        SyntheticSequence(options).write(folder / name)
    return folder


def jobs_of(sequences: Path, **more: Any) -> dict[str, Any]:
    options = {"deterministic": True, "max_frames": 6}
    return {"sequences": [str(sequences / "*")], "options": options, "seeds": 2, **more}


def make_batch(jobs: Path, folder: Path) -> None:
    """Run a batch, for a process of its own."""
    orb.batch(jobs, folder, workers=0)


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "results.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def reproducible(folder: Path) -> bytes:
    """The table without what was measured, as bytes."""
    rows = [
        ",".join(f"{name}={value}" for name, value in row.items() if not is_measured(name))
        for row in table(folder)
    ]
    return "\n".join(rows).encode()
