# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evo.tools import file_interface
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from orbslam2py import DatasetError
from orbslam2py.trajectory import (
    Trajectory,
    TrajectoryFormat,
    read_euroc,
    read_kitti,
    read_trajectory,
    read_tum,
    write_euroc,
    write_kitti,
    write_tum,
)
from support.made_up_paths import made_up


# ---- TUM -----------------------------------------------------------------------------------------
def test_tum_text(tmp_path: Path) -> None:
    T_wc = np.eye(4)[None].copy()
    T_wc[0, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T_wc[0, :3, 3] = [1, -2.5, -1e-12]
    write_tum(tmp_path / "a.txt", Trajectory(np.array([1.5]), T_wc))
    assert (tmp_path / "a.txt").read_text() == (
        "1.500000 1.000000000 -2.500000000 0.000000000 "
        "0.000000000 0.000000000 0.707106781 0.707106781\n"
    )


def test_tum_keeps_the_text_of_time_stamps_and_leaves_lost_poses_out(tmp_path: Path) -> None:
    trajectory = made_up(3)
    trajectory = Trajectory(trajectory.timestamps, trajectory.T_wc, np.array([False, True, False]))
    texts = ["1403715273.262142976", "x", "1.000000e-01"]
    write_tum(tmp_path / "a.txt", trajectory, texts)
    stamps = [line.split()[0] for line in (tmp_path / "a.txt").read_text().splitlines()]
    assert stamps == [texts[0], texts[2]]
    with pytest.raises(DatasetError, match="3 poses, but 2 time stamp texts"):
        write_tum(tmp_path / "a.txt", trajectory, texts[:2])


@given(n=st.integers(0, 20), seed=st.integers(0, 1000))
@hypothesis_settings(
    deadline=None, max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_tum_and_kitti_round_trip(tmp_path: Path, n: int, seed: int) -> None:
    trajectory = made_up(n, seed)
    write_tum(tmp_path / "tum.txt", trajectory)
    write_kitti(tmp_path / "kitti.txt", trajectory)
    for read in (read_tum(tmp_path / "tum.txt"), read_kitti(tmp_path / "kitti.txt")):
        np.testing.assert_allclose(read.T_wc, trajectory.T_wc, atol=5e-9)
    np.testing.assert_allclose(read_tum(tmp_path / "tum.txt").timestamps, trajectory.timestamps)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 2 3\n", ":1: expected 8 numbers, found 3 fields"),
        ("# c\n\n1 0 0 0 0 0 0 x\n", ":3: 'x' is not a number"),
        ("1 0 0 0 0 0 0 inf\n", ":1: inf is not finite"),
        ("1 0 0 0 0 0 0 0\n", "the quaternion of pose 0 is zero"),
    ],
)
def test_bad_tum(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(DatasetError) as caught:
        read_tum(tmp_path / "a.txt")
    assert expected in str(caught.value)


def test_quaternions_of_other_lengths_are_accepted(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("0 1 2 3 0 0 0 2.0\n")
    np.testing.assert_array_equal(read_tum(tmp_path / "a.txt").T_wc[0, :3, :3], np.eye(3))


# ---- KITTI ---------------------------------------------------------------------------------------
def test_kitti_has_a_line_for_every_frame(tmp_path: Path) -> None:
    """The original's file lacks the frames before the map begins (OD-14)."""
    T_wc = np.tile(np.eye(4), (2, 1, 1))
    T_wc[:, 2, 3] = [5, 7]
    trajectory = Trajectory(np.array([0.2, 0.4]), T_wc, indices=np.array([2, 4]))
    write_kitti(tmp_path / "a.txt", trajectory, 6)
    read = read_kitti(tmp_path / "a.txt", np.arange(6) * 0.1)
    np.testing.assert_array_equal(read.positions[:, 2], [0, 0, 5, 5, 7, 7])
    assert len((tmp_path / "a.txt").read_text().splitlines()[0].split()) == 12
    write_kitti(tmp_path / "a.txt", trajectory)
    assert len(read_kitti(tmp_path / "a.txt")) == 5


def test_kitti_of_nothing(tmp_path: Path) -> None:
    """The original reads the first keyframe of the empty map (OD-15)."""
    empty = Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    write_kitti(tmp_path / "a.txt", empty)
    assert (tmp_path / "a.txt").read_text() == ""
    write_kitti(tmp_path / "a.txt", empty, 3)
    assert len(read_kitti(tmp_path / "a.txt")) == 3


@pytest.mark.parametrize("indices", [[1, 0], [0, 0], [-1, 0], [0, 2]])
def test_kitti_frames_must_increase(tmp_path: Path, indices: list[int]) -> None:
    trajectory = made_up(2)
    trajectory = Trajectory(trajectory.timestamps, trajectory.T_wc, indices=np.array(indices))
    with pytest.raises(DatasetError, match="frame numbers must increase"):
        write_kitti(tmp_path / "a.txt", trajectory, 2)
    assert not (tmp_path / "a.txt").exists()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1 0 0\n", ":1: expected 12 numbers"),
        ("2 0 0 0 0 0 1 0 0 1 0 0\n", "not all poses hold rotations"),
        ("1 0 0 0 0 1 0 0 0 0 1 0\n" * 2, "2 poses for 1 time stamps"),
    ],
)
def test_bad_kitti(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(DatasetError) as caught:
        read_kitti(tmp_path / "a.txt", np.zeros(1))
    assert expected in str(caught.value)


# ---- any format ----------------------------------------------------------------------------------
def test_formats_are_recognised(tmp_path: Path) -> None:
    trajectory = made_up(3)
    write_tum(tmp_path / "tum.txt", trajectory)
    write_kitti(tmp_path / "kitti.txt", trajectory)
    (tmp_path / "euroc.csv").write_text("#t\n1403715273262142976,1,2,3,1,0,0,0\n")
    for name in ("tum.txt", "kitti.txt", "euroc.csv"):
        _, found = read_trajectory(tmp_path / name)
        assert str(found) == name.partition(".")[0]
    truth = read_euroc(tmp_path / "euroc.csv")
    assert truth.timestamps[0] == 1403715273262142976 / 1e9
    np.testing.assert_array_equal(truth.T_wc[0, :3, :3], np.eye(3))
    with pytest.raises(DatasetError, match="expected 12 numbers"):
        read_trajectory(tmp_path / "tum.txt", TrajectoryFormat.KITTI)


@pytest.mark.parametrize(
    ("text", "expected"),
    [("", "holds no poses"), ("# x\n", "holds no poses"), ("\n1 2 3\n", ":2: 3 fields")],
)
def test_files_that_are_no_trajectory(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / "a.txt").write_text(text)
    with pytest.raises(DatasetError) as caught:
        read_trajectory(tmp_path / "a.txt")
    assert expected in str(caught.value)
    with pytest.raises(DatasetError, match="cannot open"):
        read_trajectory(tmp_path / "none.txt")


# ---- EuRoC, written ------------------------------------------------------------------------------
def test_euroc_text(tmp_path: Path) -> None:
    T_wc = np.eye(4)[None].copy()
    T_wc[0, :3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T_wc[0, :3, 3] = [1, -2.5, -1e-12]
    write_euroc(tmp_path / "a.csv", Trajectory(np.array([1.5]), T_wc), ["1403636579.763555527"])
    header, row = (tmp_path / "a.csv").read_text().splitlines()
    assert header.startswith("#timestamp [ns],p_RS_R_x [m]")
    assert row == (
        "1403636579763555527,1.000000000,-2.500000000,0.000000000,"
        "0.707106781,0.000000000,0.000000000,0.707106781"
    )


def test_euroc_round_trip_without_lost_poses(tmp_path: Path) -> None:
    trajectory = made_up(9)
    lost = np.arange(9) == 4
    trajectory = Trajectory(trajectory.timestamps, trajectory.T_wc, lost)
    write_euroc(tmp_path / "a.csv", trajectory)
    kept = trajectory.select(~lost)
    for read in (read_euroc(tmp_path / "a.csv"), read_trajectory(tmp_path / "a.csv")[0]):
        np.testing.assert_allclose(read.timestamps, kept.timestamps, atol=1e-6)
        np.testing.assert_allclose(read.T_wc, kept.T_wc, atol=5e-9)
    with pytest.raises(DatasetError, match="9 poses"):
        write_euroc(tmp_path / "a.csv", trajectory, ["1", "2"])


def test_evo_reads_what_is_written(tmp_path: Path) -> None:
    trajectory = made_up(9)
    write_euroc(tmp_path / "a.csv", trajectory)
    read = file_interface.read_euroc_csv_trajectory(str(tmp_path / "a.csv"))
    np.testing.assert_allclose(read.poses_se3, trajectory.T_wc, atol=5e-9)
    np.testing.assert_allclose(read.timestamps, trajectory.timestamps, atol=1e-6)
