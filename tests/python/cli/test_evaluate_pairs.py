# SPDX-License-Identifier: BSD-3-Clause
"""Which rows ``orbslam2py evaluate`` compares: those known to belong together, or none."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import Trajectory
from orbslam2py.trajectory import write_kitti, write_tum
from support.command_line import CommandLine, Outcome
from support.made_up_paths import wander

SCALE = 0.25
N = 120


def noisy(truth: Trajectory) -> Trajectory:
    """The same walk in units of four metres, a little off, from its first pose on."""
    T_wc = np.linalg.inv(truth.T_wc[0]) @ truth.T_wc
    T_wc[1:, :3, 3] += np.random.default_rng(1).normal(scale=0.02, size=(len(truth) - 1, 3))
    T_wc[:, :3, 3] *= SCALE
    return Trajectory(truth.timestamps, T_wc)


def leave_run(
    folder: Path,
    truth: Trajectory,
    *,
    start: int = 0,
    stride: int = 1,
    without: int = 12,
    sensor: str = "mono",
) -> None:
    """Files as a run of one camera leaves them, without a pose in some frames at the beginning."""
    folder.mkdir()
    frames = truth.select(np.arange(start, len(truth), stride))
    estimate = noisy(frames.select(np.arange(without, len(frames))))
    estimate = Trajectory(
        estimate.timestamps, estimate.T_wc, indices=np.arange(without, len(frames))
    )
    write_tum(folder / "trajectory.txt", estimate)
    write_kitti(folder / "trajectory_kitti.txt", estimate, len(frames))
    with (folder / "frames.csv").open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["index", "timestamp", "map", "state", "reason"])
        for row, time in enumerate(frames.timestamps):
            state = "OK" if row >= without else "NOT_INITIALIZED"
            writer.writerow([start + row * stride, f"{time:.6f}", 0, state, ""])
    (folder / "report.json").write_text(json.dumps({"sensor": sensor}))


def write_times(path: Path, truth: Trajectory) -> None:
    path.write_text("".join(f"{time:.6f}\n" for time in truth.timestamps))


def compared(command: CommandLine, *arguments: object) -> tuple[dict[str, Any], Outcome]:
    done = command("evaluate", *arguments, "--json", "figures.json")
    assert done.code == 0, done.err
    return json.loads(Path("figures.json").read_text()), done


def expect_right(figures: dict[str, Any], n: int) -> None:
    assert figures["matched_poses"] == n
    assert figures["ate_scale"] == pytest.approx(1 / SCALE, rel=0.02)
    assert 0.02 < figures["ate_rmse_m"] < 0.05


def expect_refused(done: Outcome, *words: str) -> None:
    assert done.code == 2, done.out
    assert "Compared" not in done.out
    assert len(done.err.splitlines()) == 1, done.err
    for word in words:
        assert word in done.err


# ---- a run's rows without time stamps ------------------------------------------------------------
@pytest.mark.parametrize(("start", "stride"), [(0, 1), (30, 1), (0, 2), (20, 3)])
def test_rows_of_a_run_have_the_times_of_its_frames(
    command: CommandLine, tmp_path: Path, start: int, stride: int
) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth, start=start, stride=stride)
    write_kitti(tmp_path / "poses.txt", truth)
    write_times(tmp_path / "times.txt", truth)
    write_tum(tmp_path / "truth.txt", truth)
    n = len(range(start, N, stride)) - 12
    for name in ("trajectory_kitti.txt", "trajectory.txt"):
        for reference in ("poses.txt", "truth.txt"):
            figures, done = compared(command, f"run/{name}", reference)
            expect_right(figures, n)
            assert f"{n} of {n} poses matched" in done.out
            assert "sim3 (a single camera)" in done.out


def test_truth_of_another_rate(command: CommandLine, tmp_path: Path) -> None:
    dense = wander(10 * N, rate=100.0)
    leave_run(tmp_path / "run", dense.select(np.arange(0, 10 * N, 10)))
    write_kitti(tmp_path / "poses.txt", dense)
    for name in ("trajectory_kitti.txt", "trajectory.txt"):
        expect_refused(command("evaluate", f"run/{name}", "poses.txt"), "poses.txt", "--times")
    write_times(tmp_path / "stamps.txt", dense)
    for name in ("trajectory_kitti.txt", "trajectory.txt"):
        arguments = (f"run/{name}", "poses.txt", "--times", "stamps.txt")
        expect_right(compared(command, *arguments)[0], N - 12)


@pytest.mark.parametrize(("start", "stride"), [(0, 1), (30, 1), (0, 2)])
def test_frame_numbers_stand_for_times(
    command: CommandLine, tmp_path: Path, start: int, stride: int
) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth, start=start, stride=stride)
    write_kitti(tmp_path / "poses.txt", truth)
    figures, done = compared(command, "run/trajectory_kitti.txt", "poses.txt")
    expect_right(figures, len(range(start, N, stride)) - 12)
    assert "by number of the frame, as in frames.csv" in done.out
    assert "Left out: 12 rows" in done.out


@pytest.mark.parametrize("start", [0, 30])
def test_rows_alone_are_not_paired(command: CommandLine, tmp_path: Path, start: int) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth, start=start, stride=2)
    (tmp_path / "run" / "frames.csv").unlink()
    write_kitti(tmp_path / "poses.txt", truth)
    write_tum(tmp_path / "truth.txt", truth)
    for reference in ("poses.txt", "truth.txt"):
        done = command("evaluate", "run/trajectory_kitti.txt", reference)
        expect_refused(done, "trajectory_kitti.txt", "frames.csv", "--times", "trajectory.txt")


def test_identities_are_never_compared(command: CommandLine, tmp_path: Path) -> None:
    """Without frames.csv, but with a row for every frame: as KITTI's tools take it."""
    truth = wander(N)
    leave_run(tmp_path / "run", truth, without=40)
    (tmp_path / "run" / "frames.csv").unlink()
    write_kitti(tmp_path / "poses.txt", truth)
    figures, done = compared(command, "run/trajectory_kitti.txt", "poses.txt")
    expect_right(figures, N - 41)  # the first pose itself is the identity, too
    assert figures["matched_from_s"] is None
    assert "by row: both files have a row for every frame" in done.out
    assert "Left out: 41 rows" in done.out


# ---- times beside the truth or given -------------------------------------------------------------
@pytest.mark.parametrize("place", ["beside", "given", "benchmark"])
def test_times_of_the_truth(command: CommandLine, tmp_path: Path, place: str) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth, without=0)
    folder = tmp_path / "dataset" / "poses"
    folder.mkdir(parents=True)
    (tmp_path / "dataset" / "sequences" / "06").mkdir(parents=True)
    write_kitti(folder / "06.txt", truth)
    times = {
        "beside": folder / "times.txt",
        "given": tmp_path / "stamps.txt",
        "benchmark": tmp_path / "dataset" / "sequences" / "06" / "times.txt",
    }[place]
    write_times(times, truth)
    write_tum(tmp_path / "estimate.txt", noisy(truth))
    more = ("--times", times) if place == "given" else ()
    figures, done = compared(command, "estimate.txt", "dataset/poses/06.txt", *more)
    expect_right(figures, N)
    assert figures["rpe_translation_rmse_m_1s"] is not None
    assert "by time" in done.out
    assert "differ by 0.00 ms" in done.out
    times.unlink()
    expect_refused(
        command("evaluate", "estimate.txt", "dataset/poses/06.txt"), "06.txt", "times.txt"
    )


def test_truth_that_ends_a_frame_early(command: CommandLine, tmp_path: Path) -> None:
    """As KITTI's sequences that were cut."""
    truth = wander(N)
    leave_run(tmp_path / "run", truth)
    write_kitti(tmp_path / "poses.txt", truth.select(np.arange(N - 1)))
    for name in ("trajectory_kitti.txt", "trajectory.txt"):
        expect_right(compared(command, f"run/{name}", "poses.txt")[0], N - 13)
    write_times(tmp_path / "times.txt", truth)
    for name in ("trajectory_kitti.txt", "trajectory.txt"):
        figures, done = compared(command, f"run/{name}", "poses.txt")
        expect_right(figures, N - 13)
        assert "poses.txt has 119 poses for 120 times" in done.err


def test_only_frames_of_the_last_map_are_compared(command: CommandLine, tmp_path: Path) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth, without=40)
    write_kitti(tmp_path / "poses.txt", truth)
    table = tmp_path / "run" / "frames.csv"
    lines = table.read_text().splitlines()
    lines[5:30] = [line.replace(",0,NOT_INITIALIZED", ",0,OK") for line in lines[5:30]]
    lines[30:] = [line.replace(",0,", ",1,") for line in lines[30:]]
    table.write_text("\n".join(lines) + "\n")
    expect_right(compared(command, "run/trajectory_kitti.txt", "poses.txt")[0], N - 40)
    # A map that ended with the last frame: the file holds nothing but the identity.
    write_kitti(tmp_path / "run" / "trajectory_kitti.txt", truth.select(np.zeros(0, int)), N)
    table.write_text("\n".join(line.replace(",1,", ",0,") for line in lines) + "\n")
    figures, _ = compared(command, "run/trajectory_kitti.txt", "poses.txt")
    assert figures["ate_rmse_m"] is None


@pytest.mark.parametrize("n", [N - 10, N - 1, N + 10])
def test_times_that_are_not_those_of_the_rows(command: CommandLine, tmp_path: Path, n: int) -> None:
    truth = wander(N)
    write_kitti(tmp_path / "poses.txt", truth)
    write_tum(tmp_path / "estimate.txt", noisy(truth))
    write_times(tmp_path / "stamps.txt", wander(n))
    done = command("evaluate", "estimate.txt", "poses.txt", "--times", "stamps.txt")
    expect_refused(done, f"stamps.txt holds {n} time stamps", f"{N} rows", "one per row")


def test_rows_for_every_frame_of_a_sequence(command: CommandLine, tmp_path: Path) -> None:
    truth = wander(N)
    folder = tmp_path / "09"
    (folder / "image_0").mkdir(parents=True)
    write_times(folder / "times.txt", truth)
    write_kitti(folder / "poses.txt", truth)
    write_kitti(tmp_path / "whole.txt", noisy(truth))
    figures, done = compared(command, "whole.txt", "09")
    expect_right(figures, N)
    assert "a row for every frame of the sequence" in done.out
    write_kitti(tmp_path / "part.txt", noisy(truth.select(np.arange(50))))
    expect_refused(command("evaluate", "part.txt", "09"), "part.txt has 50 rows", "120 frames")


# ---- files of other programs beside the estimate -------------------------------------------------
@pytest.mark.parametrize("sensor", ["lidar", None, ["mono"], {"name": "rgbd"}])
def test_a_report_of_another_program(command: CommandLine, tmp_path: Path, sensor: Any) -> None:
    truth = wander(N)
    write_tum(tmp_path / "a.txt", noisy(truth))
    write_tum(tmp_path / "b.txt", truth)
    (tmp_path / "report.json").write_text(json.dumps({"sensor": sensor}))
    figures, done = compared(command, "a.txt", "b.txt")
    expect_right(figures, N)
    assert (
        "sim3 (chosen from the lengths of the paths, because the sensor is not known)" in done.out
    )


@pytest.mark.parametrize("table", ["frame;x;y\n1;2;3\n", "", "index,timestamp\n0,0.5\n"])
def test_a_table_of_another_program(command: CommandLine, tmp_path: Path, table: str) -> None:
    truth = wander(N)
    (tmp_path / "frames.csv").write_text(table)
    write_tum(tmp_path / "a.txt", noisy(truth))
    write_kitti(tmp_path / "rows.txt", noisy(truth))
    write_tum(tmp_path / "b.txt", truth)
    write_kitti(tmp_path / "poses.txt", truth)
    expect_right(compared(command, "a.txt", "b.txt")[0], N)
    expect_right(compared(command, "rows.txt", "poses.txt")[0], N)
    expect_refused(command("evaluate", "a.txt", "poses.txt"), "poses.txt", "--times", "times.txt")


def test_a_damaged_table_is_told_where_it_is_needed(command: CommandLine, tmp_path: Path) -> None:
    truth = wander(N)
    leave_run(tmp_path / "run", truth)
    write_tum(tmp_path / "truth.txt", truth)
    write_kitti(tmp_path / "poses.txt", truth)
    table = tmp_path / "run" / "frames.csv"
    table.write_text(table.read_text().replace("\n5,", "\nfive,"))
    expect_right(compared(command, "run/trajectory.txt", "truth.txt")[0], N - 12)
    for name in ("trajectory.txt", "trajectory_kitti.txt"):
        expect_refused(command("evaluate", f"run/{name}", "poses.txt"), "frames.csv:7: no row")


# ---- told ----------------------------------------------------------------------------------------
def test_part_of_the_path_is_told(command: CommandLine, tmp_path: Path) -> None:
    truth = wander(N)
    write_tum(tmp_path / "a.txt", truth.shifted(0.004))
    write_tum(tmp_path / "b.txt", truth.select(np.arange(30)))
    figures, done = compared(command, "a.txt", "b.txt")
    assert "30 of 120 poses matched, from 100.004 to 102.904 s" in done.out
    assert "(100 %)" in done.out
    assert "only 30 of 120 poses have a true one" in done.err
    assert figures["matched_of_poses"] == N
    assert figures["time_difference_max_s"] == pytest.approx(0.004)
    write_tum(tmp_path / "a.txt", truth.select(np.arange(30)))
    write_tum(tmp_path / "b.txt", truth)
    figures, _ = compared(command, "a.txt", "b.txt")
    assert 0 < figures["matched_path_m"] < 0.5 * figures["true_path_m"]
