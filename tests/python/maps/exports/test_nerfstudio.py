# SPDX-License-Identifier: BSD-3-Clause
"""Data for nerfstudio, read after the definition of its conventions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import plyfile
import pytest

from orbslam2py import DatasetError, MapFileError
from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.maps import MapContents, export_nerfstudio, take_contents
from orbslam2py.maps.exports.nerfstudio import camera_to_world
from support.made_up_map import (
    CX,
    CY,
    FX,
    FY,
    HEIGHT,
    LENS,
    RATIONAL_LENS,
    WIDTH,
    made_up_map,
)


def transforms(folder: Path) -> dict[str, Any]:
    return dict(json.loads((folder / "transforms.json").read_text()))


def coloured_images(keyframe_id: int) -> ByteArray:
    return np.full((HEIGHT, WIDTH, 3), (200, 10 * keyframe_id, 7), np.uint8)


def points_of(folder: Path) -> tuple[FloatArray, Any]:
    vertices = plyfile.PlyData.read(folder / transforms(folder)["ply_file_path"])["vertex"]
    return np.column_stack([vertices[name] for name in "xyz"]).astype(np.float64), vertices


def pixels_by_definition(data: dict[str, Any], frame: int, points: FloatArray) -> FloatArray:
    """Where a camera of OpenGL sees points, in pixels whose first centre is (0.5, 0.5)."""
    to_camera = np.linalg.inv(np.array(data["frames"][frame]["transform_matrix"]))
    X = points @ to_camera[:3, :3].T + to_camera[:3, 3]
    assert np.all(X[:, 2] < 0)  # it looks along -z
    right, up = X[:, 0] / -X[:, 2], X[:, 1] / -X[:, 2]
    lens = np.array([data["k1"], data["k2"], data["p1"], data["p2"], data["k3"]])
    rays = np.column_stack([right, -up, np.ones(len(X))])
    bent, _ = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), np.eye(3), lens)
    x, y = bent.reshape(-1, 2).T
    return np.column_stack([data["fl_x"] * x + data["cx"], data["fl_y"] * y + data["cy"]])


def check_pixels(contents: MapContents, folder: Path, keypoints: FloatArray) -> None:
    data = transforms(folder)
    points, _ = points_of(folder)
    for row, number in enumerate(contents.keyframes.ids.tolist()):
        seen, numbers = contents.observations_in_keyframe(number)
        rows = np.searchsorted(contents.points.ids, seen)
        found = pixels_by_definition(data, row, points[rows])
        wanted = keypoints[contents.keyframes.keypoints_of(row)][numbers] + 0.5
        np.testing.assert_allclose(found, wanted, atol=2e-3)  # points are float32


@pytest.mark.parametrize("lens", [None, LENS, RATIONAL_LENS])
def test_points_are_where_the_images_show_them(
    tmp_path: Path, lens: tuple[float, ...] | None
) -> None:
    contents = made_up_map(lens=lens)
    export_nerfstudio(contents, tmp_path / "out", images=coloured_images)
    check_pixels(contents, tmp_path / "out", contents.keyframes.keypoints)
    data = transforms(tmp_path / "out")
    assert (data["w"], data["h"]) == (WIDTH, HEIGHT)
    assert [data[key] for key in ("fl_x", "fl_y", "cx", "cy")] == [FX, FY, CX + 0.5, CY + 0.5]
    assert [data[key] for key in ("k1", "k2", "k3", "p1", "p2")] == [0] * 5
    for frame in data["frames"]:
        assert (tmp_path / "out" / frame["file_path"]).is_file()


def test_without_images_the_lens_is_told(tmp_path: Path) -> None:
    contents = made_up_map(lens=LENS)
    names = {number: f"/photos/{number}.jpg" for number in range(8)}
    export_nerfstudio(contents, tmp_path / "out", image_names=names)
    check_pixels(contents, tmp_path / "out", contents.keyframes.raw_keypoints)
    data = transforms(tmp_path / "out")
    assert [data[key] for key in ("k1", "k2", "p1", "p2", "k3")] == list(LENS)
    assert [frame["file_path"] for frame in data["frames"]] == list(names.values())
    assert not (tmp_path / "out" / "images").exists()


def test_a_rational_lens_is_refused_where_its_images_are_not_written(tmp_path: Path) -> None:
    contents = made_up_map(2, lens=RATIONAL_LENS)
    for names in (None, {0: "first.jpg"}):
        with pytest.raises(DatasetError, match=r"rational lens \(k4 to k6\); give the images"):
            export_nerfstudio(contents, tmp_path / "out", image_names=names)
    assert list(tmp_path.iterdir()) == []


def test_the_world_stands_upright(tmp_path: Path) -> None:
    """The map's y is down; nerfstudio's z is up."""
    contents = made_up_map()
    export_nerfstudio(contents, tmp_path / "out")
    first = np.array(transforms(tmp_path / "out")["frames"][0]["transform_matrix"])
    # The first camera is upright in the map: its up is the world's.
    np.testing.assert_allclose(first[:3, 1], [0, 0, 1], atol=1e-12)
    applied = np.array(transforms(tmp_path / "out")["applied_transform"])
    points, _ = points_of(tmp_path / "out")
    moved = contents.points.positions @ applied[:, :3].T + applied[:, 3]
    np.testing.assert_allclose(points, moved, atol=1e-6)
    np.testing.assert_allclose(np.linalg.det(applied[:, :3]), 1.0)


def test_colours_come_from_the_images(tmp_path: Path) -> None:
    export_nerfstudio(made_up_map(2), tmp_path / "out", images=coloured_images)
    _, vertices = points_of(tmp_path / "out")
    assert set(vertices["red"]) == {200}
    assert set(vertices["green"]) == {5}  # seen in both: the mean of 0 and 10
    picture = cv2.imread(str(tmp_path / "out" / "images" / "keyframe_000001.png"))
    assert picture[50, 50].tolist() == [7, 10, 200]


def test_images_of_two_sizes_have_cameras_of_their_own(tmp_path: Path) -> None:
    contents = made_up_map(3)

    def shrinking(keyframe_id: int) -> ByteArray:
        return np.zeros((HEIGHT // (1 + keyframe_id), WIDTH // (1 + keyframe_id)), np.uint8)

    export_nerfstudio(contents, tmp_path / "out", images=shrinking)
    data = transforms(tmp_path / "out")
    assert "fl_x" not in data
    assert [frame["w"] for frame in data["frames"]] == [WIDTH, WIDTH // 2, WIDTH // 3]
    assert data["frames"][1]["fl_x"] == FX / 2
    assert data["frames"][1]["cx"] == (CX + 0.5) / 2


def test_axes_of_a_camera() -> None:
    """At the origin, looking along the map's z: along the upright world's y."""
    pose = camera_to_world(np.eye(4)[None])[0]
    np.testing.assert_array_equal(-pose[:3, 2], [0, 1, 0])
    np.testing.assert_array_equal(pose[:3, 1], [0, 0, 1])
    np.testing.assert_array_equal(pose[:3, 0], [1, 0, 0])


def test_there_is_something_to_export(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="image_names names no keyframe of the map; give"):
        export_nerfstudio(made_up_map(), tmp_path / "out", image_names={})
    with pytest.raises(MapFileError, match="the map has no keyframes"):
        export_nerfstudio(take_contents(core.Map()), tmp_path / "out")
    assert not any(tmp_path.iterdir())
