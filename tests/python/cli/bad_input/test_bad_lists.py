# SPDX-License-Identifier: BSD-3-Clause
"""Lists of images that cannot be used, or not in part."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from support.command_line import CommandLine, Results
from support.spoilt_runs import BAD, N, expect_refused, expect_skipped, run

pytestmark = pytest.mark.watchdog(40)


def associations(folder: Path) -> list[list[str]]:
    """Read the pairs and see that only this list is used."""
    path = folder / "associations.txt"
    lines = [line.split() for line in path.read_text().splitlines() if not line.startswith("#")]
    assert len(lines) == N
    return lines


def associate(folder: Path, pairs: list[list[str]]) -> None:
    (folder / "associations.txt").write_text("".join(" ".join(pair) + "\n" for pair in pairs))


@pytest.mark.parametrize("steps", [0, -2])
def test_time_stamp_that_repeats_or_goes_back(command: CommandLine, rgbd: Path, steps: int) -> None:
    pairs = associations(rgbd)
    pairs[BAD][0] = pairs[BAD - 1 + steps][0]
    associate(rgbd, pairs)
    done = run(command, rgbd)
    assert done.code == 0
    assert "2 images have the time stamp of another one" in done.err
    assert ("they are sorted" in done.err) == (steps < 0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "lists none"),
        ("# nothing\n", "lists none"),
        ("0.0 rgb/0.png\n", "associations.txt:1"),
        ("zero rgb/0.png 0.0 depth/0.png\n", "associations.txt:1"),
        ("nan rgb/0.png 0.0 depth/0.png\n", "associations.txt:1"),
    ],
)
def test_malformed_list(command: CommandLine, rgbd: Path, text: str, message: str) -> None:
    (rgbd / "associations.txt").write_text(text)
    expect_refused(run(command, rgbd), message)


def test_missing_lists(command: CommandLine, rgbd: Path) -> None:
    """The original reads them in an endless loop (OD-8)."""
    for path in rgbd.glob("*.txt"):
        path.unlink()
    shutil.rmtree(rgbd / "depth")  # with it, images and depth would be paired by their names
    done = run(command, rgbd)
    assert done.code == 2
    assert str(rgbd) in done.err
    assert not Path("r").exists()


def test_missing_times_of_kitti(command: CommandLine, stereo: Path) -> None:
    (stereo / "times.txt").unlink()
    done = run(command, stereo, "stereo")
    assert done.code == 2
    assert str(stereo) in done.err


def test_colour_image_without_partner(command: CommandLine, rgbd: Path) -> None:
    (rgbd / "associations.txt").unlink()
    path = rgbd / "depth.txt"
    lines = path.read_text().splitlines()
    del lines[-4]
    path.write_text("\n".join(lines) + "\n")
    done = run(command, rgbd)
    assert done.code == 0
    assert "1 colour images have no depth image, left out" in done.err
    report = Results(Path("r")).report
    assert report["frames"] == report["tracked"] == N - 1


def test_associated_image_that_does_not_exist(command: CommandLine, rgbd: Path) -> None:
    pairs = associations(rgbd)
    pairs[BAD][3] = "depth/elsewhere.png"
    associate(rgbd, pairs)
    expect_skipped(run(command, rgbd), "r", "depth/elsewhere.png is listed but missing")


@pytest.mark.parametrize("images", ["rgb", "depth"])
def test_a_pipe_among_the_images(command: CommandLine, rgbd: Path, images: str) -> None:
    path = sorted((rgbd / images).iterdir())[BAD]
    path.unlink()
    os.mkfifo(path)
    expect_skipped(run(command, rgbd), "r", f"{images}/{path.name} is a pipe, not a file")


@pytest.mark.parametrize("images", ["rgb", "depth"])
def test_all_listed_images_lie_elsewhere(command: CommandLine, rgbd: Path, images: str) -> None:
    (rgbd / images).rename(rgbd / "elsewhere")
    done = run(command, rgbd)
    expect_refused(done, "none of the first 10 images")
    assert "put them where the list says" in done.err.replace("\n", " ")
