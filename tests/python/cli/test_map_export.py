# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py map export``: every format, with and without images."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import plyfile
import pycolmap
import pytest

from orbslam2py._arrays import ByteArray
from orbslam2py.maps import MapContents, SavedMap
from orbslam2py.maps.content_groups import LENS_SIZE, model_number_of
from orbslam2py.trajectory import read_euroc, read_kitti, read_tum
from support.command_line import CommandLine
from support.made_up_map import HEIGHT, LENS, WIDTH, made_up_map
from support.made_up_saved import made_up_saved, map_file


def write_sequence(folder: Path, contents: MapContents) -> Path:
    """A folder of colour images with the keyframes' time stamps, and one that is no keyframe's."""
    folder.mkdir()
    times = np.append(contents.keyframes.timestamps, contents.keyframes.timestamps[-1] + 1)
    for number in range(len(times)):
        image: ByteArray = np.full((HEIGHT, WIDTH, 3), (10, 20, 30 + number), np.uint8)  # BGR
        cv2.imwrite(str(folder / f"{number:03d}.png"), image)
    (folder.parent / "times.txt").write_text("".join(f"{time:.6f}\n" for time in times))
    return folder


@pytest.fixture
def saved() -> SavedMap:
    return made_up_saved(made_up_map(lens=LENS))


@pytest.mark.parametrize("name", ["colmap", "colmap-text", "nerfstudio"])
def test_with_the_images_of_a_sequence(
    command: CommandLine, tmp_path: Path, saved: SavedMap, name: str
) -> None:
    file = map_file(tmp_path, saved)
    write_sequence(tmp_path / "walk", saved.contents)
    done = command(
        *("map", "export", name, file, "out", "--images", "walk", "--times", "times.txt")
    )
    assert done.code == 0, done.err
    n = len(saved.contents.points)
    assert done.out == f"The map of 8 keyframes and {n} points is in out\n"
    pictures = sorted((tmp_path / "out" / "images").iterdir())
    assert [path.name for path in pictures] == [f"keyframe_{k:06d}.png" for k in range(8)]
    assert cv2.imread(str(pictures[3]))[HEIGHT // 2, WIDTH // 2].tolist() == [10, 20, 33]
    if name == "nerfstudio":
        assert len(json.loads(Path("out/transforms.json").read_text())["frames"]) == 8
        return
    model = pycolmap.Reconstruction("out/sparse/0")
    assert (model.num_images(), model.num_points3D()) == (8, n)
    assert {camera.model.name for camera in model.cameras.values()} == {"PINHOLE"}
    colours = np.array([point.color for point in model.points3D.values()])
    assert set(colours[:, 2]) == {10}
    assert set(colours[:, 1]) == {20}
    assert (Path("out/sparse/0/images.bin").exists()) == (name == "colmap")


def test_with_the_images_in_the_map_file(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path, made_up_saved(images=True))
    assert command("map", "export", "colmap", file, "out").code == 0
    model = pycolmap.Reconstruction("out/sparse/0")
    (camera,) = model.cameras.values()
    assert (camera.width, camera.height) == (WIDTH // 2, HEIGHT // 2)
    assert cv2.imread("out/images/keyframe_000002.png").shape[:2] == (HEIGHT // 2, WIDTH // 2)
    # Grey pictures give grey points.
    colours = np.array([point.color for point in model.points3D.values()])
    assert np.ptp(colours, axis=1).max() == 0
    assert colours.max() > 50


@pytest.mark.parametrize("images", [False, True])
def test_without_images(command: CommandLine, tmp_path: Path, images: bool) -> None:
    file = map_file(tmp_path, made_up_saved(images=images))
    done = command("map", "export", "colmap", file, "out", "--without-images")
    assert done.code == 0
    assert "give the sequence with --images to train on it" in done.out
    assert not Path("out/images").exists()
    (camera,) = pycolmap.Reconstruction("out/sparse/0").cameras.values()
    assert camera.model.name == "OPENCV"


@pytest.mark.parametrize("name", ["ply", "pcd"])
def test_points(command: CommandLine, tmp_path: Path, saved: SavedMap, name: str) -> None:
    file = map_file(tmp_path, saved)
    write_sequence(tmp_path / "walk", saved.contents)
    n = len(saved.contents.points)
    done = command("map", "export", name, file, "plain")
    assert done.out == f"A cloud of {n} points is in plain\n"
    words = ("map", "export", name, file, "coloured", "--images", "walk", "--times", "times.txt")
    assert command(*words).code == 0
    assert Path("coloured").stat().st_size > Path("plain").stat().st_size
    if name == "ply":
        vertices = plyfile.PlyData.read("coloured")["vertex"]
        assert len(vertices) == n
        assert set(vertices["blue"]) == {10}
        assert set(vertices["red"]) <= set(range(30, 38))


@pytest.mark.parametrize(
    ("name", "read"), [("tum", read_tum), ("kitti", read_kitti), ("euroc", read_euroc)]
)
@pytest.mark.parametrize("frames", [False, True])
def test_paths(command: CommandLine, tmp_path: Path, name: str, read: object, frames: bool) -> None:
    saved = made_up_saved()
    file = map_file(tmp_path, saved)
    done = command("map", "export", name, file, "path", *(["--frames"] if frames else []))
    assert (done.code, done.out) == (0, "The path is in path\n")
    path = read("path")  # type: ignore[operator]
    keyframes = saved.contents.keyframes
    if not frames:
        np.testing.assert_allclose(path.T_wc, keyframes.T_wc, atol=1e-8)
        return
    assert len(path) == 24 - 3  # those that were lost are left out
    # Every frame is a bit further to the right in its keyframe's camera.
    row, step = 2, 1
    T_wc = keyframes.T_wc[row]
    expected = T_wc[:3, 3] + 0.01 * step * keyframes.scale[row] * T_wc[:3, 0]
    np.testing.assert_allclose(path.positions[3 * row + step - 1], expected, atol=1e-8)


def test_paths_are_in_the_world_of_the_map(command: CommandLine, tmp_path: Path) -> None:
    """Also where keyframe 0 is not at its origin."""
    saved = made_up_saved()
    T_cw = saved.contents.keyframes.T_cw.copy()
    T_cw[:, :3, 3] -= (T_cw[:, :3, :3] @ np.array([5.0, 6.0, 7.0]))[:, :]
    keyframes = saved.contents.keyframes.with_poses(T_cw)
    moved = replace(saved, contents=replace(saved.contents, keyframes=keyframes))
    file = map_file(tmp_path, moved)
    for more in ([], ["--frames"]):
        assert command("map", "export", "tum", file, "path", "--force", *more).code == 0
        np.testing.assert_allclose(read_tum("path").positions[0], [5, 6, 7], atol=1e-6)


def test_pose_graph(command: CommandLine, tmp_path: Path) -> None:
    done = command("map", "export", "g2o", map_file(tmp_path), "map.g2o")
    assert (done.code, done.out) == (0, "The graph of 8 keyframes is in map.g2o\n")
    assert Path("map.g2o").read_text().count("VERTEX_SE3:QUAT ") == 8


def test_nothing_is_replaced_without_force(command: CommandLine, tmp_path: Path) -> None:
    file = map_file(tmp_path)
    for name in ("colmap", "ply"):
        assert command("map", "export", name, file, name).code == 0
        done = command("map", "export", name, file, name)
        assert done.code == 2
        assert name in done.err
        assert "--force" in done.err
        assert command("map", "export", name, file, name, "--force", "--quiet").code == 0


@pytest.mark.parametrize("more", [(), ("--field", "70")])
def test_a_lens_that_nerfstudio_does_not_know(
    command: CommandLine, tmp_path: Path, more: tuple[str, ...]
) -> None:
    contents = made_up_map()
    lens = np.zeros((1, LENS_SIZE))
    lens[0, :6] = (150.0, 150.0, WIDTH / 2, HEIGHT / 2, -0.2, 0.6)
    cameras = replace(
        contents.cameras, model=np.array([model_number_of("double_sphere")]), lens=lens
    )
    saved = made_up_saved(replace(contents, cameras=cameras))
    file = map_file(tmp_path, saved)
    write_sequence(tmp_path / "walk", contents)
    line = ("map", "export", "nerfstudio", file, "out")
    done = command(*line, "--images", "walk", "--times", "times.txt", *more)
    assert done.code == 0, done.err
    told = " ".join(done.err.split())
    assert "lens of the model double_sphere, which the format cannot hold" in told
    data = json.loads(Path("out/transforms.json").read_text())
    assert (data["camera_model"], data["k1"], data["w"]) == ("OPENCV", 0, WIDTH)
    wide = np.degrees(2 * np.arctan(WIDTH / 2 / data["fl_x"]))
    assert wide == pytest.approx(70) if more else 70 < wide <= 120
    assert data["cx"] == WIDTH / 2
    without = command(*line[:-1], "other", "--without-images")
    assert without.code == 2
    assert "give the images (--images" in without.err
