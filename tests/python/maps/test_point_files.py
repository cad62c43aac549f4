# SPDX-License-Identifier: BSD-3-Clause
"""Points as PLY and PCD files, read by others' readers or after the formats' definitions."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import plyfile
import pytest
import trimesh

from orbslam2py import DatasetError
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.maps import write_pcd, write_ply

N = 37


@pytest.fixture
def points() -> FloatArray:
    return np.random.default_rng(4).normal(scale=20.0, size=(N, 3))


@pytest.fixture
def colours() -> ByteArray:
    made = np.random.default_rng(5).integers(0, 256, (N, 3)).astype(np.uint8)
    made[0] = 255, 255, 255  # bits that are no number as a float
    return made


def read_pcd(path: Path) -> dict[str, np.ndarray]:
    """Columns of a binary PCD file, after the definition of version 0.7."""
    header: dict[str, list[str]] = {}
    with path.open("rb") as stream:
        while "DATA" not in header:
            line = stream.readline().decode()
            if not line.startswith("#"):
                header[line.split()[0]] = line.split()[1:]
        content = stream.read()
    assert header["DATA"] == ["binary"]
    assert header["VERSION"] == ["0.7"]
    assert header["COUNT"] == ["1"] * len(header["FIELDS"])
    kinds = [f"<{t.lower()}{size}" for t, size in zip(header["TYPE"], header["SIZE"], strict=True)]
    table = np.frombuffer(content, list(zip(header["FIELDS"], kinds, strict=True)))
    assert [len(table)] == [int(header["POINTS"][0])]
    assert int(header["WIDTH"][0]) * int(header["HEIGHT"][0]) == len(table)
    assert table.dtype.names is not None
    return {name: table[name] for name in table.dtype.names}


@pytest.mark.parametrize("coloured", [False, True])
def test_ply_in_two_readers(
    tmp_path: Path, points: FloatArray, colours: ByteArray, coloured: bool
) -> None:
    path = tmp_path / "points.ply"
    write_ply(path, points, colours=colours if coloured else None)
    vertices = plyfile.PlyData.read(path)["vertex"]
    names = ["x", "y", "z"] + ["red", "green", "blue"] * coloured
    assert [one.name for one in vertices.properties] == names
    read = np.column_stack([vertices[name] for name in "xyz"])
    np.testing.assert_array_equal(read, points.astype(np.float32))
    cloud = trimesh.load(path)
    assert isinstance(cloud, trimesh.PointCloud)
    np.testing.assert_array_equal(cloud.vertices, points.astype(np.float32))
    if coloured:
        np.testing.assert_array_equal(cloud.colors[:, :3], colours)


def test_pcd_without_colours(tmp_path: Path, points: FloatArray) -> None:
    write_pcd(tmp_path / "points.pcd", points, unit="units")
    columns = read_pcd(tmp_path / "points.pcd")
    read = np.column_stack([columns[name] for name in "xyz"])
    np.testing.assert_array_equal(read, points.astype(np.float32))
    assert list(columns) == ["x", "y", "z"]
    assert b"z forward [units]" in (tmp_path / "points.pcd").read_bytes()


def test_pcd_with_colours(tmp_path: Path, points: FloatArray, colours: ByteArray) -> None:
    write_pcd(tmp_path / "points.pcd", points, colours=colours)
    columns = read_pcd(tmp_path / "points.pcd")
    np.testing.assert_array_equal(columns["z"], points[:, 2].astype(np.float32))
    packed = columns["rgb"].view(np.uint32)
    read = np.column_stack([packed >> 16 & 255, packed >> 8 & 255, packed & 255])
    np.testing.assert_array_equal(read, colours)


@pytest.mark.parametrize("write", [write_ply, write_pcd])
def test_no_points(tmp_path: Path, write: Callable[..., None]) -> None:
    write(tmp_path / "none", np.zeros((0, 3)), colours=np.zeros((0, 3), np.uint8))
    assert b" 0\n" in (tmp_path / "none").read_bytes()


@pytest.mark.parametrize("write", [write_ply, write_pcd])
def test_a_colour_for_every_point(
    tmp_path: Path, points: FloatArray, colours: ByteArray, write: Callable[..., None]
) -> None:
    with pytest.raises(DatasetError, match="37 points, but 36 colours"):
        write(tmp_path / "points", points, colours=colours[1:])
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [write_ply, write_pcd])
@pytest.mark.parametrize(
    "wrong",
    [
        np.full((N, 3), 0.9),
        np.full((N, 3), 300),
        np.zeros((N, 4), np.uint8),
        np.zeros(3 * N, np.uint8),
        [[0, 0, 0]] * N,
    ],
)
def test_colours_are_bytes(
    tmp_path: Path, points: FloatArray, write: Callable[..., None], wrong: Any
) -> None:
    with pytest.raises(DatasetError, match=r"colours is .*from 0 to 255, uint8 \(37, 3\)"):
        write(tmp_path / "points", points, colours=wrong)
    assert not any(tmp_path.iterdir())
