# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark programs of batches: what they compare, and how they simulate."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from benchmarks.batches.full import differences, promised_table
from benchmarks.batches.simulation import Run, measured_runs, simulate
from benchmarks.batches.tiny import growth_kb

import orbslam2py as orb
from support.batches import jobs_of, make_sequences

FAST = 1e9


def test_nothing_is_the_limit() -> None:
    """Runs of equal length, one after the other on each worker."""
    outcome = simulate([Run(2.0, 1.0)] * 40, 10, 1e-9, FAST)
    assert outcome.seconds == pytest.approx(8.0)
    assert outcome.efficiency == pytest.approx(1.0)
    assert simulate([Run(1.0, 0.0), Run(5.0, 0.0), Run(2.0, 0.0)], 2, 1e-9, FAST).seconds == (
        pytest.approx(5.0)
    )


def test_the_scheduler_is_the_limit() -> None:
    outcome = simulate([Run(0.1, 0.0)] * 1000, 100, 0.01, FAST)
    assert outcome.seconds == pytest.approx(1000 * 0.01, rel=0.05)
    assert outcome.scheduler > 0.95
    assert outcome.efficiency == pytest.approx(0.1, rel=0.05)


def test_the_disk_is_the_limit() -> None:
    """All read at once, each with an even share; one who reads less is done before."""
    outcome = simulate([Run(0.1, 100.0)] * 20, 20, 1e-9, 100.0)
    assert outcome.seconds == pytest.approx(20.0)
    assert outcome.disk == pytest.approx(1.0)
    short_and_long = simulate([Run(0.0, 10.0), Run(0.0, 90.0)], 2, 1e-9, 10.0)
    assert short_and_long.seconds == pytest.approx(10.0)


def test_growth() -> None:
    lines = [(100, 1.0, 50.0, 10.0), (1100, 2.0, 55.0, 10.0)]
    assert growth_kb(lines, 2) == pytest.approx(5.0)
    assert growth_kb(lines, 3) == 0.0
    assert growth_kb(lines[:1], 2) == 0.0


def test_batches_that_are_the_same_and_not(tmp_path: Path) -> None:
    document = jobs_of(make_sequences(tmp_path), seeds=1)
    document["options"]["max_frames"] = 3
    done = orb.batch(document, tmp_path / "a", workers=0)
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    rows = tmp_path / "b" / "results.csv"
    rows.write_text(rows.read_text().replace(done.rows[0]["worker"], "elsewhere:1"))
    assert differences(tmp_path / "a", tmp_path / "b") == [], "who made it is not promised"
    assert b"ate_rmse_m" in promised_table(tmp_path / "a")
    assert b"job_seconds" not in promised_table(tmp_path / "a")
    path = Path("runs") / done.rows[1]["run"] / "points.ply"
    (tmp_path / "b" / path).unlink()
    rows.write_text(rows.read_text().replace(str(done.rows[0]["ate_rmse_m"]), "7.0"))
    assert differences(tmp_path / "a", tmp_path / "b") == ["results.csv", str(path)]
    runs = measured_runs(tmp_path / "a" / "results.csv")
    assert [run.seconds for run in runs] == [row["job_seconds"] for row in done.rows]
    assert all(run.megabytes > 0.1 for run in runs)
