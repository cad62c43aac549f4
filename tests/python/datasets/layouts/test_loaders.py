# SPDX-License-Identifier: BSD-3-Clause
"""A package adds a layout: found by its entry point, in Python and on the command line."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import orbslam2py as orb
from orbslam2py.datasets import open_input, open_sequence, recognise
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

MODULE = '''
from pathlib import Path

from orbslam2py.datasets import KittiSequence, RecordedSequence


class Robot(KittiSequence):
    """KITTI's files with a mark of one's own."""

    layout = "robot"

    @staticmethod
    def recognises(folder: Path) -> bool:
        return (folder / "robot.txt").is_file()


nothing = 3
'''


class Package:
    """A package as pip would leave it, on the path."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "my_robot.py").write_text(MODULE)
        self._information = folder / "my_robot-1.0.dist-info"
        self._information.mkdir()
        (self._information / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: my-robot\nVersion: 1.0\n"
        )
        self.name("robot", "my_robot:Robot")

    def name(self, name: str, target: str) -> None:
        text = f"[orbslam2py.sequences]\n{name} = {target}\n"
        (self._information / "entry_points.txt").write_text(text)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Package:
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.delitem(sys.modules, "my_robot", raising=False)
    return Package(folder)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    options = SyntheticOptions(world="corridor", sensor="stereo", frames=5, size=(320, 240))
    folder = SyntheticSequence(options).write(tmp_path / "drive", "kitti")
    (folder / "robot.txt").write_text("mine\n")
    return folder


def test_found(package: Package, drive: Path) -> None:
    assert recognise(drive) == "robot"
    for opened in (open_sequence(drive, "mono"), open_input(drive), orb.open_sequence(drive)):
        assert type(opened).__name__ == "Robot"
        assert opened.layout == "robot"
    assert str(open_sequence(drive, "mono").sensor) == "mono"
    assert open_sequence(drive, layout="kitti").layout == "kitti"
    (drive / "robot.txt").unlink()
    assert recognise(drive) == "kitti"
    assert open_sequence(drive, layout="robot").layout == "robot"


def test_on_the_command_line(package: Package, drive: Path, tmp_path: Path) -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv.pop(1)); from orbslam2py.cli import main; main()"
    )
    line = [sys.executable, "-c", code, str(package.folder), "run", str(drive)]
    more = ["--sensor", "stereo", "--output", str(tmp_path / "out"), "--quiet", "--no-report"]
    done = subprocess.run([*line, *more], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert '"layout": "robot"' in (tmp_path / "out" / "report.json").read_text()


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("my_robot:Absent", r"the loader 'robot' \(my_robot:Absent\) cannot be imported"),
        ("no_such_module:Robot", "cannot be imported: No module named 'no_such_module'; repair"),
        ("my_robot:nothing", "has no 'recognises', or cannot be called; repair"),
    ],
)
def test_loaders_that_are_none(package: Package, drive: Path, target: str, message: str) -> None:
    package.name("robot", target)
    with pytest.raises(orb.DatasetError, match=message):
        open_sequence(drive)
