# SPDX-License-Identifier: BSD-3-Clause
"""Map files that cannot be used, and options about maps that contradict each other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py.cli.run_arguments import read_initial_pose
from support.command_line import CommandLine
from support.saved_maps import edit, written

pytestmark = pytest.mark.watchdog(60)


def _refused(command: CommandLine, *arguments: object, message: str) -> None:
    done = command("run", *arguments, "--output", "results")
    assert done.code == 2, done.out
    assert message in " ".join(done.err.split())
    for word in ("Errno", "Traceback", "MapFileError", "sqlite3"):
        assert word not in done.err
    assert not Path("results").exists()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("missing.orbmap", None, "there is no map file missing.orbmap; check the name"),
        ("empty.orbmap", b"", "empty.orbmap is empty"),
        (
            "text.orbmap",
            b"Camera.fx: 500\n" * 20,
            "is not a map file; give a file that 'orbslam2py run --save'",
        ),
    ],
)
def test_files_that_are_no_maps(
    command: CommandLine, rgbd: Path, name: str, content: bytes | None, message: str
) -> None:
    if content is not None:
        Path(name).write_bytes(content)
    _refused(command, rgbd, "--load", name, message=message)


def test_a_damaged_map(command: CommandLine, rgbd: Path, tmp_path: Path) -> None:
    path = written(tmp_path)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    _refused(command, rgbd, "--load", path, message="use a copy of the file")


def test_a_map_of_a_later_program(command: CommandLine, rgbd: Path, tmp_path: Path) -> None:
    path = edit(written(tmp_path), "PRAGMA user_version = 9")
    _refused(command, rgbd, "--load", path, message="update orbslam2py")


def test_a_map_of_another_sensor(command: CommandLine, rgbd: Path, tmp_path: Path) -> None:
    path = written(tmp_path)
    _refused(
        command, rgbd, "--sensor", "mono", "--load", path, message="was made for sensor 'rgbd'"
    )


def test_a_map_of_another_camera(command: CommandLine, rgbd: Path, tmp_path: Path) -> None:
    path = written(tmp_path)
    options = ("--sensor", "rgbd", "--settings", "tum1", "--load", path)
    _refused(command, rgbd, *options, message="another camera: Camera.fx is 517.306408")
    _refused(command, rgbd, *options, message="allow another setup (--allow-other-setup")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--localize"], "--localize needs a map from the beginning: load one with --load"),
        (["--initial-pose", "0,0,0"], "--initial-pose says where in a map"),
        (["--allow-other-setup"], "--allow-other-setup is about a map that is loaded: --load"),
        (["--save-images"], "--save-images keeps images in the map that is saved: --save FILE"),
        (["--no-save-patches"], "--no-save-patches leaves patches out of the map that is saved"),
        (["--autosave", "5"], "--autosave needs the file to save to: --save FILE"),
        (["--save", "a.orbmap", "--autosave", "0"], "--autosave must be more than 0 seconds"),
        (["--save", "nowhere/a.orbmap"], "cannot write nowhere/a.orbmap"),
        (["--save", "."], "it is a folder; give the name of a file"),
        (["--load", "M", "--initial-pose", "1,2"], "--initial-pose 1,2 is not a pose"),
        (["--load", "M", "--initial-pose", "1,2,here"], "is not a pose"),
        (["--load", "M", "--initial-pose", "1,2,3,0,0,0,0"], "is not a pose"),
        (
            ["--load", "M", "--initial-pose", "1e300,0,0"],
            "--initial-pose 1e300,0,0 is too far away to be meant; give a position",
        ),
    ],
)
def test_options_that_make_no_sense(
    command: CommandLine, rgbd: Path, tmp_path: Path, options: list[str], message: str
) -> None:
    arguments = [str(written(tmp_path)) if option == "M" else option for option in options]
    _refused(command, rgbd, *arguments, message=message)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", ["1e300", "1", "1e-300"])
def test_quaternions_of_any_size_are_taken(size: str) -> None:
    T_wc = read_initial_pose(f"1,2,3,0,0,{size},{size}")
    quarter = [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]
    np.testing.assert_allclose(T_wc, quarter, atol=1e-12)


def test_the_sequence_is_refused_before_the_map_is_touched(
    command: CommandLine, tmp_path: Path
) -> None:
    path = written(tmp_path)
    before = path.read_bytes()
    done = command("run", "nothing_here", "--load", path, "--save", path, "--output", "results")
    assert done.code == 2
    assert path.read_bytes() == before
