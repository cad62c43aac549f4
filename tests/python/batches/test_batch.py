# SPDX-License-Identifier: BSD-3-Clause
"""Batches: one table of all runs, whatever happens on the way."""

from __future__ import annotations

import json
import shutil
import signal
import sqlite3
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from matplotlib.axes import Axes

import orbslam2py as orb
from orbslam2py import batches
from orbslam2py.batches import work
from orbslam2py.batches.sweep_picture import write_sweep_picture
from orbslam2py.runs import FrameRow
from support.batches import jobs_of, make_sequences, reproducible, table


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequences(tmp_path_factory.mktemp("sequences"))


@dataclass
class Whole:
    """A batch in this process that nothing disturbed."""

    done: batches.BatchResult
    seen: list[tuple[int, int]]

    @property
    def folder(self) -> Path:
        return Path(self.done.folder)


@pytest.fixture(scope="module")
def whole(sequences: Path, tmp_path_factory: pytest.TempPathFactory) -> Whole:
    seen: list[tuple[int, int]] = []
    done = orb.batch(
        jobs_of(sequences),
        tmp_path_factory.mktemp("whole") / "out",
        workers=0,
        progress=lambda row, n, total: seen.append((n, total)),
    )
    return Whole(done, seen)


def test_table(whole: Whole) -> None:
    done, folder = whole.done, whole.folder
    assert whole.seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert (len(done.rows), done.n_failed, done.n_left) == (4, 0, 0)
    rows = table(folder)
    assert [row["run"] for row in rows] == sorted(row["run"] for row in rows)
    first = rows[0]
    assert first["sequence"] == "one"
    assert (first["state"], first["tracked"], first["option.max_frames"]) == ("done", "6", "6")
    report = json.loads((folder / "runs" / first["run"] / "report.json").read_text())
    assert float(first["ate_rmse_m"]) == report["ate_rmse_m"]
    assert first["version"] == orb.__version__
    assert float(first["peak_memory_mb"]) > 10
    with sqlite3.connect(folder / "results.sqlite") as database:
        found = database.execute("SELECT run, tracked, ate_rmse_m FROM results ORDER BY run")
        assert [list(map(str, row)) for row in found] == [
            [row["run"], row["tracked"], row["ate_rmse_m"]] for row in rows
        ]
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is an extra")
    assert parquet.read_table(folder / "results.parquet").num_rows == 4
    group = done.groups[0]
    assert (group.n_runs, group.n_failed) == (2, 0)
    assert group.ate_rmse_m is not None
    assert group.ate_rmse_m.least <= group.ate_rmse_m.median <= group.ate_rmse_m.most


def test_lists_of_a_report_are_counted(whole: Whole) -> None:
    """Each once: loops and losses have figures of their own."""
    for row in whole.done.rows:
        report = json.loads((whole.folder / "runs" / row["run"] / "report.json").read_text())
        counted = ("warnings", "maps", "merges", "full_adjustments")
        assert [row[name] for name in counted] == [len(report[name]) for name in counted]
        assert row["maps"] == 1
        assert (row["loops_closed"], row["lost"]) == (len(report["loops"]), len(report["losses"]))
        assert not {"loops", "losses"} & row.keys()


def test_resume(sequences: Path, whole: Whole, tmp_path: Path) -> None:
    """Stopped after two runs, with a half one: the same table as without a stop."""
    folder, stop = tmp_path / "stopped", threading.Event()
    done = orb.batch(
        jobs_of(sequences),
        folder,
        workers=0,
        stop=stop,
        progress=lambda row, n, total: stop.set() if n == 2 else None,
    )
    assert (len(done.rows), done.n_left) == (2, 2)
    finished, half = done.rows[0]["run"], done.rows[1]["run"]
    (folder / "runs" / half / "row.json").unlink()
    (folder / "runs" / half / "trajectory.txt").write_text("half a line")
    before = (folder / "runs" / finished / "row.json").stat().st_mtime_ns
    with pytest.raises(orb.DatasetError, match="holds a batch already; continue with --resume"):
        orb.batch(jobs_of(sequences), folder, workers=0)
    ran: list[str] = []
    resumed = orb.batch(
        jobs_of(sequences),
        folder,
        workers=0,
        resume=True,
        progress=lambda row, n, total: ran.append(row["run"]),
    )
    assert len(ran) == 3
    assert finished not in ran
    assert (folder / "runs" / finished / "row.json").stat().st_mtime_ns == before
    assert resumed.n_left == 0
    assert reproducible(folder) == reproducible(whole.folder)
    for row in resumed.rows:
        name = f"runs/{row['run']}/trajectory.txt"
        assert (folder / name).read_bytes() == (whole.folder / name).read_bytes()


def test_a_run_ended_by_ctrl_c_is_not_made(
    sequences: Path, whole: Whole, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In this process the run hears it first, and keeps what it has; half a run is none."""
    real, document = work.run_sequence, jobs_of(sequences)

    def interrupted(*arguments: Any, **options: Any) -> Any:
        def press(row: FrameRow, _: orb.System) -> None:
            if row.index == 1:
                signal.raise_signal(signal.SIGINT)

        return real(*arguments, **options, progress=press)

    with monkeypatch.context() as patch:
        patch.setattr(work, "run_sequence", interrupted)
        with pytest.raises(KeyboardInterrupt):
            orb.batch(document, tmp_path / "out", workers=0)
    ran: list[str] = []
    again = orb.batch(
        document,
        tmp_path / "out",
        workers=0,
        resume=True,
        progress=lambda row, n, total: ran.append(row["run"]),
    )
    assert len(ran) == len(again.rows) == 4
    assert again.n_failed == 0
    assert reproducible(tmp_path / "out") == reproducible(whole.folder)


def test_a_changed_job_is_run_again(sequences: Path, tmp_path: Path) -> None:
    document = {"sequences": [{"path": str(sequences / "one"), "name": "x"}]}
    document |= {"options": {"max_frames": 3, "deterministic": True}}
    orb.batch(document, tmp_path / "out", workers=0)
    document["sequences"] = [{"path": str(sequences / "two"), "name": "x"}]
    ran: list[str] = []
    done = orb.batch(
        document,
        tmp_path / "out",
        workers=0,
        resume=True,
        progress=lambda row, n, total: ran.append(row["run"]),
    )
    assert ran == [done.rows[0]["run"]]
    assert done.rows[0]["path"].endswith("two")


def test_failures_are_rows(sequences: Path, tmp_path: Path) -> None:
    """A run that fails says why, and the others go on; it is tried again by --resume."""
    broken = tmp_path / "broken"
    shutil.copytree(sequences / "one", broken)
    (broken / "rgb.txt").write_text("nonsense\n")
    (broken / "associations.txt").unlink()
    document = jobs_of(sequences, seeds=1)
    document["sequences"] = [str(broken), *document["sequences"]]
    done = orb.batch(document, tmp_path / "out", workers=0)
    rows = {row["sequence"]: row for row in done.rows}
    assert rows["broken"]["state"] == "failed"
    assert all("error" not in row for row in done.rows), "the reason says it"
    assert "rgb.txt:1: expected 'timestamp path'" in rows["broken"]["reason"]
    assert "\n" not in rows["broken"]["reason"]
    assert rows["one"]["state"] == rows["two"]["state"] == "done"
    shutil.rmtree(broken)
    shutil.copytree(sequences / "two", broken)
    again = orb.batch(document, tmp_path / "out", workers=0, resume=True)
    assert again.n_failed == 0


def test_sweep(sequences: Path, tmp_path: Path) -> None:
    document = jobs_of(sequences, seeds=1, sweep={"ORBextractor.nFeatures": [300, 900]})
    document["sequences"] = [str(sequences / "one")]
    done = orb.batch(document, tmp_path / "out", workers=0)
    assert [row["sweep.ORBextractor.nFeatures"] for row in done.rows] == [300, 900]
    few, many = (row["map_points"] for row in done.rows)
    assert few < many
    picture = tmp_path / "out" / "sweep.png"
    assert picture in done.files
    assert np.ptp(cv2.imread(str(picture))) > 200


def test_runs_without_a_result_are_in_the_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[tuple[list[float], str]] = []
    plot = Axes.plot

    def watched(axes: Axes, values: Any, heights: Any, mark: str, **more: Any) -> Any:
        drawn.append((list(values), mark))
        return plot(axes, values, heights, mark, **more)

    monkeypatch.setattr(Axes, "plot", watched)
    rows: list[dict[str, Any]] = [
        {"sequence": "a $strange_$ name", "sweep.ThDepth": value, "ate_rmse_m": error}
        for value, error in ((30, 0.1), (30, 0.3), (40, 0.2), (50, None))
    ]
    assert write_sweep_picture(tmp_path / "p.png", rows)
    assert drawn == [([30, 30, 40], "o"), ([30, 40], "-"), ([50], "x")]
    assert not write_sweep_picture(tmp_path / "none.png", [{"sequence": "a"}])
    assert not (tmp_path / "none.png").exists()


def test_two_workers(sequences: Path, whole: Whole, tmp_path: Path) -> None:
    """In processes of their own: the same bytes as in this one."""
    pytest.importorskip("distributed", reason="dask is an extra")
    seen: list[dict[str, str]] = []
    done = orb.batch(jobs_of(sequences), tmp_path / "there", workers=2, watch=seen.append)
    runs = {row["run"] for row in done.rows}
    assert any(seen)
    assert all(len(one) <= 2 and runs.issuperset(one.values()) for one in seen)
    assert (len(done.rows), done.n_failed) == (4, 0)
    assert reproducible(whole.folder) == reproducible(tmp_path / "there")
    for row in done.rows:
        for name in ("trajectory.txt", "points.ply"):
            file = Path("runs") / row["run"] / name
            there = tmp_path / "there" / file
            assert (whole.folder / file).read_bytes() == there.read_bytes()
