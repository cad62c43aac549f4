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


def test_nothing_tells_the_settings(tum: Path) -> None:
    other = tum.rename(tum.with_name("kitchen"))
    sequence = open_sequence(other)
    with pytest.raises(DatasetError, match=r"no settings for .*tum1, tum2.*settings\.yaml"):
        _ = sequence.settings
