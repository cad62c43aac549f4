# SPDX-License-Identifier: BSD-3-Clause
"""Folders of the known layouts from which something is missing."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from support.command_line import CommandLine
from support.small_folders import P0, P1, write_euroc, write_kitti, write_tum
from support.spoilt_runs import expect_refused, run

pytestmark = pytest.mark.watchdog(40)


def tum(folder: Path) -> list[object]:
    sequence = write_tum(folder / "kitchen")
    pair = "100.000000 rgb/100.000000.png 100.005000 depth/100.005000.png"
    (sequence / "associations.txt").write_text(pair + "\n")
    return [sequence, "rgbd"]


def tum_mono(folder: Path) -> list[object]:
    return [write_tum(folder / "kitchen"), "mono"]


def tum_without_images(folder: Path) -> list[object]:
    sequence = write_tum(folder / "fr1_desk")
    (sequence / "rgb").rename(folder / "rgb")
    return [sequence, "mono"]


def tum_without_depth(folder: Path) -> list[object]:
    sequence = write_tum(folder / "fr1_desk")
    (sequence / "depth.txt").unlink()
    return [sequence, "rgbd"]


def images_of_tum_with_times_of_others(folder: Path) -> list[object]:
    sequence = write_tum(folder / "fr1_desk")
    (sequence / "rgb" / "100.200000.png").rename(sequence / "rgb" / "100.250000.png")
    times = ("--times", sequence / "rgb.txt")
    return [sequence / "rgb", "mono", "--settings", "tum1", *times]


def kitti_without_calibration(folder: Path) -> list[object]:
    sequence = write_kitti(folder / "07")
    (sequence / "calib.txt").unlink()
    return [sequence, "stereo"]


def kitti_in_colour_with_grey_calibration(folder: Path) -> list[object]:
    sequence = write_kitti(folder / "07")
    (sequence / "image_0").rename(sequence / "image_2")
    (sequence / "image_1").rename(sequence / "image_3")
    (sequence / "calib.txt").write_text(f"{P0}\n{P1}\n")
    return [sequence, "stereo"]


def kitti_as_rgbd(folder: Path) -> list[object]:
    return [write_kitti(folder / "07"), "rgbd"]


def kitti_without_right_images(folder: Path) -> list[object]:
    sequence = write_kitti(folder / "07")
    for path in (sequence / "image_1").iterdir():
        path.unlink()
    return [sequence, "stereo"]


def euroc_stereo_without_place(folder: Path) -> list[object]:
    sequence = write_euroc(folder / "V9")
    path = sequence / "mav0/cam1/sensor.yaml"
    text = path.read_text()
    path.write_text(text[: text.index("T_BS")] + text[text.index("rate_hz") :])
    return [sequence, "stereo"]


def euroc_without_calibration(folder: Path) -> list[object]:
    sequence = write_euroc(folder / "V9")
    (sequence / "mav0/cam0/sensor.yaml").unlink()
    return [sequence, "mono"]


def euroc_without_images(folder: Path) -> list[object]:
    sequence = write_euroc(folder / "V9")
    shutil.rmtree(sequence / "mav0/cam0/data")
    return [sequence, "mono"]


def settings_for_another_sensor(folder: Path) -> list[object]:
    return [write_tum(folder / "fr1_desk"), "rgbd", "--settings", "euroc"]


@pytest.mark.parametrize(
    ("make", "thing", "remedy"),
    [
        (tum, "does not identify the camera", "give --settings tum1"),
        (tum_mono, "does not identify the camera", "tum2 (freiburg2) or tum3 (freiburg3)"),
        (tum_without_images, "first 4 images", "put them where the list says"),
        (tum_without_depth, "has no rgbd images", "can be used as: mono"),
        (images_of_tum_with_times_of_others, "the first is 100.250000.png", "a list of all images"),
        (kitti_without_calibration, "calib.txt is missing", "--settings kitti00-02"),
        (kitti_in_colour_with_grey_calibration, "no line 'P2:'", "copy the sequence's own"),
        (kitti_as_rgbd, "has no rgbd images", "can be used as: stereo, mono"),
        (kitti_without_right_images, "image_1/000000.png", "put them where the list says"),
        (euroc_stereo_without_place, "cam1/sensor.yaml has no T_BS", "--sensor mono"),
        (euroc_without_calibration, "sensor.yaml is missing in cam0", "--settings euroc"),
        (euroc_without_images, "none of the first 3 images", "does not exist"),
        (settings_for_another_sensor, "'euroc'", "stereo and mono"),
    ],
)
def test_what_is_missing_is_told(
    command: CommandLine,
    tmp_path: Path,
    make: Callable[[Path], list[object]],
    thing: str,
    remedy: str,
) -> None:
    folder, sensor, *more = make(tmp_path)
    done = run(command, Path(str(folder)), str(sensor), *more)
    expect_refused(done, thing, remedy)
    assert done.err.count("\n") == 1, "one line"
