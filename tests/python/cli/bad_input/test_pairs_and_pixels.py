# SPDX-License-Identifier: BSD-3-Clause
"""Pairs that are none, images side by side, depth and images exchanged, drives without parts."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import open_sequence
from support.command_line import CommandLine, Results
from support.spoilt_runs import N, expect_refused, run

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture
def pair(stereo: Path, tmp_path: Path) -> Path:
    """The images of a sequence in left/ and right/, with its settings beside the folder."""
    folder = tmp_path / "pair"
    for old, new in (("image_0", "left"), ("image_1", "right")):
        shutil.copytree(stereo / old, folder / new)
    settings = open_sequence(stereo).settings
    camera = replace(settings.camera, width=320, height=240)
    replace(settings, camera=camera).save(tmp_path / "pair.yaml")
    return folder


@pytest.fixture
def wide(pair: Path, tmp_path: Path) -> Path:
    """The same with both views in each image."""
    folder = tmp_path / "wide"
    folder.mkdir()
    for path in (pair / "left").iterdir():
        sides = [cv2.imread(str(pair / side / path.name), 0) for side in ("left", "right")]
        cv2.imwrite(str(folder / path.name), np.hstack(sides))  # type: ignore[arg-type]
    return folder


WITH = ("--settings", "pair.yaml")


def tracked(path: Path = Path("r")) -> int:
    return int(Results(path).report["tracked"])


# ---- what works ----------------------------------------------------------------------------------
def test_left_and_right(command: CommandLine, pair: Path) -> None:
    done = run(command, pair, "stereo", *WITH)
    assert done.code == 0, done.err
    assert f"{N} pairs of left and right, by equal names" in done.err
    assert tracked() == N


def test_two_series(command: CommandLine, pair: Path, tmp_path: Path) -> None:
    folder = tmp_path / "one"
    folder.mkdir()
    for path in pair.rglob("*.png"):
        shutil.copy(path, folder / f"{path.parent.name}_{path.name}")
    done = command("run", folder, "--output", "r", *WITH)
    assert done.code == 0, done.err
    assert f"{N} pairs of left* and right*" in done.err
    assert tracked() == N
    alone = command("run", folder, "--sensor", "mono", "--output", "m", *WITH)
    assert f"taking the {N} left images alone (left*, not right*)" in alone.err
    assert Results(Path("m")).report["frames"] == N


def test_split(command: CommandLine, wide: Path) -> None:
    done = run(command, wide, "stereo", "--split", *WITH)
    assert done.code == 0, done.err
    assert tracked() == N


def test_16_bits(command: CommandLine, pair: Path) -> None:
    for path in pair.rglob("*.png"):
        image = cv2.imread(str(path), 0)
        assert image is not None
        cv2.imwrite(str(path), image.astype(np.uint16) * 100)
    done = run(command, pair, "stereo", *WITH)
    assert done.code == 0, done.err
    assert done.err.count("images of 16 bits; in all images, grey values") == 1
    assert tracked() == N


def test_small_depth(command: CommandLine, rgbd: Path) -> None:
    for path in (rgbd / "depth").iterdir():
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        assert depth is not None
        cv2.imwrite(str(path), depth[::2, ::2])
    done = run(command, rgbd)
    assert done.code == 0, done.err
    assert done.err.count("enlarged by nearest neighbour") == 1
    assert tracked() == N


# ---- what is refused -----------------------------------------------------------------------------
LOOKS_LIKE = "a pair is two folders of images, such as left and right"


def test_no_right_folder(command: CommandLine, pair: Path) -> None:
    (pair / "right").rename(pair / "other")
    done = run(command, pair, "stereo", *WITH)
    expect_refused(done, f"{pair} has no stereo images", f"other ({N} images", LOOKS_LIKE)


def test_half_of_a_pair(command: CommandLine, pair: Path) -> None:
    done = run(command, pair / "left", "stereo", *WITH)
    expect_refused(done, "holds one half of a pair", f"give the folder of both, {pair}")


def test_one_series_for_stereo(command: CommandLine, pair: Path, tmp_path: Path) -> None:
    alone = Path(shutil.copytree(pair / "left", tmp_path / "alone" / "images"))
    done = run(command, alone, "stereo", *WITH)
    expect_refused(done, f"its {N} images", "do not name left and right", LOOKS_LIKE, "--split")


def test_nothing_fits(command: CommandLine, pair: Path) -> None:
    for k, path in enumerate(sorted((pair / "right").iterdir())):
        path.rename(path.with_stem(f"x{1000 + k}"))
    sorted((pair / "right").iterdir())[0].unlink()
    done = run(command, pair, "stereo", *WITH)
    expect_refused(done, f"left ({N} images) and right ({N - 1})", "--sensor mono")


def test_rgbd_of_a_pair(command: CommandLine, pair: Path) -> None:
    done = run(command, pair, "rgbd", *WITH)
    expect_refused(
        done,
        "cannot decide which folder in",
        "has the images and which the depth: it has left (14 images",
        "or give one of these folders alone",
    )


def test_times_that_do_not_fit(command: CommandLine, pair: Path, tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text("1.0\n2.0\n")
    done = run(command, pair, "stereo", *WITH, "--times", "t.txt")
    expect_refused(done, "t.txt holds 2 time stamps", f"there are {N} images")


def test_twice_as_wide(command: CommandLine, wide: Path) -> None:
    done = run(command, wide, "mono", *WITH)
    expect_refused(done, "640 x 240 pixels, twice as wide", "(320 x 240)", "take --split")


def test_stereo_without_split(command: CommandLine, wide: Path) -> None:
    expect_refused(run(command, wide, "stereo", *WITH), "no stereo images", "take --split")


@pytest.mark.parametrize("what", ["pair", "stereo"])
def test_split_of_what_has_two_images(
    command: CommandLine, pair: Path, stereo: Path, what: str
) -> None:
    folder = pair if what == "pair" else stereo
    done = run(command, folder, "stereo", *WITH, "--split")
    expect_refused(done, "--split is for images that hold two views side by side", "leave it out")


def test_split_of_nothing(command: CommandLine, tmp_path: Path) -> None:
    done = command("view", "nowhere", "--split")
    expect_refused(done, "--split says what --sequence holds", "give it as well")
    (tmp_path / "x.orbmap").write_bytes(b"no map")
    done = command("map", "export", "colmap", tmp_path / "x.orbmap", "out", "--split")
    expect_refused(done, "--split says what --images hold", "give these as well")


def test_split_for_rgbd(command: CommandLine, wide: Path) -> None:
    done = run(command, wide, "rgbd", *WITH, "--split")
    expect_refused(done, "has no rgbd images; it can be used as: stereo, mono")


def test_split_of_images_of_one_view(command: CommandLine, pair: Path) -> None:
    done = run(command, pair / "left", "stereo", *WITH, "--split")
    assert "160 x 240 pixels in each half, but the settings are for 320 x 240" in done.err


def test_depth_and_images_exchanged(command: CommandLine, rgbd: Path) -> None:
    (rgbd / "rgb").rename(rgbd / "x")
    (rgbd / "depth").rename(rgbd / "rgb")
    (rgbd / "x").rename(rgbd / "depth")
    done = run(command, rgbd)
    expect_refused(done, "looks like a depth image (16 bits, one channel)", "exchanged?")


def test_depth_as_the_images_of_one_camera(command: CommandLine, rgbd: Path) -> None:
    done = run(command, rgbd / "depth", "mono", "--settings", str(rgbd / "settings.yaml"))
    expect_refused(done, "looks like a depth image", "Give the colour or grey images")


def test_only_depth(command: CommandLine, rgbd: Path, tmp_path: Path) -> None:
    folder = tmp_path / "phone"
    for name in ("rgb", "depth"):
        shutil.copytree(rgbd / "depth", folder / name)
    done = run(command, folder, "rgbd", "--settings", str(rgbd / "settings.yaml"))
    expect_refused(
        done, "all of them look like depth images (16 bits, one channel)", "keep one folder"
    )


def reshape_depth(path: Path, size: tuple[int, int]) -> None:
    depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert depth is not None
    cv2.imwrite(str(path), cv2.resize(depth, size, interpolation=cv2.INTER_NEAREST))


@pytest.mark.parametrize(
    ("size", "message"), [((160, 90), "do not show the same view"), ((640, 480), "cv2.resize")]
)
def test_depth_of_another_size(
    command: CommandLine, rgbd: Path, tmp_path: Path, size: tuple[int, int], message: str
) -> None:
    folder = tmp_path / "phone"
    for old, new in (("rgb", "color"), ("depth", "depth")):
        shutil.copytree(rgbd / old, folder / new)
    for path in (folder / "depth").iterdir():
        reshape_depth(path, size)
    done = run(command, folder, "rgbd", "--settings", str(rgbd / "settings.yaml"))
    expect_refused(done, f"depth has size {size[0]}x{size[1]}, the image 320x240", message)


# ---- drives of KITTI raw -------------------------------------------------------------------------
def no_calibration(day: Path) -> None:
    (day / "calib_cam_to_cam.txt").unlink()


def no_dates(day: Path) -> None:
    (day / "drive" / "image_00" / "timestamps.txt").write_text("0.0\n0.1\n")


def few_dates(day: Path) -> None:
    (day / "drive" / "image_01" / "timestamps.txt").write_text("2011-09-26 13:02:25.0\n")


def no_dates_at_all(day: Path) -> None:
    (day / "drive" / "image_01" / "timestamps.txt").unlink()


@pytest.mark.parametrize(
    ("spoil", "message", "remedy"),
    [
        (no_calibration, "calib_cam_to_cam.txt is missing", "raw_data.php"),
        (no_dates, "timestamps.txt:1: '0.0' is no date", "such as 2011-09-26 13:02:25"),
        (few_dates, "timestamps.txt holds 1 time stamp", "copy the drive's own timestamps.txt"),
        (no_dates_at_all, "image_01/timestamps.txt", "check the path"),
    ],
)
def test_spoilt_drives(
    command: CommandLine,
    stereo: Path,
    tmp_path: Path,
    spoil: Callable[[Path], None],
    message: str,
    remedy: str,
) -> None:
    day = tmp_path / "2011_09_26"
    dates = "".join(f"2011-09-26 13:02:{25 + k / 10:012.9f}\n" for k in range(N))
    for camera in (0, 1):
        folder = day / "drive" / f"image_{camera:02d}"
        shutil.copytree(stereo / f"image_{camera}", folder / "data")
        (folder / "timestamps.txt").write_text(dates)
    P = ("200 0 159.5 0 0 200 119.5 0 0 0 1 0", "200 0 159.5 -20 0 200 119.5 0 0 0 1 0")
    lines = [f"P_rect_0{k}: {P[k]}\nS_rect_0{k}: 320 240\nS_0{k}: 320 240" for k in range(2)]
    (day / "calib_cam_to_cam.txt").write_text("\n".join(lines) + "\n")
    good = command("run", day / "drive", "--output", "good")
    assert good.code == 0, good.err
    assert Results(Path("good")).report["tracked"] == N
    spoil(day)
    expect_refused(command("run", day / "drive", "--output", "r"), message, remedy)
