# SPDX-License-Identifier: BSD-3-Clause
"""Which settings a sequence brings."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbslam2py import DatasetError, Sensor, SettingsError
from orbslam2py.datasets import open_sequence
from orbslam2py.settings import builtin_settings


def test_settings_file_in_the_folder_wins(tum: Path) -> None:
    builtin_settings("tum3", Sensor.RGBD).save(tum / "settings.yaml")
    assert open_sequence(tum).settings == builtin_settings("tum3", Sensor.RGBD)
    chosen = open_sequence(tum, settings="tum1")
    assert chosen.settings == builtin_settings("tum1", Sensor.RGBD)
    assert chosen.default_settings() == builtin_settings("tum3", Sensor.RGBD)


def test_bad_settings_file_in_the_folder(tum: Path) -> None:
    (tum / "settings.yaml").write_text("Camera.fx: x\n")
    with pytest.raises(SettingsError, match="'x' is not a number"):
        _ = open_sequence(tum).settings


def test_bad_choice_of_settings_is_told_at_once(tum: Path) -> None:
    with pytest.raises(SettingsError, match="no built-in settings"):
        open_sequence(tum, settings="tum9")


@pytest.mark.parametrize("sensor", ["rgbd", "mono"])
def test_nothing_tells_the_settings_of_tum(tum: Path, sensor: str) -> None:
    sequence = open_sequence(tum.rename(tum.with_name("kitchen")), sensor)
    with pytest.raises(DatasetError) as caught:
        _ = sequence.settings
    text = str(caught.value)
    assert text.startswith(
        f"no settings for {tum.with_name('kitchen')}: its name does not identify"
    )
    for name, camera in (("tum1", "freiburg1"), ("tum2", "freiburg2"), ("tum3", "freiburg3")):
        assert f"{name} (" in text
        assert camera in text
    assert "--settings" in text
    assert "settings.yaml" in text


def test_nothing_tells_the_settings_of_others(kitti: Path, euroc: Path) -> None:
    (kitti / "calib.txt").unlink()
    with pytest.raises(
        DatasetError, match=r"calib\.txt is missing; .* kitti00-02, kitti03 or kitti"
    ):
        _ = open_sequence(kitti).settings
    (euroc / "mav0/cam0/sensor.yaml").unlink()
    with pytest.raises(DatasetError, match=r"sensor\.yaml is missing in cam0.*--settings euroc"):
        _ = open_sequence(euroc, "mono").settings


@pytest.mark.parametrize("name", ["rgbd_dataset_freiburg2_made_up", "tum_Freiburg2", "fr2_desk"])
def test_name_of_the_folder_tells_the_camera(tum: Path, name: str) -> None:
    assert open_sequence(tum.rename(tum.with_name(name))).settings == builtin_settings(
        "tum2", "rgbd"
    )


def test_name_of_a_link_tells_the_camera(tum: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = builtin_settings("tum2", Sensor.RGBD)
    link = tum.with_name("desk")
    link.symlink_to(tum)
    assert open_sequence(link).settings == expected, "the link's place does"
    target = tum.rename(tum.with_name("kitchen"))
    link = target.with_name("freiburg2_link")
    link.symlink_to(target)
    assert open_sequence(link).settings == expected, "the link does"
    monkeypatch.chdir(link)
    with pytest.raises(DatasetError, match=r"no settings for .*kitchen: its name"):
        _ = open_sequence(".").settings


@pytest.mark.parametrize("name", ["frames1", "afr1", "fr12", "freiburg4", "desk_1"])
def test_other_names_tell_no_camera(tum: Path, name: str) -> None:
    with pytest.raises(DatasetError, match="does not identify the camera"):
        _ = open_sequence(tum.rename(tum.with_name(name))).settings
