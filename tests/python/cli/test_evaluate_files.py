# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py evaluate`` on files of other programs, and on files in another convention."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import Trajectory
from orbslam2py.trajectory import write_kitti, write_tum
from support.command_line import CommandLine, Outcome
from support.made_up_paths import wander

N = 80
TRUTH = wander(N)


def noisy() -> Trajectory:
    """The same walk, a little off, in another world."""
    random = np.random.default_rng(1)
    T_wc = TRUTH.T_wc.copy()
    turns = Rotation.from_rotvec(random.normal(0, 2e-3, (N, 3))).as_matrix()
    T_wc[:, :3, :3] = T_wc[:, :3, :3] @ turns
    T_wc[:, :3, 3] += random.normal(0, 0.01, (N, 3))
    world = np.eye(4)
    world[:3, :3] = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
    world[:3, 3] = [3, -1, 2]
    return Trajectory(TRUTH.timestamps, world @ T_wc)


ESTIMATE = noisy()
NAMES = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")


def lines(
    path: Trajectory, separator: str = " ", order: str = "xyzw", per_second: float = 1
) -> str:
    q = path.quaternions if order == "xyzw" else path.quaternions[:, [3, 0, 1, 2]]
    return "".join(
        separator.join(
            [
                str(round(time * per_second)) if per_second > 1 else f"{time:.6f}",
                *(f"{value:.9f}" for value in (*path.positions[k], *q[k])),
            ]
        )
        + "\n"
        for k, time in enumerate(path.timestamps)
    )


def compared(command: CommandLine, *arguments: object) -> tuple[dict[str, Any], Outcome]:
    done = command("evaluate", *arguments, "--json", "figures.json", "--force")
    assert done.code == 0, done.err
    return json.loads(Path("figures.json").read_text()), done


@pytest.fixture
def right(command: CommandLine) -> dict[str, Any]:
    """The figures of plain files."""
    write_tum("truth.txt", TRUTH)
    write_tum("plain.txt", ESTIMATE)
    figures, done = compared(command, "plain.txt", "truth.txt")
    assert done.err == ""
    assert "Read:" not in done.out
    assert 0.005 < figures["ate_rmse_m"] < 0.03
    return figures


def expect_same(figures: dict[str, Any], right: dict[str, Any]) -> None:
    assert figures.keys() == right.keys()
    for key, value in right.items():
        expected = pytest.approx(value, rel=1e-4, abs=1e-6) if isinstance(value, float) else value
        assert figures[key] == expected, key


# ---- files of other programs ---------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "note"),
    [
        (lines(ESTIMATE, ","), ""),
        (lines(ESTIMATE, ";"), ""),
        (" ".join(NAMES) + "\n" + lines(ESTIMATE), ""),
        (lines(ESTIMATE, per_second=1e9), "times in ns, because these fit the times of the other"),
        (lines(ESTIMATE, per_second=1e6), "times in us, because these fit the times of the other"),
        (lines(ESTIMATE, per_second=1e3), "times in ms, because these fit the times of the other"),
        (
            lines(ESTIMATE, ",", "wxyz", 1e9).replace("\n", ",\n"),
            "times in ns and quaternions w first, as EuRoC and VINS write them",
        ),
        (
            ",".join(["num", *NAMES]) + "\n" + lines(ESTIMATE, ",").replace("100", "0,100", 1),
            "poses in the columns 2, 3, 4, 5, 6, 7, 8, 9, w last (as its head says)",
        ),
        (lines(ESTIMATE).replace("\n", " 7\n"), ""),
    ],
)
def test_any_file_gives_the_same_figures(
    command: CommandLine, right: dict[str, Any], text: str, note: str
) -> None:
    if text.startswith("num"):
        head, *rest = text.splitlines()
        text = "\n".join([head, *(f"{k},{row.removeprefix('0,')}" for k, row in enumerate(rest))])
    Path("other.txt").write_text(text)
    for arguments in (("other.txt", "truth.txt"), ("plain.txt", "other.txt")):
        figures, done = compared(command, *arguments)
        assert "look like" not in done.err
        if arguments[0] == "other.txt":
            expect_same(figures, right)
        else:
            assert figures["ate_rmse_m"] < 1e-6
        # What the digits say is not said twice.
        short = note.partition(", because")[0]
        assert (f"Read: other.txt: {short}" in done.out) == bool(note), done.out


def test_the_unit_of_the_truth(command: CommandLine, right: dict[str, Any]) -> None:
    Path("truth_ms.txt").write_text(lines(TRUTH, per_second=1e3))
    figures, done = compared(command, "plain.txt", "truth_ms.txt")
    expect_same(figures, right)
    assert (
        "Read: truth_ms.txt: times in ms, because these fit the times of the other file."
        in done.out
    )
    figures, _ = compared(command, "plain.txt", "truth_ms.txt", "--offset", "0.005")
    assert figures["time_difference_max_s"] == pytest.approx(0.005)


# ---- conventions ---------------------------------------------------------------------------------
def test_w_first_is_seen_and_can_be_told(command: CommandLine, right: dict[str, Any]) -> None:
    Path("w_first.txt").write_text(lines(ESTIMATE, order="wxyz"))
    figures, done = compared(command, "w_first.txt", "truth.txt")
    assert "the quaternions of the estimate look like w first: RPE" in done.err
    assert f"{right['rpe_rotation_rmse_deg']:.3g} deg instead of" in done.err
    assert "give --quaternions wxyz" in done.err
    assert figures["ate_rmse_m"] == pytest.approx(right["ate_rmse_m"], rel=1e-4)
    assert figures["rpe_rotation_rmse_deg"] > 3 * right["rpe_rotation_rmse_deg"], "as it was read"
    figures, done = compared(command, "w_first.txt", "truth.txt", "--quaternions", "wxyz")
    assert done.err == ""
    expect_same(figures, right)


def test_w_first_of_the_truth(command: CommandLine, right: dict[str, Any]) -> None:
    Path("truth_w.txt").write_text(lines(TRUTH, order="wxyz"))
    _, done = compared(command, "plain.txt", "truth_w.txt")
    assert "the quaternions of the truth look like w first" in done.err
    assert "give --truth-quaternions wxyz" in done.err
    figures, done = compared(command, "plain.txt", "truth_w.txt", "--truth-quaternions", "wxyz")
    assert done.err == ""
    expect_same(figures, right)


def test_commas_and_nanoseconds_with_w_last(command: CommandLine, right: dict[str, Any]) -> None:
    # Times since 1970: the digits tell that they are ns, and the rest is as in EuRoC's files.
    Path("a.csv").write_text(lines(ESTIMATE.shifted(1.7e9), ",", per_second=1e9))
    Path("b.txt").write_text(lines(TRUTH.shifted(1.7e9), per_second=1e9))
    _, done = compared(command, "a.csv", "b.txt")
    assert "the quaternions of the estimate look like w last" in done.err
    assert "give --quaternions xyzw" in done.err
    figures, done = compared(command, "a.csv", "b.txt", "--quaternions", "xyzw")
    assert done.err == ""
    assert figures["ate_rmse_m"] == pytest.approx(right["ate_rmse_m"], rel=1e-4)
    assert figures["rpe_rotation_rmse_deg"] == pytest.approx(
        right["rpe_rotation_rmse_deg"], rel=1e-3, abs=1e-6
    )


@pytest.mark.parametrize("kitti", [False, True])
def test_inverse_poses_are_seen_and_can_be_told(
    command: CommandLine, right: dict[str, Any], kitti: bool
) -> None:
    write = write_kitti if kitti else write_tum
    write("cw.txt", Trajectory(ESTIMATE.timestamps, ESTIMATE.T_cw))
    write("wc.txt", TRUTH)
    _, done = compared(command, "cw.txt", "wc.txt")
    assert "the poses of the estimate look like poses of the world in the camera: ATE" in done.err
    assert f"ATE {right['ate_rmse_m']:.3g} m instead of" in done.err
    assert "give --inverse" in done.err
    figures, done = compared(command, "cw.txt", "wc.txt", "--inverse")
    assert done.err == ""
    assert figures["ate_rmse_m"] == pytest.approx(right["ate_rmse_m"], rel=1e-4)


def test_an_option_too_many_is_seen(command: CommandLine, right: dict[str, Any]) -> None:
    _, done = compared(command, "plain.txt", "truth.txt", "--inverse")
    assert "leave out --inverse" in done.err
    write_tum("truth_cw.txt", Trajectory(TRUTH.timestamps, TRUTH.T_cw))
    figures, done = compared(command, "plain.txt", "truth_cw.txt", "--truth-inverse")
    assert done.err == ""
    expect_same(figures, right)
