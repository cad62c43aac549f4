# SPDX-License-Identifier: BSD-3-Clause
"""Images of a rig in one folder for each camera."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.datasets import open_sequence
from orbslam2py.errors import DatasetError
from orbslam2py.settings import Settings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.rigs import back_to_back, two_wide_pairs


def written(folder: Path, settings: Settings, names: list[list[str]]) -> Path:
    """Images whose grey value is 10 times the camera plus the moment, by their names."""
    assert settings.rig is not None
    for number, (member, own) in enumerate(zip(settings.rig, names, strict=True)):
        (folder / f"cam{number}").mkdir(parents=True)
        for i, name in enumerate(own):
            image = np.full(member.size[::-1], 10 * number + i, np.uint8)
            cv2.imwrite(str(folder / f"cam{number}" / f"{name}.png"), image)
    settings.save(folder / "settings.yaml")
    return folder


def test_reads_back_what_is_written(tmp_path: Path) -> None:
    options = SyntheticOptions(world="room", sensor="rig", rig=back_to_back(), frames=3)
    made = SyntheticSequence(options)
    made.write(tmp_path / "rig")
    read = open_sequence(tmp_path / "rig", "rig")
    assert read.settings == made.settings
    assert read.timestamps.tolist() == pytest.approx(made.timestamps.tolist())
    truth = read.ground_truth()
    assert truth is not None
    moved = np.linalg.inv(truth.T_wc[0]) @ truth.T_wc[2]
    assert np.allclose(moved, np.linalg.inv(made.T_wc(0)) @ made.T_wc(2), atol=1e-6)
    for i in range(3):
        for (image, depth), (own, own_depth) in zip(
            read.load(i).cameras or (), made.load(i).cameras or (), strict=True
        ):
            assert np.array_equal(image, own)
            assert np.array_equal(depth, own_depth)


def test_a_missing_image_is_none(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    names = [["000", "001", "002"], ["000", "002"], ["000", "001", "002"], ["000", "001", "002"]]
    read = open_sequence(written(tmp_path, two_wide_pairs(), names), "rig")
    assert len(read) == 3
    second = read.load(1).cameras
    assert second is not None
    assert second[1] is None
    assert [int(one[0, 0]) for one in second if one is not None] == [1, 21, 31]
    assert any("1 of 3 moments lack the image of a camera" in text for text in caplog.messages)


def test_times_within_a_set_may_differ_a_little(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = [f"{100 + 0.05 * i:.6f}" for i in range(4)]
    later = [f"{100.006 + 0.05 * i:.6f}" for i in range(4)]
    read = open_sequence(written(tmp_path, two_wide_pairs(), [first, later, first, first]), "rig")
    assert len(read) == 4
    assert all(one is not None for i in range(4) for one in read.load(i).cameras or ())
    assert any("up to 6.0 ms apart" in text for text in caplog.messages)


def test_refuses_folders_that_are_no_rig(tmp_path: Path) -> None:
    folder = written(tmp_path / "a", two_wide_pairs(), 4 * [["000"]])
    (folder / "cam3" / "000.png").unlink()
    with pytest.raises(DatasetError, match=r"4 cameras.*3 folders.*cam0, cam1, cam2"):
        open_sequence(folder, "rig")
    other = written(tmp_path / "b", two_wide_pairs(), [["a"], ["b"], ["c"], ["d"]])
    with pytest.raises(DatasetError, match="do not belong together"):
        open_sequence(other, "rig")
    depths = written(tmp_path / "c", back_to_back(), [["000"], ["000"]])
    with pytest.raises(DatasetError, match=r"camera 1 has depth images.*depth0"):
        open_sequence(depths, "rig")
    (tmp_path / "empty").mkdir()
    two_wide_pairs().save(tmp_path / "empty" / "settings.yaml")
    with pytest.raises(DatasetError, match=r"no images of a rig.*cam0, cam1"):
        open_sequence(tmp_path / "empty", "rig")
