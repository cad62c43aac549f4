# SPDX-License-Identifier: BSD-3-Clause
"""Results do not come among the files that the next run of the sequence reads."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, run_sequence
from orbslam2py.datasets import (
    BagSequence,
    DepthFolders,
    ImageFolder,
    MaskedSequence,
    VideoSequence,
    open_input,
)
from orbslam2py.runs import RunOptions, SystemOptions
from orbslam2py.runs.input_folders import check_not_among_images
from support.files import names_in
from support.made_up_runs import made_up_run
from support.small_folders import image, save, write_euroc, write_kitti, write_tum
from support.small_sequences import sequence as made_up

pytestmark = pytest.mark.watchdog(30)


def refusal(output: Path, sequence: object, source: Path | None = None) -> str:
    with pytest.raises(DatasetError) as refused:
        check_not_among_images(output, sequence, source)
    assert str(output) in str(refused.value)
    assert "--output" in str(refused.value)
    return str(refused.value)


@pytest.fixture
def plain(tmp_path: Path) -> ImageFolder:
    for number in range(3):
        save(tmp_path / "plain" / f"{number:06d}.png", image(number))
    return ImageFolder(tmp_path / "plain", settings="tum1")


def test_the_folder_of_the_images(plain: ImageFolder, tmp_path: Path) -> None:
    """Pictures of the results would be its next frames, the settings its own."""
    assert "next run" in refusal(plain.folder, plain)
    (tmp_path / "link").symlink_to(plain.folder)
    refusal(tmp_path / "link", plain)
    refusal(plain.folder / ".." / "plain", plain)


@pytest.mark.parametrize("write", [write_tum, write_kitti, write_euroc])
def test_the_folder_of_a_sequence(tmp_path: Path, write: type) -> None:
    """Its calibration would give way to the settings of the run."""
    folder = write(tmp_path / "sequence")
    opened = open_input(folder, Sensor.MONOCULAR, settings="tum1")
    refusal(folder, opened)
    refusal(folder, MaskedSequence(opened, _mask(tmp_path)), folder)


@pytest.mark.parametrize(
    ("write", "inner"),
    [
        (write_tum, "rgb"),
        (write_tum, "depth"),
        (write_kitti, "image_0"),
        (write_kitti, "image_1"),
        (write_euroc, "mav0"),
        (write_euroc, "mav0/cam0"),
        (write_euroc, "mav0/cam1/data"),
    ],
)
def test_folders_of_a_sequence_that_are_read(tmp_path: Path, write: type, inner: str) -> None:
    folder = write(tmp_path / "sequence")
    opened = open_input(folder, Sensor.MONOCULAR, settings="tum1")
    assert "the sequence's own" in refusal(folder / inner, opened)


def test_other_folders_within_a_sequence_take_results(tmp_path: Path) -> None:
    """As where the working folder is that of the sequence: ``run . --output runs/first``."""
    folder = write_tum(tmp_path / "sequence")
    opened = open_input(folder, Sensor.MONOCULAR, settings="tum1")
    (folder / "empty").mkdir()
    (folder / "notes").mkdir()
    (folder / "notes" / "read.me").write_text("mine")
    made_up_run(folder / "earlier", "kkkk")
    (folder / "earlier" / "mine").mkdir()
    for name in ("new", "runs/new", "empty", "notes", "earlier"):
        check_not_among_images(folder / name, opened)
    check_not_among_images(tmp_path, opened)
    check_not_among_images(tmp_path / "sequence-2", opened)


def test_a_third_folder_beside_images_and_depth(tmp_path: Path) -> None:
    """Images and depth are told by what the folders hold: the pictures of a run are images, too."""
    folder = tmp_path / "phone"
    for number in range(2):
        save(folder / "a" / f"{number}.png", image(number))
        save(folder / "b" / f"{number}.png", image(number, dtype=np.uint16))
    opened = open_input(folder, settings="tum1")
    assert isinstance(opened, DepthFolders)
    assert "images and depth" in refusal(folder / "results", opened)
    check_not_among_images(folder / "runs" / "first", opened)
    for name in ("a", "b"):
        assert "the sequence's own" in refusal(folder / name, opened)


def test_bags(tmp_path: Path) -> None:
    """A bag with images beside it is no recording any more, but a folder of these."""
    pytest.importorskip("rosbags")
    folder = made_up(Sensor.MONOCULAR, 2).write(tmp_path / "drive", "mcap")
    (bag,) = folder.glob("*.mcap")
    for source in (folder, bag):
        refusal(folder, BagSequence(source))
    alone = Path(shutil.copy(bag, tmp_path / "alone.mcap"))
    check_not_among_images(folder, BagSequence(alone))
    check_not_among_images(folder / "runs", BagSequence(folder))


def test_what_has_no_folder_of_its_own(tmp_path: Path) -> None:
    """A film, a made-up sequence, or one of somebody else's."""
    check_not_among_images(tmp_path, made_up(Sensor.MONOCULAR, 2))
    film = VideoSequence.__new__(VideoSequence)
    film.path = tmp_path / "film.mp4"
    film.path.touch()
    (tmp_path / "drive.mcap").touch()
    check_not_among_images(tmp_path, film)
    check_not_among_images(tmp_path, object(), tmp_path / "0")

    class Another:
        folder = 7
        path = None

    check_not_among_images(tmp_path, Another())


def test_a_run_refuses_before_it_begins(plain: ImageFolder) -> None:
    before = names_in(plain.folder)
    options = RunOptions("mono", SystemOptions(deterministic=True))
    with pytest.raises(DatasetError, match="plain is the folder"):
        run_sequence(plain, options, output=plain.folder, force=True)
    assert names_in(plain.folder) == before


def _mask(folder: Path) -> Path:
    path = folder / "mask.png"
    save(path, np.full((48, 64), 255, np.uint8))
    return path
