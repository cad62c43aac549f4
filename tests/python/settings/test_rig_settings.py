# SPDX-License-Identifier: BSD-3-Clause
"""Settings of rigs: their file, what gives depths, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.errors import SettingsError
from orbslam2py.settings import RigCamera, Sensor, Settings
from orbslam2py.settings.rig import depth_sources
from support.rigs import (
    PINHOLE,
    WIDE,
    back_to_back,
    four_around,
    mounted,
    rig_settings,
    two_wide_pairs,
)


@pytest.mark.parametrize("settings", [back_to_back(), two_wide_pairs(), four_around()])
def test_a_file_reads_back_as_it_was(settings: Settings, tmp_path: Path) -> None:
    settings.save(tmp_path / "rig.yaml")
    assert Settings.load(tmp_path / "rig.yaml", "rig") == settings


def test_depths_come_from_the_camera_that_sees_most_of_the_same() -> None:
    pairs = depth_sources(two_wide_pairs().rig or ())
    assert [source.partner for source in pairs] == [1, 0, 3, 2]
    assert [source.active for source in pairs] == [True, False, True, False]
    around = depth_sources(four_around().rig or ())
    assert [source.partner for source in around] == [1, 2, 3, 0]
    assert all(source.active for source in around)
    assert all(source.image for source in depth_sources(back_to_back().rig or ()))


def written(tmp_path: Path, old: str, new: str) -> Path:
    text = two_wide_pairs().to_yaml()
    assert old in text
    path = tmp_path / "rig.yaml"
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("Camera3.fx: 75.0", "Camera3.fx: -75", "Camera3.fx"),
        ("Camera3.fx: 75.0\n", "", "Camera3.fx is missing"),
        ("Camera3.T_c1_c3", "Camera3.T_c3_c1", "Camera3.T_c1_c3 is missing.*T_c3_c1"),
        ("Camera4.", "Camera6.", "number them from 1"),
        ("Camera2.width: 256\n", "", "Camera2.width"),
        ("-1.0", "-1.5", "no rigid transform"),
        ("KannalaBrandt8", "KannalaBrandt9", "Camera1.type"),
    ],
)
def test_errors_name_the_key_of_the_camera(tmp_path: Path, old: str, new: str, named: str) -> None:
    with pytest.raises(SettingsError, match=named):
        Settings.load(written(tmp_path, old, new), Sensor.RIG)


def test_a_file_of_one_camera_is_no_rig(tmp_path: Path) -> None:
    path = tmp_path / "mono.yaml"
    Settings(Sensor.MONOCULAR, PINHOLE).save(path)
    with pytest.raises(SettingsError, match=r"(?s)no rig.*import-camera"):
        Settings.load(path, "rig")


def test_refuses_what_is_no_rig() -> None:
    wide = RigCamera(WIDE)
    with pytest.raises(SettingsError, match="no camera of the rig has depths"):
        rig_settings([RigCamera(PINHOLE), RigCamera(PINHOLE, mounted(180, (0, 0, -0.2)))])
    with pytest.raises(SettingsError, match="2 to 8 cameras"):
        rig_settings([wide])
    with pytest.raises(SettingsError, match="the identity"):
        rig_settings([RigCamera(WIDE, mounted(0, (0.1, 0, 0))), wide])
    with pytest.raises(SettingsError, match="size of the images"):
        RigCamera(replace(WIDE, width=None))
    with pytest.raises(SettingsError, match="DepthMapFactor"):
        settings = back_to_back()
        assert settings.depth is not None
        replace(settings, depth=replace(settings.depth, raw_per_metre=None))


def test_doubts_name_extrinsics_in_millimetres() -> None:
    cameras = [RigCamera(WIDE), RigCamera(WIDE, mounted(0, (120, 0, 0)))]
    assert any("millimetres" in doubt for doubt in rig_settings(cameras).doubts())
    assert np.allclose(rig_settings(cameras).baseline, 120)
    assert two_wide_pairs().doubts() == []
