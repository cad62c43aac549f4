# SPDX-License-Identifier: BSD-3-Clause
"""Folders and files of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py.runs.outputs import link_latest, prepare_output_folder, write_ply
from support.files import names_in

pytestmark = pytest.mark.watchdog(20)


def test_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = prepare_output_folder(tmp_path / "a" / "b", force=False)
    assert folder.is_dir()
    assert list(folder.iterdir()) == []
    assert prepare_output_folder(folder, force=False) == folder, "empty: taken"
    (folder / "x").touch()
    with pytest.raises(DatasetError, match="not empty"):
        prepare_output_folder(folder, force=False)
    assert prepare_output_folder(folder, force=True) == folder


def test_link_to_the_latest_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("first", "second"):
        folder = Path("runs") / name
        folder.mkdir(parents=True)
        link_latest(folder)
        assert Path("runs/latest").readlink() == Path(name)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    link_latest(elsewhere)
    assert Path("runs/latest").readlink() == Path("second")
    assert names_in(Path("runs")) == ["first", "latest", "second"]


def test_a_real_folder_called_latest_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "runs" / "one").mkdir()
    link_latest(Path("runs/one"))
    assert not Path("runs/latest").is_symlink()
    assert names_in(Path("runs")) == ["latest", "one"], "nothing else is left behind"


@pytest.mark.parametrize("n", [0, 1, 1000])
def test_ply(tmp_path: Path, n: int) -> None:
    points = np.random.default_rng(0).normal(size=(n, 3))
    write_ply(tmp_path / "p.ply", points)
    header, _, body = (tmp_path / "p.ply").read_bytes().partition(b"end_header\n")
    assert header.startswith(b"ply\nformat binary_little_endian 1.0\n")
    assert f"element vertex {n}\n".encode() in header
    np.testing.assert_array_equal(
        np.frombuffer(body, "<f4").reshape(n, 3), points.astype(np.float32)
    )
