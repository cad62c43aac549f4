# SPDX-License-Identifier: BSD-3-Clause
"""Pages of finished runs: ``report`` and ``compare``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.runs.report_page import compare_runs
from support.command_line import CommandLine
from support.made_up_runs import made_up_run

pytestmark = pytest.mark.page


@pytest.fixture
def pair(tmp_path: Path) -> tuple[Path, Path]:
    good = made_up_run(tmp_path / "good")
    return good, made_up_run(tmp_path / "bad", "k" * 30 + "rl" + "k" * 8, noise=0.2)


def test_report_is_made_again(command: CommandLine, pair: tuple[Path, Path]) -> None:
    run = pair[0]
    page = (run / "report.html").read_bytes()
    (run / "report.html").unlink()
    done = command("report", run)
    assert (done.code, done.err) == (0, "")
    assert str(run / "report.html") in done.out
    assert (run / "report.html").read_bytes() == page
    assert command("report", run, "-o", "page.html").code == 0
    assert Path("page.html").read_bytes() == page


def test_compare(command: CommandLine, pair: tuple[Path, Path]) -> None:
    done = command("compare", *pair, "-o", "both.html")
    assert (done.code, done.err) == (0, "")
    page = Path("both.html").read_text()
    for run in pair:
        report = json.loads((run / "report.json").read_text())
        assert f"{report['ate_rmse_m']:.4g}" in done.out
        assert f"{report['ate_rmse_m']:.4g}" in page
    line = next(line for line in done.out.splitlines() if "ATE, RMSE" in line)
    good, bad = line.split("\u2502")[3:5]
    assert "*" in good
    assert "*" not in bad
    for name in ("plot-error", "plot-inliers", "plot-times", "above", "solid"):
        assert f'id="{name}"' in page
    assert "★" in page
    assert command("compare", *pair).code == 0
    assert Path("compare.html").read_text() == page


def test_paths_are_put_on_top_of_each_other(tmp_path: Path) -> None:
    metric = made_up_run(tmp_path / "metric")
    scaled = made_up_run(tmp_path / "scaled", sensor="mono", has_truth=False)
    lines = (scaled / "trajectory.txt").read_text().splitlines()
    moved = []
    for line in lines:
        time, x, y, z, *turn = line.split()
        # In another frame and unit.
        moved.append(
            " ".join([time, str(3 * float(z) + 7), str(3 * float(y)), str(-3 * float(x)), *turn])
        )
    (scaled / "trajectory.txt").write_text("\n".join(moved) + "\n")
    comparison = compare_runs([metric, scaled])
    first, second = comparison.paths
    assert first is not None
    assert second is not None
    assert np.abs(first - second).max() < 0.01
    assert comparison.warnings == ["The runs are of different sensors."]


def test_best_is_marked_only_where_there_is_a_better(tmp_path: Path) -> None:
    runs = [made_up_run(tmp_path / name, noise=noise) for name, noise in (("a", 0.0), ("b", 0.1))]
    runs.append(made_up_run(tmp_path / "c", has_truth=False))
    comparison = compare_runs(runs)
    best = {row.figure.key: row.best for rows in comparison.rows().values() for row in rows}
    assert best["tracked"] == [False] * 3, "all alike"
    assert best["ate_rmse_m"] == [True, False, False], "not known of the last"
    assert best["keyframes"] == [False] * 3, "neither is better"


def test_a_run_without_poses_is_best_at_nothing(tmp_path: Path) -> None:
    runs = [made_up_run(tmp_path / "a", "k" * 20 + "rl" + "k" * 9)]
    runs.append(made_up_run(tmp_path / "b", "n" * 31))
    best = [row.best for rows in compare_runs(runs).rows().values() for row in rows]
    assert not any(flags[1] for flags in best)


def test_names_tell_the_runs_apart(tmp_path: Path) -> None:
    runs = [made_up_run(tmp_path / day / "circle", "k" * 8) for day in ("monday", "tuesday")]
    assert compare_runs(runs).names == ["monday/circle", "tuesday/circle"]
    assert len(set(compare_runs([runs[0], runs[0]]).names)) == 2
