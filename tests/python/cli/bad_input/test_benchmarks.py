# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py benchmark``: what it prints, and inputs that it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.command_line import CommandLine
from support.standard_sets import make_root


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_root(tmp_path_factory.mktemp("data"), "tum", frames=4)


def test_command(command: CommandLine, root: Path) -> None:
    arguments = ("benchmark", "tum", root, "--sensor", "rgbd", "--seeds", "2", "--workers", "0")
    done = command(*arguments, "--max-frames", "3")
    assert done.code == 0, done.err
    assert "TUM RGB-D: 2 runs" in done.out
    for text in ("orbslam2py", "ORB-SLAM2", "ATE [m]", "0.016"):  # whole, on 80 columns
        assert text in done.out
    folder = Path("runs/benchmark-tum")
    page = (folder / "benchmark.html").read_text()
    assert "orbslam2py benchmark tum" in page
    assert str(folder / "benchmark.md") in done.out.replace("\n", "")
    again = command(*arguments)
    assert again.code == 2
    assert "continue with --resume" in " ".join(again.err.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("tum", "nowhere"), "nowhere does not exist; give the folder that holds the sequences"),
        (("tum", "notes.txt"), "notes.txt is no folder; give the folder"),
        (("kitti", "empty"), "empty holds no sequence of KITTI odometry: looked 5 folders deep"),
        (("kitti", "ROOT"), "but of TUM RGB-D: orbslam2py benchmark tum"),
        (("tum", "ROOT", "--sensor", "stereo"), "has images for stereo; choose another --sensor"),
        (("coco", "ROOT"), "'coco' is not one of"),
        (("tum", "ROOT", "--seeds", "0"), "greater than or equal to 1"),
        (
            ("tum", "ROOT", "--memory-limit", "1kB"),
            "(--memory-limit) is '1kB'; give one such as 4GB",
        ),
        (
            ("tum", "nowhere", "--memory-limit", "4GB", "--workers", "0"),
            "--memory-limit 4GB has no meaning with --workers 0",
        ),
        (("tum", "ROOT", "--scheduler", "foo"), "the scheduler (--scheduler) is 'foo'; give an"),
    ],
)
def test_bad_input(
    command: CommandLine, root: Path, arguments: tuple[str, ...], message: str
) -> None:
    Path("empty").mkdir()
    Path("notes.txt").write_text("mine\n")
    done = command("benchmark", *(str(root) if one == "ROOT" else one for one in arguments))
    assert done.code == 2
    assert message in " ".join(done.err.replace("\u2502", " ").split())
    for noise in ("Traceback", "Errno", "Error("):
        assert noise not in done.err
    assert not Path("runs").exists()
