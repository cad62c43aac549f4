# SPDX-License-Identifier: BSD-3-Clause
"""Tables hold whatever rows hold: large numbers, names that are no text, numbers of NumPy."""

from __future__ import annotations

import csv
import os
import shutil
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.batches.sweep_picture import write_sweep_picture
from orbslam2py.batches.table import write_table
from support.batches import make_sequences, table

LARGEST = 2**64 - 1
#: A folder that a program with another locale has named.
ODD = os.fsdecode(b"caf\xe9")
PLAIN = {"run": "a-seed0", "sequence": "a", "sensor": "mono", "state": "done", "seed": 0}


def read_back(folder: Path, rows: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Write rows, and read them from all files of the table."""
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is an extra")
    assert len(write_table(folder, rows)) == 3
    with (folder / "results.csv").open(newline="", encoding="utf-8") as stream:
        lines: list[dict[str, Any]] = list(csv.DictReader(stream))
    with sqlite3.connect(folder / "results.sqlite") as database:
        database.row_factory = sqlite3.Row
        found = [dict(row) for row in database.execute("SELECT * FROM results ORDER BY run")]
    return [lines, found, parquet.read_table(folder / "results.parquet").to_pylist()]


@pytest.mark.parametrize("seed", [2**63 - 1, 2**63, LARGEST])
def test_seeds_of_64_bits(tmp_path: Path, seed: int) -> None:
    rows: list[dict[str, Any]] = [{**PLAIN, "seed": seed}, {**PLAIN, "run": "b-seed7", "seed": 7}]
    for found in read_back(tmp_path, rows):
        assert [str(row["seed"]) for row in found] == [str(seed), "7"]
        assert [row["run"] for row in found] == ["a-seed0", "b-seed7"]


def test_numbers_that_fit_stay_numbers(tmp_path: Path) -> None:
    row: dict[str, Any] = {**PLAIN, "ate_rmse_m": np.float64(0.25), "option.max_frames": 5}
    row |= {"option.deterministic": True, "reason": None, "sweep.ThDepth": np.int64(30)}
    _, *databases = read_back(tmp_path, [row])
    for (found,) in databases:
        assert (found["ate_rmse_m"], found["option.max_frames"]) == (0.25, 5)
        assert (found["option.deterministic"], found["reason"]) == (True, None)
        assert (found["sweep.ThDepth"], found["seed"]) == (30, 0)


@pytest.mark.parametrize(
    ("name", "told"), [(ODD, "caf\ufffd"), ("half \ud800", "half ?"), ("plain ä", "plain ä")]
)
def test_names_that_are_no_text(tmp_path: Path, name: str, told: str) -> None:
    row: dict[str, Any] = {**PLAIN, "path": f"/data/{name}", "sequence": name}
    for (found,) in read_back(tmp_path, [row]):
        assert (found["path"], found["sequence"]) == (f"/data/{told}", told)


def test_a_picture_of_names_that_are_no_text(tmp_path: Path) -> None:
    rows: list[dict[str, Any]] = [
        {"sequence": ODD, "sweep.ThDepth": depth, "ate_rmse_m": error}
        for depth, error in ((30, 0.1), (40, None))
    ]
    assert write_sweep_picture(tmp_path / "p.png", rows)


def test_a_batch_of_a_large_seed_and_an_odd_path(tmp_path: Path) -> None:
    """The table is there after all runs, also of an archive."""
    folder = make_sequences(tmp_path / "made")
    (folder / "one").rename(folder / ODD)
    packed = shutil.make_archive(str(tmp_path / "packed"), "zip", folder, "two")
    Path(packed).rename(tmp_path / f"{ODD}.zip")
    document: dict[str, Any] = {
        "sequences": [str(folder / ODD), {"path": str(tmp_path / f"{ODD}.zip"), "name": "packed"}],
        "options": {"max_frames": np.int64(3), "deterministic": np.bool_(True)},
        "sweep": {"ThDepth": [np.float32(30.0)], "ORBextractor.nFeatures": [np.int64(600)]},
        "seeds": [LARGEST],
    }
    place = tmp_path / "out"
    done = orb.batch(document, place, workers=0, cache=tmp_path / "cache")
    assert [row["reason"] for row in done.rows] == [None, None]
    assert [row["seed"] for row in table(place)] == [str(LARGEST)] * 2
    assert "sequence" in table(place)[0]
    again = orb.batch(document, place, workers=0, cache=tmp_path / "cache", resume=True)
    assert [row["job_seconds"] for row in again.rows] == [row["job_seconds"] for row in done.rows]
