# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map optimize --align``: from a sequence on the disk, and with wrong ones."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import cv2
import pytest

from orbslam2py import System
from orbslam2py.maps import load_map
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.command_line import CommandLine

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a sequence of a room and its map."""
    folder = tmp_path_factory.mktemp("room")
    options = SyntheticOptions(world="room", sensor="rgbd", frames=20, size=(320, 240), fps=8)
    walk = SyntheticSequence(options)
    walk.write(folder / "room")
    with System(walk.settings, "rgbd", deterministic=True) as system:
        system.run(walk)
        system.save_map(folder / "a.orbmap")
    return folder


@pytest.fixture
def room(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path


def align(command: CommandLine, images: str, *more: object) -> tuple[int, str, str]:
    words = ("map", "optimize", "a.orbmap", "-o", "b.orbmap", "--align", "--images", images, *more)
    done = command(*words)
    return done.code, done.out, " ".join(done.err.split())


def test_map_is_refined(command: CommandLine, room: Path) -> None:
    before = (room / "a.orbmap").read_bytes()
    code, out, err = align(command, "room")
    assert code == 0, err
    n = re.search(r"sightings: (\d+) of (\d+) aligned", out)
    assert n is not None
    assert int(n[1]) > 0.8 * int(n[2]) > 0
    errors = re.search(r"Reprojection error, median: (\S+) to (\S+) pixels", out)
    assert errors is not None
    assert float(errors[2]) < 0.5 * float(errors[1])
    assert out.endswith("The map is in b.orbmap\n")
    assert (room / "a.orbmap").read_bytes() == before
    old, new = load_map("a.orbmap").contents, load_map("b.orbmap").contents
    assert (old.keyframes.keypoints == new.keyframes.keypoints).all()
    assert not (old.points.positions == new.points.positions).all()


def test_quiet_says_nothing(command: CommandLine, room: Path) -> None:
    assert align(command, "room", "--quiet")[:2] == (0, "")


@pytest.mark.parametrize("changed", ["size", "time", "place", "missing"])
def test_wrong_images_are_refused(command: CommandLine, room: Path, changed: str) -> None:
    images = sorted((room / "room" / "rgb").glob("*.png"))
    if changed == "size":
        for path in images:
            cv2.imwrite(str(path), cv2.imread(str(path), 0)[:200, :300])
    elif changed == "time":
        for name in ("rgb", "depth"):
            listing = room / "room" / f"{name}.txt"
            lines = [line.split() for line in listing.read_text().splitlines() if line[0] != "#"]
            later = "".join(f"{float(t) + 500:.6f} {file}\n" for t, file in lines)
            listing.write_text(later)
        (room / "room" / "associations.txt").unlink(missing_ok=True)
    elif changed == "place":
        for path, other in zip(images, reversed(images), strict=True):
            cv2.imwrite(str(path), cv2.flip(cv2.imread(str(other.with_suffix(".png")), 0), -1))
    else:
        for path in images:
            path.unlink()
    code, _, err = align(command, "room")
    assert code == 2, err
    expected = {
        "size": "has 300 x 200 pixels, but its camera has 320 x 240",
        "time": "no image of the sequence has the time stamp of a keyframe",
        "place": "they do not show the map",
        "missing": ".png",
    }
    assert expected[changed] in err
    assert changed == "missing" or "the map was made of" in err
    assert not (room / "b.orbmap").exists()
