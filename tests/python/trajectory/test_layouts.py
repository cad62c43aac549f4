# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories as other programs write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Trajectory
from orbslam2py.trajectory import (
    TRAJECTORY_LAYOUTS,
    QuaternionOrder,
    TimeUnit,
    TrajectoryFile,
    TrajectoryFormat,
    TrajectoryLayout,
    read_euroc,
    read_kitti,
    read_trajectory,
    read_trajectory_file,
    read_tum,
    unit_by_other,
)
from support.made_up_paths import wander

QUARTER = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
N = 30
PATH = wander(N)
XYZW = PATH.quaternions
START = 1_700_000_000


def rows(
    separator: str = " ",
    order: str = "xyzw",
    unit: str = "s",
    before: str = "",
    after: str = "",
    start: int = START,
) -> str:
    """The lines of `PATH`, 20 poses a second from a time on."""
    lines = []
    q = XYZW if order == "xyzw" else XYZW[:, [3, 0, 1, 2]]
    for k in range(N):
        ns = start * 10**9 + k * 50_000_000
        time = {"s": f"{ns / 1e9:.6f}", "ms": ns // 10**6, "us": ns // 1000, "ns": ns}[unit]
        numbers = [f"{value:.9f}" for value in (*PATH.positions[k], *q[k])]
        lines.append(before + separator.join([str(time), *numbers]) + after)
    return "\n".join(lines) + "\n"


def read(tmp_path: Path, text: str, **options: object) -> TrajectoryFile:
    (tmp_path / "a.txt").write_text(text)
    return read_trajectory_file(tmp_path / "a.txt", **options)  # type: ignore[arg-type]


def expect_path(path: Trajectory, start: int = START) -> None:
    np.testing.assert_allclose(path.timestamps, start + 0.05 * np.arange(N), atol=1e-6, rtol=0)
    np.testing.assert_allclose(path.T_wc, PATH.T_wc, atol=1e-8)


# ---- the registry --------------------------------------------------------------------------------
@pytest.mark.parametrize("layout", TRAJECTORY_LAYOUTS, ids=lambda layout: layout.name)
def test_examples_are_read(tmp_path: Path, layout: TrajectoryLayout) -> None:
    done = read(tmp_path, layout.example)
    np.testing.assert_allclose(done.trajectory.T_wc, QUARTER[None], atol=1e-7)
    timed = layout.file_format is not TrajectoryFormat.KITTI
    assert done.trajectory.timestamps.tolist() == [1700000000.25 if timed else 0.0]
    assert done.file_format is layout.file_format
    assert layout.description.endswith(".")
    assert layout.written_by


# ---- separators, heads, columns ------------------------------------------------------------------
@pytest.mark.parametrize("separator", [" ", "\t", ",", ", ", ";", "; ", "  "])
@pytest.mark.parametrize("end", ["", "separator"])
def test_separators(tmp_path: Path, separator: str, end: str) -> None:
    expect_path(read(tmp_path, rows(separator, after=separator if end else "")).trajectory)


@pytest.mark.parametrize("separator", [";", " ", "\t"])
def test_comma_as_decimal_sign(tmp_path: Path, separator: str) -> None:
    expect_path(read(tmp_path, rows(separator).replace(".", ",")).trajectory)


@pytest.mark.parametrize(
    ("head", "order", "separator"),
    [
        ("timestamp tx ty tz qx qy qz qw", "xyzw", " "),
        ("# timestamp(s) tx ty tz qx qy qz qw", "xyzw", " "),
        ("#time,px,py,pz,qw,qx,qy,qz", "wxyz", ","),
        ('"t";"x [m]";"y [m]";"z [m]";"q_x";"q_y";"q_z";"q_w"', "xyzw", ";"),
        ("# written by hand\n%time,position.x,position.y,position.z,q.w,q.x,q.y,q.z", "wxyz", ","),
        ("Time,pos_x,pos_y,pos_z,quat_w,quat_x,quat_y,quat_z", "wxyz", ","),
        ("// a comment\n# timestamp x y z qw qx qy qz", "wxyz", " "),
        ("stamp,t_x,t_y,t_z,rotation.x,rotation.y,rotation.z,rotation.w", "xyzw", ","),
    ],
)
def test_heads_tell_the_order(tmp_path: Path, head: str, order: str, separator: str) -> None:
    done = read(tmp_path, f"{head}\n{rows(separator, order)}")
    expect_path(done.trajectory)
    assert done.reading.order_is_known
    assert str(done.reading.quaternions) == order


def test_a_head_in_any_order(tmp_path: Path) -> None:
    lines = [f"{t:.2f},{q[2]},{q[0]},{q[3]},{q[1]},{p[2]},{p[1]},{p[0]}"
             for t, p, q in zip(PATH.timestamps, PATH.positions, XYZW, strict=True)]  # fmt: skip
    text = "time,qz,qx,qw,qy,z,y,x\n" + "\n".join(lines)
    done = read(tmp_path, text)
    np.testing.assert_allclose(done.trajectory.T_wc, PATH.T_wc, atol=1e-8)
    assert done.reading.notes == (
        "poses in the columns 1, 2, 3, 4, 5, 6, 7, 8, w last (as its head says)",
    )


@pytest.mark.parametrize(
    ("before", "after"),
    [("", " 7"), ("3 ", ""), ("", " 0.001 0.002 0.003"), ("cam0 ", ""), ("", " frame.png")],
)
def test_further_columns(tmp_path: Path, before: str, after: str) -> None:
    text = rows(before=before, after=after)
    if before == "cam0 ":
        text = "camera time x y z qx qy qz qw\n" + text
    expect_path(read(tmp_path, text).trajectory)


def test_a_number_behind_the_time(tmp_path: Path) -> None:
    lines = [line.split(" ", 1) for line in rows().splitlines()]
    text = "\n".join(f"{time} {k} {rest}" for k, (time, rest) in enumerate(lines))
    done = read(tmp_path, text)
    expect_path(done.trajectory)
    assert done.reading.notes == (
        "poses in the columns 1, 3, 4, 5, 6, 7, 8, 9, w last (recognised by their values)",
    )


def test_topic_as_ros_prints_it(tmp_path: Path) -> None:
    """Two times, of the message and of its head: that of the head is when the pose was."""
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id," + ",".join(
        [f"field.pose.position.{axis}" for axis in "xyz"]
        + [f"field.pose.orientation.{axis}" for axis in "xyzw"]
    )
    lines = []
    for k, line in enumerate(rows(",", unit="ns").splitlines()):
        stamp, rest = line.split(",", 1)
        lines.append(f"{int(stamp) + 7_000_000},{k},{stamp},map,{rest}")
    expect_path(read(tmp_path, head + "\n" + "\n".join(lines)).trajectory)


def test_further_columns_of_a_head_may_be_empty(tmp_path: Path) -> None:
    text = rows(",")
    first, _, rest = text.partition("\n")
    head = "time,x,y,z,qx,qy,qz,qw,note"
    expect_path(read(tmp_path, f"{head}\n{first},begin\n{rest}").trajectory)


# ---- time ----------------------------------------------------------------------------------------
@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("separator", [" ", ";"])
def test_units_since_1970(tmp_path: Path, unit: str, separator: str) -> None:
    done = read(tmp_path, rows(separator, unit=unit))
    expect_path(done.trajectory)
    assert done.reading.unit is TimeUnit(unit)
    assert done.reading.notes == (() if unit == "s" else (f"times in {unit}",))
    assert done.file_format is TrajectoryFormat.TUM


@pytest.mark.parametrize("start", [0, 1000, 1_500_000])
def test_nanoseconds_since_the_computer_started(tmp_path: Path, start: int) -> None:
    expect_path(read(tmp_path, rows(unit="ns", start=start)).trajectory, start)


def test_the_unit_in_a_head(tmp_path: Path) -> None:
    head = "time [ms],x,y,z,qx,qy,qz,qw\n"
    done = read(tmp_path, head + rows(",", unit="ms", start=20))
    expect_path(done.trajectory, 20)
    copied = read(tmp_path, head.replace("ms", "ns") + rows(","))
    expect_path(copied.trajectory)  # the head is another file's: the times are seconds since 1970


@pytest.mark.parametrize(("unit", "factor"), [("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_the_unit_by_the_other_file(unit: str, factor: float) -> None:
    times = 5 + 0.05 * np.arange(100)
    assert unit_by_other(times * factor, TimeUnit.SECONDS, times + 0.3) is TimeUnit(unit)
    assert unit_by_other(times, TimeUnit.SECONDS, times * factor) is TimeUnit.SECONDS
    assert unit_by_other(times / factor, TimeUnit(unit), times) is TimeUnit.SECONDS


def test_a_unit_is_not_changed_without_need() -> None:
    short, day = 0.05 * np.arange(100), np.arange(0, 86400, 0.1)
    for times, other in ((short, day), (day, short), (short, short + 1e9), (short + 1e9, short)):
        assert unit_by_other(times, TimeUnit.SECONDS, other) is TimeUnit.SECONDS
    sparse = np.arange(0, 3000, 30.0)
    assert unit_by_other(sparse, TimeUnit.SECONDS, day) is TimeUnit.SECONDS


# ---- conventions that are told -------------------------------------------------------------------
def test_order_that_is_given(tmp_path: Path) -> None:
    expect_path(read(tmp_path, rows(order="wxyz"), quaternions="wxyz").trajectory)
    expect_path(read(tmp_path, rows(",", unit="ns"), quaternions="xyzw").trajectory)
    wrong_head = "time x y z qx qy qz qw\n" + rows(order="wxyz")
    expect_path(read(tmp_path, wrong_head, quaternions=QuaternionOrder.WXYZ).trajectory)


def test_inverse_poses(tmp_path: Path) -> None:
    np.testing.assert_allclose(
        read(tmp_path, rows(), inverse=True).trajectory.T_wc, np.linalg.inv(PATH.T_wc), atol=1e-8
    )
    matrix = " ".join(str(value) for value in QUARTER[:3].ravel())
    done = read(tmp_path, matrix, inverse=True)
    np.testing.assert_allclose(done.trajectory.T_wc[0], np.linalg.inv(QUARTER), atol=1e-12)
    assert done.reading.inverse
    trajectory, _ = read_trajectory(tmp_path / "a.txt", inverse=True)
    np.testing.assert_array_equal(trajectory.T_wc, done.trajectory.T_wc)


def test_readers_of_one_format(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(rows(",", unit="ns"))
    expect_path(read_tum(path))
    path.write_text(rows(" ", "wxyz", "ns"))
    expect_path(read_euroc(path))
    path.write_text(" ".join(str(value) for value in QUARTER.ravel()))
    np.testing.assert_allclose(read_kitti(path).T_wc[0], QUARTER, atol=1e-12)


# ---- files that are none -------------------------------------------------------------------------
GOOD = "1.5,1,2,3,0,0,0,1\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1,2,3,4,5\n", ":1: 5 fields ('1 2 3 4 5'), too few"),
        ("1 2 3 4 5 6 7 8 9\n", ":1: 9 fields ('1 2 3 4 5 6 7 8 9'), no time, position"),
        ("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n", ":1: the head ('x y z qx qy qz qw') does not name"),
        ("t,x,y,z,a,b,c,d\n" + GOOD, ":1: the head ('t x y z a b c d') does not name"),
        (GOOD + "2,1,2,,0,0,0,1\n", ":2: '' is not a number"),
        (GOOD + GOOD.strip() + "," + GOOD, ":2: expected 8 numbers, found 16 fields"),
        (GOOD + "2,1,2\n", ":2: expected 8 numbers, found 3 fields"),
        (GOOD + "2,1,2,3,0,0,zero,1\n", ":2: 'zero' is not a number"),
        (GOOD + "2,1,nan,3,0,0,0,1\n", ":2: nan is not finite"),
        (GOOD + "2,1,2,3,0,0,0,0\n", "the quaternion of pose 1 is zero"),
        ("time,x,y,z,qx,qy,qz,qw\n", ":1: 8 fields ('time x y z qx qy qz qw'), no row of numbers"),
        ("VERTEX_SE3:QUAT 0 1 2 3 0 0 0 1\n", ":1: 9 fields ('VERTEX_SE3:QUAT 0 1 2 3"),
        ("1 1 0 0 0 5 6 7 1 a.png\n12 13 5\n", ":1: 10 fields ('1 1 0 0 0 5 6 7 1 a.png')"),
        ('{\n  "frames": [\n', ":1: 1 fields ('{'), no row of numbers"),
        ("1 " * 13, ":1: 13 fields"),
        ("2 0 0 0 0 1 0 0 0 0 1 0\n", "not all poses hold rotations"),
    ],
)
def test_what_is_no_trajectory(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(DatasetError) as caught:
        read(tmp_path, text)
    assert f"a.txt{expected}" in str(caught.value).replace("a.txt: ", "a.txt")
    assert ";" in str(caught.value), "and what to do"


def test_options_that_do_not_fit(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="holds matrices, no quaternions"):
        read(tmp_path, "1 0 0 0 0 1 0 0 0 0 1 0\n", quaternions="wxyz")
    with pytest.raises(DatasetError, match="give one of xyzw, wxyz"):
        read(tmp_path, GOOD, quaternions="wzyx")
    with pytest.raises(DatasetError, match="not a time in ns; name another format"):
        read(tmp_path, GOOD, file_format="euroc")
