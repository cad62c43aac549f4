# SPDX-License-Identifier: BSD-3-Clause
"""The container of poses with time stamps."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.errors import DatasetError
from orbslam2py.trajectory import (
    Trajectory,
    associate,
    lengths_along,
    read_kitti,
    read_tum,
    write_euroc,
)
from support.made_up_paths import made_up


def through_pickle(trajectory: Trajectory) -> Trajectory:
    read: Trajectory = pickle.loads(pickle.dumps(trajectory))
    return read


def test_fields_are_filled_in_and_checked() -> None:
    trajectory = made_up(3)
    np.testing.assert_array_equal(trajectory.lost, [False] * 3)
    np.testing.assert_array_equal(trajectory.indices, [0, 1, 2])
    assert len(trajectory.select(np.array([True, False, True]))) == 2
    with pytest.raises(DatasetError, match="3 timestamps, but 2 T_wc"):
        Trajectory(np.arange(3), trajectory.T_wc[:2])


def test_prints_in_a_line() -> None:
    trajectory = made_up(3)
    steps = np.linalg.norm(np.diff(trajectory.positions, axis=0), axis=1)
    first, last = trajectory.timestamps[[0, -1]]
    assert repr(trajectory) == (
        f"<Trajectory: 3 poses, {first:.3f} s to {last:.3f} s, path length {steps.sum():.3f}>"
    )
    lost = Trajectory(trajectory.timestamps, trajectory.T_wc, np.array([False, False, True]))
    assert "3 poses (1 lost)" in repr(lost)
    assert f"path length {steps[0]:.3f}" in repr(lost), "lost poses are no part of the path"
    assert repr(trajectory.select([])) == "<Trajectory: no poses>"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, through_pickle])
def test_copies_are_equal_and_read_only_as_well(
    copied: Callable[[Trajectory], Trajectory],
) -> None:
    given = made_up(4)
    trajectory = Trajectory(given.timestamps, given.T_wc, np.arange(4) > 2, np.arange(4) * 2)
    same = copied(trajectory)
    assert same == trajectory
    for name in ("timestamps", "T_wc", "lost", "indices"):
        assert not getattr(same, name).flags.writeable, name


def test_the_other_way_round() -> None:
    trajectory = made_up(5)
    np.testing.assert_allclose(
        trajectory.T_cw @ trajectory.T_wc, np.tile(np.eye(4), (5, 1, 1)), atol=1e-12
    )


def test_quaternions_end_with_w() -> None:
    quarter_turn = np.eye(4)
    quarter_turn[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    trajectory = Trajectory(np.arange(2), np.stack([np.eye(4), quarter_turn]))
    half = np.sqrt(0.5)
    np.testing.assert_allclose(trajectory.quaternions, [[0, 0, 0, 1], [0, 0, half, half]])


@pytest.mark.parametrize(("name", "read"), [("tum", read_tum), ("kitti", read_kitti)])
def test_saved_and_read_again(
    tmp_path: Path, name: str, read: Callable[[Path], Trajectory]
) -> None:
    trajectory = made_up(6)
    trajectory.save(tmp_path / "path.txt", format=name)
    again = read(tmp_path / "path.txt")
    np.testing.assert_allclose(again.T_wc, trajectory.T_wc, atol=1e-8)
    trajectory.save(str(tmp_path / "tum.txt"))
    assert len(read_tum(tmp_path / "tum.txt")) == 6


def test_not_saved_in_another_format(tmp_path: Path) -> None:
    (tmp_path / "path.txt").write_text("mine")
    with pytest.raises(DatasetError, match="'euroc'; give tum or kitti"):
        made_up(3).save(tmp_path / "path.txt", "euroc")
    with pytest.raises(DatasetError, match="'csv'; give one of auto, tum, kitti, euroc"):
        made_up(3).save(tmp_path / "path.txt", "csv")
    with pytest.raises(DatasetError, match="frame numbers must increase"):
        made_up(3).select([2, 1]).save(tmp_path / "path.txt", "kitti")
    assert (tmp_path / "path.txt").read_text() == "mine"


def test_chosen_by_a_slice_a_mask_or_indices() -> None:
    trajectory = made_up(4)
    for which in (slice(1, 3), np.array([False, True, True, False]), [1, 2], np.array([1, 2])):
        np.testing.assert_array_equal(trajectory.select(which).indices, [1, 2])
    for wrong in (np.array([True, False]), [4], [-5], [0.5]):
        with pytest.raises(DatasetError, match=r"a mask of bool \(4,\), indices from 0 to 3"):
            trajectory.select(wrong)


def test_lengths_along_a_path() -> None:
    positions = np.array([[0, 0, 0], [3, 4, 0], [3, 4, 12.0]])
    np.testing.assert_array_equal(lengths_along(positions), [0, 5, 17])
    np.testing.assert_array_equal(lengths_along(positions[:1]), [0])
    assert len(lengths_along(positions[:0])) == 0


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (np.full((4, 4), np.nan), "holds a number that is not finite"),
        (np.zeros((4, 4)), "is no pose"),
        (np.diag([1.0, 1, -1, 1]), "is no pose"),
    ],
    ids=["nan", "zero", "mirror"],
)
@pytest.mark.parametrize("name", ["tum", "kitti"])
def test_what_could_not_be_read_again_is_not_written(
    tmp_path: Path, name: str, pose: np.ndarray, reason: str
) -> None:
    good = made_up(4)
    T_wc = good.T_wc.copy()
    T_wc[2] = pose
    with pytest.raises(DatasetError, match=f"^pose 2 of the trajectory {reason}.*; correct it"):
        Trajectory(good.timestamps, T_wc).save(tmp_path / "t.txt", name)
    with pytest.raises(DatasetError, match=r"^pose 2 of the trajectory"):
        write_euroc(tmp_path / "t.txt", Trajectory(good.timestamps, T_wc))
    assert not list(tmp_path.iterdir())


def test_arrays_are_read_only() -> None:
    """A change through `positions` moved the poses, behind an equal hash."""
    given = made_up(4)
    stamps, T_wc = np.arange(4.0), given.T_wc.copy()
    lost, indices = np.zeros(4, bool), np.arange(4)
    trajectory = Trajectory(stamps, T_wc, lost, indices)
    for array in (
        *(trajectory.timestamps, trajectory.T_wc, trajectory.lost, trajectory.indices),
        trajectory.positions,
        trajectory.select(slice(1, 3)).T_wc,
        trajectory.shifted(1.0).T_wc,
        Trajectory(stamps, T_wc).lost,
        Trajectory(stamps, T_wc).indices,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    for array in (stamps, T_wc, lost, indices):
        array[0] = 1  # what was given is the caller's own
    assert trajectory.timestamps[0] == 0
    np.testing.assert_array_equal(trajectory.T_wc, given.T_wc)
    trajectory.T_cw[0] = 0  # made for whoever asks
    np.testing.assert_array_equal(trajectory.T_wc, given.T_wc)


@pytest.mark.parametrize(
    "indices",
    [[0.7, 1.7], [0.0, np.nan], [0.0, np.inf], [0.0, 1e300], ["a", "b"], [True, False], [[0, 1]]],
)
def test_indices_are_whole_numbers(indices: object) -> None:
    two = made_up(2)
    with pytest.raises(DatasetError, match=r"^indices .*; (give|leave)"):
        Trajectory(two.timestamps, two.T_wc, indices=indices)  # type: ignore[arg-type]


def test_indices_as_columns_of_tables_have_them() -> None:
    two = made_up(2)
    for indices in ([0.0, 7.0], np.array([0, 7], np.uint8), (0, 7)):
        taken = Trajectory(two.timestamps, two.T_wc, indices=indices)  # type: ignore[arg-type]
        assert taken.indices.tolist() == [0, 7]
    large = [2**53 + 1, 2**62]
    taken = Trajectory(two.timestamps, two.T_wc, indices=np.array(large))
    assert taken.indices.tolist() == large


@pytest.mark.parametrize("time", [np.nan, np.inf])
def test_a_time_that_is_not_finite_is_refused(time: float) -> None:
    T_wc = np.repeat(np.eye(4)[None], 3, axis=0)
    with pytest.raises(DatasetError, match="timestamps holds a number that is not finite"):
        Trajectory(np.array([0.0, time, 2.0]), T_wc)
    with pytest.raises(DatasetError, match="the second time stamps holds a number that is not"):
        associate(np.arange(3.0), np.array([0.0, time]))
