# SPDX-License-Identifier: BSD-3-Clause
"""Lists of images that lie elsewhere: told when a run begins, not frame by frame."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orbslam2py import DatasetError, open_sequence, run_sequence
from orbslam2py.datasets import open_input


def test_images_of_the_list_lie_elsewhere(tum: Path) -> None:
    (tum / "rgb").rename(tum / "colour")
    with pytest.raises(DatasetError) as caught:
        open_input(tum)
    text = str(caught.value)
    assert text.startswith(f"none of the first 3 images of {tum / 'rgb.txt'} exists, ")
    assert f"from {tum / 'rgb/100.000000.png'} on" in text
    assert f"(there is {tum / 'colour/100.000000.png'}); put them where the list says" in text
    with pytest.raises(DatasetError, match="none of the first 3"):
        run_sequence(open_sequence(tum))


def test_depth_images_lie_elsewhere(tum: Path) -> None:
    shutil.rmtree(tum / "depth")
    with pytest.raises(DatasetError, match=r"from .*depth/100\.005000\.png on \(.*does not exist"):
        open_input(tum, "rgbd")
    assert len(open_input(tum, "mono")) == 4  # type: ignore[arg-type]


@pytest.mark.parametrize("camera", [0, 1])
def test_images_of_kitti_have_other_names(kitti: Path, camera: int) -> None:
    folder = kitti / f"image_{camera}"
    for path in sorted(folder.iterdir()):
        path.rename(folder / f"0000{path.name}")
    with pytest.raises(DatasetError) as caught:
        open_input(kitti)
    assert f"{folder / '000000.png'} on (there is {folder / '0000000000.png'})" in str(caught.value)


def test_images_of_euroc_are_missing(euroc: Path) -> None:
    for path in (euroc / "mav0/cam1/data").iterdir():
        path.unlink()
    with pytest.raises(DatasetError, match=r"cam0/data\.csv exists, from .*cam1/data/14"):
        open_input(euroc)
    assert len(open_input(euroc, "mono")) == 3  # type: ignore[arg-type]


def test_a_missing_image_among_others_is_left_to_the_run(tum: Path, kitti: Path) -> None:
    (tum / "rgb/100.000000.png").unlink()
    (kitti / "image_0/000002.png").unlink()
    assert len(open_input(tum)) == len(open_input(kitti)) == 3  # type: ignore[arg-type]


def test_ground_truth_needs_no_images(tum: Path) -> None:
    shutil.rmtree(tum / "rgb")
    (tum / "groundtruth.txt").write_text("100 0 0 0 0 0 0 1\n")
    assert open_sequence(tum).ground_truth() is not None
