# SPDX-License-Identifier: BSD-3-Clause
"""Built-in settings, and the ways to choose settings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import SettingsError
from orbslam2py.settings import (
    BUILTIN_NAMES,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    ViewerSettings,
    builtin_settings,
    resolve_settings,
)
from orbslam2py.settings.sensor import WITHOUT_RIG

VARIANTS = [
    (name, sensor)
    for name in BUILTIN_NAMES
    for sensor in WITHOUT_RIG
    if sensor is Sensor.MONOCULAR
    or sensor is (Sensor.RGBD if name.startswith("tum") else Sensor.STEREO)
]


@pytest.mark.parametrize(("name", "sensor"), VARIANTS)
def test_builtin_survives_a_file(tmp_path: Path, name: str, sensor: Sensor) -> None:
    settings = builtin_settings(name, sensor)
    settings.save(tmp_path / "a.yaml")
    assert Settings.load(tmp_path / "a.yaml", sensor) == settings


@pytest.mark.parametrize(
    ("name", "sensor", "baseline", "close_depth"),
    [
        ("tum1", Sensor.RGBD, 0.0773236, 3.09294),
        ("tum2", Sensor.RGBD, 0.0767889, 3.07156),
        ("tum3", Sensor.RGBD, 0.0747105, 2.98842),
        ("kitti00-02", Sensor.STEREO, 0.537166, 18.8008),
        ("kitti03", Sensor.STEREO, 0.537151, 21.4860),
        ("kitti04-12", Sensor.STEREO, 0.537151, 21.4860),
        ("euroc", Sensor.STEREO, 0.1100778, 3.85272),
    ],
)
def test_published_baselines(
    name: str, sensor: Sensor, baseline: float, close_depth: float
) -> None:
    settings = builtin_settings(name, sensor)
    assert settings.baseline == pytest.approx(baseline, rel=2e-6)
    assert settings.close_depth == pytest.approx(close_depth, rel=2e-6)


TUM_FIGURES = {
    "tum1": (517.306408, 516.469215, 318.643040, 255.313989, 1.163314, 5000),
    "tum2": (520.908620, 521.007327, 325.141442, 249.701764, 0.917205, 5208),
    "tum3": (535.4, 539.2, 320.1, 247.6, 0.0, 5000),
}

KITTI_FIGURES = {
    "kitti00-02": (718.856, 718.856, 607.1928, 185.2157, 386.1448, 35),
    "kitti03": (721.5377, 721.5377, 609.5593, 172.854, 387.5744, 40),
    "kitti04-12": (707.0912, 707.0912, 601.8873, 183.1104, 379.8145, 40),
}


@pytest.mark.parametrize("name", sorted(TUM_FIGURES))
def test_published_figures_of_tum(name: str) -> None:
    settings = builtin_settings(name, Sensor.RGBD)
    camera = settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.k3) == TUM_FIGURES[name][:5]
    assert settings.depth == DepthSettings(40.0, TUM_FIGURES[name][5])
    assert (camera.width, camera.height, camera.fps, camera.bf, camera.rgb) == (
        *(640, 480, 30.0, 40.0),
        True,
    )
    assert settings.orb == OrbSettings(1000, 1.2, 8, 20, 7)
    assert settings.viewer == ViewerSettings()
    mono = builtin_settings(name, Sensor.MONOCULAR)
    np.testing.assert_array_equal(mono.camera.distortion, camera.distortion)
    np.testing.assert_array_equal(mono.camera.matrix, camera.matrix)
    assert (mono.orb, mono.depth, mono.camera.bf) == (settings.orb, None, 0.0)


@pytest.mark.parametrize("name", sorted(KITTI_FIGURES))
def test_published_figures_of_kitti(name: str) -> None:
    settings = builtin_settings(name, Sensor.STEREO)
    camera = settings.camera
    assert (camera.fx, camera.fy, camera.cx, camera.cy, camera.bf) == KITTI_FIGURES[name][:5]
    assert settings.depth == DepthSettings(KITTI_FIGURES[name][5])
    assert (camera.width, camera.height, camera.fps, camera.rgb) == (1241, 376, 10.0, True)
    assert not camera.is_distorted
    assert (settings.orb.n_features, settings.orb.min_th_fast) == (2000, 7)
    assert (settings.viewer.keyframe_size, settings.viewer.viewpoint_y) == (0.6, -100)
    mono = builtin_settings(name, Sensor.MONOCULAR)
    assert mono.orb == OrbSettings(2000, 1.2, 8, 20, 7)
    assert (mono.viewer.keyframe_size, mono.viewer.viewpoint_y) == (0.1, -10)


def test_variants_of_a_name_differ_by_sensor() -> None:
    assert builtin_settings("kitti04-12", Sensor.STEREO).orb.ini_th_fast == 12
    assert builtin_settings("kitti04-12", Sensor.MONOCULAR).orb.ini_th_fast == 20
    assert builtin_settings("euroc", Sensor.STEREO).orb.n_features == 1200
    mono = builtin_settings("euroc", Sensor.MONOCULAR)
    assert mono.orb.n_features == 1000
    assert mono.camera.is_distorted
    assert mono.rectification is None


def test_euroc_rectification_fits_its_camera() -> None:
    settings = builtin_settings("euroc", Sensor.STEREO)
    assert settings.rectification is not None
    right = settings.rectification.right
    assert right.P[0, 3] == -settings.camera.bf
    np.testing.assert_allclose(right.R @ right.R.T, np.eye(3), atol=1e-9)
    np.testing.assert_array_equal(settings.rectification.left.P[:, :3], settings.camera.matrix)


@pytest.mark.parametrize("number", range(13))
def test_every_kitti_sequence_has_a_name(number: int) -> None:
    expected = "kitti00-02" if number < 3 else "kitti03" if number == 3 else "kitti04-12"
    for sensor in (Sensor.STEREO, Sensor.MONOCULAR):
        assert builtin_settings(f"kitti{number:02d}", sensor) == builtin_settings(expected, sensor)


def test_unknown_names() -> None:
    with pytest.raises(SettingsError, match=r"did you mean tum1.*kitti00-02"):
        builtin_settings("tum11", Sensor.RGBD)
    with pytest.raises(SettingsError, match="no built-in settings 'kitti13'"):
        builtin_settings("kitti13", Sensor.STEREO)


@pytest.mark.parametrize(
    ("name", "sensor"),
    [("tum1", Sensor.STEREO), ("kitti03", Sensor.RGBD), ("euroc", Sensor.RGBD)],
)
def test_names_without_a_variant(name: str, sensor: Sensor) -> None:
    with pytest.raises(SettingsError, match=f"'{name}' are for .*, not for {sensor}"):
        builtin_settings(name, sensor)


def test_a_choice_is_a_name_a_file_or_settings(tmp_path: Path) -> None:
    expected = builtin_settings("tum1", Sensor.RGBD)
    expected.save(tmp_path / "mine.yaml")
    for choice in ("tum1", "TUM1", tmp_path / "mine.yaml", str(tmp_path / "mine.yaml"), expected):
        assert resolve_settings(choice, Sensor.RGBD) == expected
    assert Settings.load("tum1", Sensor.RGBD) == expected
    with pytest.raises(SettingsError, match="for rgbd, not for mono"):
        resolve_settings(expected, Sensor.MONOCULAR)
    with pytest.raises(SettingsError, match="cannot open settings file"):
        resolve_settings("missing.yaml", Sensor.RGBD)
    with pytest.raises(SettingsError, match="no built-in settings"):
        resolve_settings("nonsense", Sensor.RGBD)
