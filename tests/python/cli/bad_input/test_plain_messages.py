# SPDX-License-Identifier: BSD-3-Clause
"""Messages are for people: no numbers of errors, no names of classes, nothing said twice."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orbslam2py._files import describe_error
from support.command_line import CommandLine

pytestmark = pytest.mark.watchdog(30)

SMALL = ("--frames", 2, "--size", "64x64")


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("synthesize", "/proc/none/world", *SMALL), "/proc/none"),
        (("synthesize", "w", "--world", "nowhere"), "--world"),
        (("synthesize", "w", "--sensor", "lidar"), "--sensor"),
        (("run", "w", "--sensor", "lidar"), "--sensor"),
        (("evaluate", "est.txt", "est.txt", "--json", "none/figures.json"), "none/figures.json"),
        (("evaluate", "est.txt", "est.txt", "--json", "."), "."),
        (("evaluate", "est.txt", "est.txt", "--alignment", "so3"), "--alignment"),
        (("evaluate", "missing.txt", "est.txt"), "missing.txt"),
        (("evaluate", "est.txt", "a" * 300), "aaa"),
        (("vocabulary", "convert", "missing.txt", "out.bvoc"), "missing.txt"),
    ],
)
def test_what_does_not_show_through(
    command: CommandLine, arguments: tuple[object, ...], named: str
) -> None:
    Path("est.txt").write_text("0.0 0 0 0 0 0 0 1\n0.1 1 0 0 0 0 0 1\n0.2 1 1 0 0 0 0 1\n")
    done = command(*arguments)
    assert done.code == 2, done.err
    assert named in done.err
    for word in ("Errno", "Value error", "ValueError", "Traceback", "OSError"):
        assert word not in done.err
    assert done.err.count("cannot write") <= 1


@pytest.mark.parametrize(
    "line", [("run",), ("synthesize",), ("evaluate",), ("evaluate", "est.txt"), ("map", "info")]
)
def test_what_is_missing_is_named(command: CommandLine, line: tuple[str, ...]) -> None:
    done = command(*line)
    assert done.code == 2, done.err
    assert "Missing argument" in done.err
    assert "Traceback" not in done.err


@pytest.mark.parametrize("option", [("--format", "ply"), ("--format=ply",)])
def test_the_format_of_an_export_comes_first(command: CommandLine, option: tuple[str, ...]) -> None:
    done = command("map", "export", "office.orbmap", "office.ply", *option)
    assert done.code == 2, done.err
    assert "the format comes first: orbslam2py map export ply FILE OUTPUT" in done.err


@pytest.mark.parametrize(
    ("name", "thing", "remedy"),
    [
        ("phone.yaml", "is a settings file", "give it with --settings; the sequence comes first"),
        ("phone.YML", "is a settings file", "give it with --settings; the sequence comes first"),
        ("office.orbmap", "is a map file", "give it with --load; the sequence comes first"),
        (
            "list.txt",
            "is neither a video, nor a bag, nor a folder, nor a camera",
            "the folder of a sequence",
        ),
        (
            "noise.bin",
            "is neither a video, nor a bag, nor a folder, nor a camera",
            "the folder of a sequence",
        ),
        ("noise.mp4", "is no video that can be read", "convert it"),
    ],
)
def test_files_that_are_no_sequence(
    command: CommandLine, name: str, thing: str, remedy: str
) -> None:
    Path(name).write_text("Camera.fx: 500\n" * 90)
    done = command("run", name, "--sensor", "rgbd", "--settings", "tum1")
    assert done.code == 2, done.err
    assert done.err.startswith(f"Error: {name} {thing}")
    assert remedy in done.err


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (FileNotFoundError(2, "No such file or directory", "x"), "x: No such file or directory"),
        (OSError(28, "cannot write x: No space left", "x"), "cannot write x: No space left"),
        (OSError("the camera is gone"), "the camera is gone"),
        (RuntimeError("out of order"), "out of order"),
        (RuntimeError(), "RuntimeError"),
    ],
)
def test_errors_in_words(error: Exception, text: str) -> None:
    assert describe_error(error) == text


def test_libraries_say_nothing_of_broken_videos(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film.write_bytes(b"\0\0\0\x18ftypmp42\0\0\0\0mp42isom" + bytes(1000))
    told = {name: value for name, value in os.environ.items() if name != "OPENCV_FFMPEG_LOGLEVEL"}
    command = [sys.executable, "-m", "orbslam2py", "run", str(film), "--settings", "tum1"]
    done = subprocess.run(
        [*command, "--sensor", "mono"], env=told, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert "film.mp4 is no video that can be read" in line
