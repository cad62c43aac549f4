# SPDX-License-Identifier: BSD-3-Clause
"""Files that are no trajectory, and options of ``evaluate`` that do not fit them."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py.trajectory import write_kitti, write_tum
from support.command_line import CommandLine
from support.made_up_paths import wander

N = 20
GOOD = "1.5,1,2,3,0,0,0,1\n"
COLUMNS = "timestamp x y z qx qy qz qw"


@pytest.fixture(autouse=True)
def _files(tmp_path: Path) -> None:
    truth = wander(N)
    write_tum(tmp_path / "b.txt", truth)
    write_kitti(tmp_path / "rows.txt", truth)
    folder = tmp_path / "09"
    (folder / "image_0").mkdir(parents=True)
    (folder / "times.txt").write_text("".join(f"{t}\n" for t in truth.timestamps))
    write_kitti(folder / "poses.txt", truth)


@pytest.mark.parametrize(
    ("text", "thing", "remedy"),
    [
        ("1,2,3,4,5\n", "a.txt:1: 5 fields ('1 2 3 4 5'), too few", COLUMNS),
        ("1 2 3 4 5 6 7 8 9\n", "a.txt:1: 9 fields ('1 2 3 4 5 6 7 8 9')", COLUMNS),
        ("1 2 3 0 0 0 1\n", "a.txt:1: 7 fields ('1 2 3 0 0 0 1')", COLUMNS),
        ("x,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n", "a.txt:1: the head ('x y z qx", COLUMNS),
        ("t,x,y,z,r,p,h,o\n" + GOOD, "a.txt:1: the head ('t x y z r p h o')", COLUMNS),
        (GOOD + "2,1,2,,0,0,0,1\n", "a.txt:2: '' is not a number", "correct it"),
        (GOOD + GOOD.strip() + "," + GOOD, "a.txt:2: expected 8 numbers, found 16", "leave out"),
        (GOOD + "2,1,2\n", "a.txt:2: expected 8 numbers, found 3 fields", "leave out the line"),
        (GOOD + "2;1;2;3;0;0;0;1\n", "a.txt:2: expected 8 numbers, found 1 fields", "leave out"),
        (GOOD + "2,1,2,3,0,0,one,1\n", "a.txt:2: 'one' is not a number", "correct it"),
        (GOOD + "2,1,inf,3,0,0,0,1\n", "a.txt:2: inf is not finite", "leave out the line"),
        (GOOD + "2,1,2,3,0,0,0,0\n", "a.txt: the quaternion of pose 1 is zero", "qx qy qz qw"),
        (COLUMNS + "\n", f"a.txt:1: 8 fields ('{COLUMNS}'), no row of numbers", "12 (KITTI)"),
        ("# " + COLUMNS + "\n", "a.txt holds no poses", "give a file with one per line"),
        ("VERTEX_SE3:QUAT 0 1 2 3 0 0 0 1\n", "a.txt:1: 9 fields ('VERTEX_SE3", COLUMNS),
        ("1 1 0 0 0 5 6 7 1 a.png\n12 13 5\n", "a.txt:1: 10 fields ('1 1 0 0", COLUMNS),
        ('{\n  "frames": [\n', "a.txt:1: 1 fields ('{'), no row of numbers", COLUMNS),
        ("?PNG\nIHDR?\n", "a.txt:1: 1 fields ('?PNG'), no row of numbers", COLUMNS),
        ("1 " * 13, "a.txt:1: 13 fields ('1 1 1", COLUMNS),
        ("2 0 0 0 0 2 0 0 0 0 2 0\n", "a.txt: not all poses hold rotations", "rows of T_wc"),
    ],
)
def test_no_trajectory(command: CommandLine, text: str, thing: str, remedy: str) -> None:
    Path("a.txt").write_text(text)
    for arguments in (("a.txt", "b.txt"), ("b.txt", "a.txt")):
        done = command("evaluate", *arguments, "--json", "figures.json")
        assert done.code == 2, done.out
        assert thing in done.err
        assert remedy in done.err
        assert len(done.err.splitlines()) == 1
        assert not Path("figures.json").exists()
    assert Path("a.txt").read_text() == text


@pytest.mark.parametrize(
    ("arguments", "thing", "remedy"),
    [
        ("rows.txt rows.txt --quaternions wxyz", "rows.txt holds matrices, no quat", "leave out"),
        ("b.txt rows.txt --truth-quaternions wxyz", "rows.txt holds matrices", "leave out"),
        ("b.txt 09 --truth-quaternions xyzw", "09 is a sequence", "leave out --truth-quaternions"),
        ("b.txt 09 --truth-inverse", "09 is a sequence", "--truth-inverse"),
        ("b.txt b.txt --quaternions zyxw", "'--quaternions'", "is not one of 'xyzw', 'wxyz'"),
        ("b.txt b.txt --inverse yes", "unexpected extra argument", "evaluate -h"),
        ("b.txt b.txt --format euroc", "is not a time in ns", "name another format"),
        ("b.txt b.txt --format kitti", "b.txt:1: expected 12 numbers, found 8", "upper three rows"),
    ],
)
def test_options_that_do_not_fit(
    command: CommandLine, arguments: str, thing: str, remedy: str
) -> None:
    done = command("evaluate", *arguments.split(), "--json", "figures.json")
    assert done.code == 2, done.out
    told = " ".join(done.err.replace("│", " ").split())
    assert thing in told
    assert remedy in told
    assert not Path("figures.json").exists()


def test_clocks_that_differ_in_more_than_the_unit(command: CommandLine) -> None:
    later = wander(N).shifted(5000)
    Path("ms.txt").write_text(
        "".join(f"{t * 1000:.3f} {k} 0 0 0 0 0 1\n" for k, t in enumerate(later.timestamps))
    )
    done = command("evaluate", "ms.txt", "b.txt")
    assert done.code == 2
    assert "no time stamps of estimate" in done.err
    assert "--offset" in done.err
