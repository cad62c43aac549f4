# SPDX-License-Identifier: BSD-3-Clause
"""Runs that write a video and a recording."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orbslam2py import Sensor
from support.command_line import CommandLine, Results
from support.files import names_in
from support.small_sequences import sequence
from support.videos import read_video

pytestmark = pytest.mark.watchdog(90)

N = 14


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequence(Sensor.RGBD, N).write(tmp_path_factory.mktemp("sequences") / "rgbd")


@pytest.fixture
def rgbd(original: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(original, tmp_path / "lap"))


def test_a_deterministic_run_with_video_and_recording_gives_the_same_bytes(
    command: CommandLine, rgbd: Path
) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    arguments = ("--sensor", "rgbd", "--deterministic", "--quiet")
    assert command("run", rgbd, *arguments, "--output", "plain").code == 0
    files = ("--video", "a.mp4", "--record", "a.rrd")
    done = command("run", rgbd, *arguments, "--output", "watched", *files)
    assert done.code == 0, done.err
    for name in (
        "trajectory.txt",
        "trajectory_online.txt",
        "keyframes.txt",
        "trajectory_kitti.txt",
        "points.ply",
    ):
        plain, watched = (Path(folder, name).read_bytes() for folder in ("plain", "watched"))
        assert plain == watched, name
    assert len(read_video(Path("a.mp4"))[0]) == N
    assert Path("a.rrd").stat().st_size > 10_000


def test_the_run_says_where_they_are(command: CommandLine, rgbd: Path) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--video", "my video.webm")
    assert done.code == 0, done.err
    assert "The video is my video.webm" in done.out
    pictures, rate = read_video(Path("my video.webm"))
    assert len(pictures) == N
    assert rate == pytest.approx(1 / 0.05, rel=0.01)


def test_an_image_that_cannot_be_read_has_its_picture(command: CommandLine, rgbd: Path) -> None:
    sorted((rgbd / "rgb").iterdir())[6].write_bytes(b"")
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--video", "a.mp4")
    assert done.code == 0, done.err
    assert Results(Path("r")).report["skipped_frames"] == 1
    assert len(read_video(Path("a.mp4"))[0]) == N


def test_the_demo_has_a_video(command: CommandLine) -> None:
    done = command("demo", "--frames", "10", "--output", "r", "--video", "a.mp4", "--quiet")
    assert done.code == 0, done.err
    assert len(read_video(Path("a.mp4"))[0]) == 10


def test_real_time_has_a_video_as_long_as_the_run(command: CommandLine, rgbd: Path) -> None:
    arguments = ("--sensor", "rgbd", "--realtime", "--output", "r", "--video", "a.mp4")
    assert command("run", rgbd, *arguments).code == 0
    seen = [row for row in Results(Path("r")).frames if row["state"] != "DROPPED"]
    last = round(20 * (float(seen[-1]["timestamp"]) - float(seen[0]["timestamp"]))) + 1
    assert abs(len(read_video(Path("a.mp4"))[0]) - last) <= 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--video", "a.gif"), "a.gif does not end like a video; name it with .mp4"),
        (("--video", "none/a.mp4"), "there is no folder none for a.mp4; make it first"),
        (("--record", "a.rdd"), "a.rdd does not end like a recording; name it with .rrd"),
        (("--video", "a.mp4", "--record", "none/a.rrd"), "there is no folder none for a.rrd"),
    ],
)
def test_what_cannot_be_written_is_refused_before_the_run(
    command: CommandLine, rgbd: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", *arguments)
    assert done.code == 2
    assert done.err.count("\n") == 1
    assert words in done.err
    assert names_in(Path()) == ["lap"], "neither results nor a part of a video"


def test_a_run_that_is_refused_leaves_no_video(command: CommandLine, rgbd: Path) -> None:
    Path("r").mkdir()
    Path("r/mine").write_text("")
    done = command("run", rgbd, "--sensor", "rgbd", "--output", "r", "--video", "a.mp4")
    assert done.code == 2
    assert names_in(Path()) == ["lap", "r"]
