# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory files, and the atomic writing under them."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from orbslam2py._files import atomic_write
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    nearest_rotations,
    quaternions_from_rotations,
    rotation_angles,
    rotations_from_quaternions,
)
from orbslam2py.trajectory.trajectory import (
    Trajectory,
    TrajectoryFormat,
    read_euroc,
    read_kitti,
    read_trajectory,
    read_tum,
    write_kitti,
    write_tum,
)


def names_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def made_up(n: int, seed: int = 0) -> Trajectory:
    generator = np.random.default_rng(seed)
    T_wc = np.tile(np.eye(4), (n, 1, 1))
    T_wc[:, :3, :3] = Rotation.random(n, random_state=generator).as_matrix()
    T_wc[:, :3, 3] = generator.normal(size=(n, 3)) * 10
    return Trajectory(np.arange(n) * 0.1, T_wc)


# ---- rotations -----------------------------------------------------------------------------------


@given(
    st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 1e-3)
)
@hypothesis_settings(deadline=None)
def test_quaternions(q: list[float]) -> None:
    R = Rotation.from_quat(q).as_matrix()[None]
    ours = quaternions_from_rotations(R)[0]
    assert np.linalg.norm(ours) == pytest.approx(1.0)
    np.testing.assert_allclose(rotations_from_quaternions(ours[None]), R, atol=1e-14)
    np.testing.assert_allclose(Rotation.from_quat(ours).as_matrix(), R[0], atol=1e-14)
    if np.trace(R[0]) > 0:
        assert ours[3] > 0
    else:
        assert ours[np.diag(R[0]).argmax()] > 0


@pytest.mark.parametrize("axis", range(3))
def test_quaternion_of_half_a_turn(axis: int) -> None:
    R = -np.eye(3)
    R[axis, axis] = 1
    expected = np.zeros(4)
    expected[axis] = 1
    np.testing.assert_array_equal(quaternions_from_rotations(R[None])[0], expected)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.1, 3.0, np.pi])
def test_rotation_angle(angle: float) -> None:
    R = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()[None]
    assert rotation_angles(R)[0] == pytest.approx(angle, rel=1e-9, abs=1e-15)


def test_inverse_and_nearest() -> None:
    T = made_up(20).T_wc
    np.testing.assert_allclose(inverse_poses(T) @ T, np.tile(np.eye(4), (20, 1, 1)), atol=1e-12)
    R = T[:, :3, :3]
    np.testing.assert_allclose(nearest_rotations(1.001 * R + 1e-7), R, atol=1e-6)


# ---- the container -------------------------------------------------------------------------------


def test_fields_are_filled_in_and_checked() -> None:
    trajectory = made_up(3)
    np.testing.assert_array_equal(trajectory.lost, [False] * 3)
    np.testing.assert_array_equal(trajectory.indices, [0, 1, 2])
    assert len(trajectory.select(np.array([True, False, True]))) == 2
    with pytest.raises(ValueError, match="3 timestamps, but 2 T_wc"):
        Trajectory(np.arange(3), trajectory.T_wc[:2])


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
    with pytest.raises(ValueError, match="3 poses, but 2 time stamp texts"):
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
    empty = Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    write_kitti(tmp_path / "a.txt", empty)
    assert (tmp_path / "a.txt").read_text() == ""
    write_kitti(tmp_path / "a.txt", empty, 3)
    assert len(read_kitti(tmp_path / "a.txt")) == 3


@pytest.mark.parametrize("indices", [[1, 0], [0, 0], [-1, 0], [0, 2]])
def test_kitti_frames_must_increase(tmp_path: Path, indices: list[int]) -> None:
    trajectory = made_up(2)
    trajectory = Trajectory(trajectory.timestamps, trajectory.T_wc, indices=np.array(indices))
    with pytest.raises(ValueError, match="frame numbers must increase"):
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


# ---- atomic writing ------------------------------------------------------------------------------


def test_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with atomic_write(path) as stream:
        stream.write("new\n")
        assert path.read_text() == "old"
    assert path.read_bytes() == b"new\n"
    assert names_in(tmp_path) == ["a.txt"]
    with atomic_write(path, binary=True) as stream:
        stream.write(b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"


def test_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    with atomic_write(tmp_path / "ours"):
        pass
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("error", [ValueError("bad"), KeyboardInterrupt()])
def test_old_file_stays_when_writing_fails(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(type(error)), atomic_write(path) as stream:
        stream.write("half")
        raise error
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["a.txt"]


def test_missing_folder_is_named(tmp_path: Path) -> None:
    with (
        pytest.raises(FileNotFoundError, match=r"cannot write .*none/a\.txt: No such file"),
        atomic_write(tmp_path / "none" / "a.txt"),
    ):
        pass


def test_no_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", "hidden temporary name")

    monkeypatch.setattr(os, "open", refuse)
    with (
        pytest.raises(PermissionError, match=r"cannot write .*a\.txt: Permission denied") as caught,
        atomic_write(tmp_path / "a.txt"),
    ):
        pass
    assert caught.value.filename == str(tmp_path / "a.txt")


def test_full_disk_is_named_and_the_old_file_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "a.txt"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", fail)
    with (
        pytest.raises(OSError, match=r"cannot write .*a\.txt: No space left") as caught,
        atomic_write(path) as stream,
    ):
        stream.write("new")
    assert caught.value.errno == errno.ENOSPC
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["a.txt"]


def test_disk_that_fills_while_writing(tmp_path: Path) -> None:
    """The error of the stream itself names no file; ours does."""
    path = tmp_path / "a.txt"
    with (
        pytest.raises(OSError, match=r"cannot write .*a\.txt: No space left"),
        atomic_write(path),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert not path.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_devices_are_written_directly() -> None:
    with atomic_write("/dev/null") as stream:
        stream.write("gone")
    with pytest.raises(OSError, match="No space left"), atomic_write("/dev/full") as stream:
        stream.write("x" * 100_000)


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    with atomic_write(tmp_path / "link") as stream:
        stream.write("new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"
