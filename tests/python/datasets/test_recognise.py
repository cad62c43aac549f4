# SPDX-License-Identifier: BSD-3-Clause
"""Which layout a folder has."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import DatasetError
from orbslam2py.datasets import EurocSequence, KittiSequence, Layout, open_sequence, recognise


def test_recognise(tum: Path, kitti: Path, euroc: Path) -> None:
    assert recognise(tum) is Layout.TUM
    assert recognise(kitti) is Layout.KITTI
    assert recognise(euroc) is Layout.EUROC
    assert recognise(euroc / "mav0") is Layout.EUROC


def test_folders_that_are_no_sequence(tum: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="does not exist"):
        open_sequence(tmp_path / "nowhere")
    with pytest.raises(DatasetError, match="is no folder"):
        open_sequence(tum / "rgb.txt")
    with pytest.raises(DatasetError, match=r"looked for rgb\.txt .*did you mean .*freiburg2"):
        open_sequence(tum.parent)
    with pytest.raises(DatasetError, match="no known sequence"):
        open_sequence(tum / "rgb")


def test_folder_of_two_layouts(tum: Path) -> None:
    (tum / "image_0").mkdir()
    (tum / "times.txt").write_text("0\n")
    with pytest.raises(DatasetError, match=r"several layouts \(tum, kitti\)"):
        open_sequence(tum)
    assert len(open_sequence(tum, layout=Layout.TUM)) == 3


def test_association_belongs_to_tum(kitti: Path) -> None:
    with pytest.raises(DatasetError, match="belongs to a TUM sequence"):
        open_sequence(kitti, association="a.txt")


def test_layout_that_the_folder_has_not(tum: Path, kitti: Path) -> None:
    with pytest.raises(DatasetError, match=r"cannot open .*times\.txt"):
        KittiSequence(tum)
    with pytest.raises(DatasetError, match="neither mav0/cam0 nor cam0"):
        EurocSequence(kitti)
