# SPDX-License-Identifier: BSD-3-Clause
"""Points with colours, trajectories, and where colours and images come from."""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
import pytest
from evo.tools import file_interface

from orbslam2py import DatasetError, ImageError, MapFileError, Sensor, Settings
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.maps import (
    export_colmap,
    export_nerfstudio,
    export_points,
    export_trajectory,
    images_of,
    keyframe_path,
    with_colours,
)
from orbslam2py.settings import CameraSettings
from support.made_up_map import CX, CY, FX, FY, HEIGHT, LENS, WIDTH, made_up_map


# ---- trajectories --------------------------------------------------------------------------------
@pytest.mark.parametrize("name", ["tum", "kitti", "euroc"])
def test_evo_reads_the_keyframes(tmp_path: Path, name: str) -> None:
    contents = made_up_map()
    export_trajectory(keyframe_path(contents), tmp_path / "path", name)
    reader = {
        "tum": file_interface.read_tum_trajectory_file,
        "kitti": file_interface.read_kitti_poses_file,
        "euroc": file_interface.read_euroc_csv_trajectory,
    }[name]
    read = reader(str(tmp_path / "path"))
    np.testing.assert_allclose(read.poses_se3, contents.keyframes.T_wc, atol=1e-8)
    if name != "kitti":
        np.testing.assert_allclose(read.timestamps, contents.keyframes.timestamps, atol=1e-6)


def test_a_format_must_be_chosen(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="tum, kitti or euroc"):
        export_trajectory(keyframe_path(made_up_map()), tmp_path / "path", "auto")


# ---- points --------------------------------------------------------------------------------------
def test_points_with_the_colours_of_the_map(tmp_path: Path) -> None:
    contents = made_up_map(colours=True)
    export_points(contents, tmp_path / "points.ply")
    vertices = plyfile.PlyData.read(tmp_path / "points.ply")["vertex"]
    colours = contents.point_colours()
    assert colours is not None
    assert len(np.unique(colours, axis=0)) > 50
    read = np.column_stack([vertices[name] for name in ("red", "green", "blue")])
    np.testing.assert_array_equal(read, colours)
    header = (tmp_path / "points.ply").read_bytes().split(b"end_header")[0]
    assert b"world of the map [units]" in header


def test_points_without_colours(tmp_path: Path) -> None:
    export_points(made_up_map(depth=True), tmp_path / "points.PCD")
    header = (tmp_path / "points.PCD").read_bytes()
    assert b"FIELDS x y z\n" in header
    assert b"[m]" in header


def test_a_name_that_tells_no_format(tmp_path: Path) -> None:
    with pytest.raises(MapFileError, match=r"points.obj is no name for points.*\.ply or \.pcd"):
        export_points(made_up_map(), tmp_path / "points.obj")


# ---- images --------------------------------------------------------------------------------------
@dataclass
class _Loaded:
    image: ByteArray


@dataclass
class MadeUpSequence:
    timestamps: FloatArray
    rgb: bool = False
    channels: int = 3

    @property
    def settings(self) -> Settings:
        return Settings(Sensor.MONOCULAR, CameraSettings(FX, FY, CX, CY, rgb=self.rgb))

    def load(self, index: int, /) -> _Loaded:
        """Red grows to the right, green downwards, blue is the number of the image."""
        v, u = np.mgrid[:HEIGHT, :WIDTH]
        colours = [np.full_like(u, index), v, u // 2]  # blue, green, red
        if self.rgb:
            colours.reverse()
        image = np.dstack([*colours, np.full_like(u, 9)][: self.channels]).astype(np.uint8)
        return _Loaded(image)


@pytest.mark.parametrize("rgb", [False, True])
@pytest.mark.parametrize("channels", [3, 4])
def test_images_are_found_by_time_and_are_rgb(rgb: bool, channels: int) -> None:
    contents = made_up_map()
    times = np.sort(np.concatenate([contents.keyframes.timestamps[1:], [0.0, 5.0]]))
    image_of = images_of(contents, MadeUpSequence(times, rgb, channels))
    assert image_of(0) is None
    image = image_of(3)
    assert image is not None
    assert image.shape == (HEIGHT, WIDTH, 3)
    assert image[20, 100].tolist() == [50, 20, 4]


def test_images_of_another_time() -> None:
    contents = made_up_map()
    times = contents.keyframes.timestamps + 0.1
    with pytest.raises(DatasetError, match="give the sequence that the map was made of"):
        images_of(contents, MadeUpSequence(times))
    with pytest.raises(DatasetError, match=r"keyframes 1305031102\.175 to .*, images none"):
        images_of(contents, MadeUpSequence(np.zeros(0)))


@pytest.mark.parametrize("lens", [None, LENS])
def test_colours_are_those_of_the_pixel(lens: tuple[float, ...] | None) -> None:
    contents = made_up_map(lens=lens)
    images = images_of(contents, MadeUpSequence(contents.keyframes.timestamps))
    coloured = with_colours(contents, images).keyframes
    assert coloured.has_colours.all()
    raw = coloured.raw_keypoints if lens else coloured.keypoints
    u, v = np.floor(raw[:, 0] + 0.5).astype(int), np.floor(raw[:, 1] + 0.5).astype(int)
    np.testing.assert_array_equal(coloured.colours[:, 0], np.clip(u, 0, WIDTH - 1) // 2)
    np.testing.assert_array_equal(coloured.colours[:, 1], np.clip(v, 0, HEIGHT - 1))
    part = coloured.keypoints_of(5)
    assert set(coloured.colours[part][:, 2]) == {5}


def test_colours_that_are_there_stay() -> None:
    contents = made_up_map(colours=True)
    images = images_of(contents, MadeUpSequence(contents.keyframes.timestamps))
    after = with_colours(contents, images).keyframes
    before = contents.keyframes
    second = np.zeros(len(before.keypoints), bool)
    second[before.keypoints_of(1)] = True  # the only one without
    np.testing.assert_array_equal(after.colours[~second], before.colours[~second])
    assert set(after.colours[second][:, 2]) == {1}


def test_grey_images_give_grey_points() -> None:
    contents = made_up_map()
    images = with_colours(contents, lambda number: np.full((60, 80), number, np.uint8))
    part = images.keyframes.keypoints_of(6)
    assert np.all(images.keyframes.colours[part] == 6)


def test_no_images_no_colours() -> None:
    contents = made_up_map()
    assert with_colours(contents, lambda _: None).point_colours() is None


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.full((HEIGHT, WIDTH, 3), 0.5), r"is of float64 and shape \(240, 320, 3\); give uint8"),
        (np.zeros((HEIGHT, WIDTH, 4), np.uint8), r"shape \(240, 320, 4\); give uint8 \(h, w\)"),
        (np.zeros((0, 0), np.uint8), r"shape \(0, 0\)"),
        (np.zeros(WIDTH, np.uint8), r"shape \(320,\)"),
        ("keyframe.png", "is 'keyframe.png'; give uint8"),
        (np.zeros((WIDTH, HEIGHT), np.uint8), "has 240 x 320 pixels, but its camera has 320 x 240"),
        (np.zeros((HEIGHT, HEIGHT), np.uint8), "has 240 x 240 pixels"),
    ],
)
def test_images_that_do_not_fit_are_refused(tmp_path: Path, image: Any, words: str) -> None:
    contents = made_up_map()
    for use in (
        lambda images: with_colours(contents, images),
        lambda images: export_colmap(contents, tmp_path / "out", images=images),
        lambda images: export_nerfstudio(contents, tmp_path / "out", images=images),
    ):
        with pytest.raises(ImageError, match=f"the image of keyframe 0 .*{words}"):
            use(lambda _: image)
    assert not any(tmp_path.iterdir())


@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (120, 160), (80, 107), (80, 106), (480, 640)])
def test_images_of_the_same_shape_are_taken(size: tuple[int, int]) -> None:
    coloured = with_colours(made_up_map(), lambda _: np.full(size, 7, np.uint8))
    assert (coloured.keyframes.colours == 7).all()


def test_images_come_from_a_function() -> None:
    with pytest.raises(MapFileError, match=r"images is a dict; give a function"):
        with_colours(made_up_map(), {0: np.zeros((HEIGHT, WIDTH), np.uint8)})  # type: ignore[arg-type]


@pytest.mark.parametrize("export", [export_colmap, export_nerfstudio])
def test_names_of_images_are_by_keyframe(tmp_path: Path, export: Callable[..., None]) -> None:
    with pytest.raises(MapFileError, match="image_names is a list; give a dict from keyframe ids"):
        export(made_up_map(), tmp_path / "out", image_names=["a.png"])


@pytest.mark.parametrize(
    ("name", "said"),
    [
        (5, r"image_names\[2\] is 5; give a path"),
        (None, r"image_names\[2\] is None; give a path"),
        (b"a.png", r"image_names\[2\] is bytes; give a path"),
        ("", r"image_names\[2\] is '', which is the name of no file; give a path"),
        (
            "a\0b.png",
            r"image_names\[2\] is 'a\\x00b.png', which is the name of no file; give",
        ),
        ("a\nb.png", r"image_names\[2\] is 'a\\nb.png'; give a name of one line"),
        ("a.png\r", r"image_names\[2\] is 'a.png\\r'; give a name of one line"),
        ("\ud800.png", r"image_names\[2\] is .*; give a name that UTF-8 can spell"),
    ],
)
@pytest.mark.parametrize(
    "export",
    [export_colmap, functools.partial(export_colmap, binary=False), export_nerfstudio],
    ids=["colmap", "colmap text", "nerfstudio"],
)
def test_names_of_images_are_names_of_files(
    tmp_path: Path, export: Callable[..., None], name: object, said: str
) -> None:
    with pytest.raises(MapFileError, match=said) as caught:
        export(made_up_map(), tmp_path / "out", image_names={0: "a.png", 2: name})
    assert str(caught.value).isascii()
    assert not any(tmp_path.iterdir())
