# SPDX-License-Identifier: BSD-3-Clause
"""Settings files: what is read, what is refused and how, what is written."""

from __future__ import annotations

import dataclasses
import logging
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from orbslam2py.errors import SettingsError
from orbslam2py.settings.builtin import BUILTIN_NAMES, builtin_settings, resolve_settings
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Settings,
    StereoRectification,
    ViewerSettings,
)

MONO = {
    "Camera.fx": "517.3",
    "Camera.fy": "516.4",
    "Camera.cx": "318.6",
    "Camera.cy": "255.3",
    "ORBextractor.nFeatures": "1000",
    "ORBextractor.scaleFactor": "1.2",
    "ORBextractor.nLevels": "8",
    "ORBextractor.iniThFAST": "20",
    "ORBextractor.minThFAST": "7",
}
DEPTH = {"Camera.bf": "40.0", "ThDepth": "40.0"}

MATRIX = """\
LEFT.height: 480
LEFT.width: 752
LEFT.D: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data:[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0.0]
LEFT.K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [458.654, 0.0, 367.215,
     0.0, 457.296, 248.375,
     0.0, 0.0, 1.0]
LEFT.R:  !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
LEFT.P:  !!opencv-matrix
   rows: 3
   cols: 4
   dt: d
   data: [435.2, 0, 367.4, 0,  0, 435.2, 252.2, 0,  0, 0, 1, 0]
"""


def write(path: Path, values: dict[str, str], extra: str = "") -> Path:
    lines = ["%YAML:1.0", "", "# a camera"]
    lines += [f"{key}: {value}" for key, value in values.items()]
    path.write_text("\n".join(lines) + "\n" + extra)
    return path


def refusal(path: Path, sensor: Sensor = Sensor.MONOCULAR) -> str:
    with pytest.raises(SettingsError) as caught:
        Settings.load(path, sensor)
    return str(caught.value)


# ---- reading -------------------------------------------------------------------------------------


def test_smallest_file(tmp_path: Path) -> None:
    settings = Settings.load(write(tmp_path / "a.yaml", MONO), Sensor.MONOCULAR)
    assert settings.camera == CameraSettings(517.3, 516.4, 318.6, 255.3)
    assert settings.camera.fps == 30.0
    assert not settings.camera.rgb
    assert settings.orb == OrbSettings()
    assert settings.depth is None
    assert settings.baseline == 0.0
    assert settings.close_depth == math.inf


def test_derived_quantities(tmp_path: Path) -> None:
    values = {**MONO, **DEPTH, "Camera.fps": "29.97", "DepthMapFactor": "5000"}
    settings = Settings.load(write(tmp_path / "a.yaml", values), Sensor.RGBD)
    assert settings.baseline == pytest.approx(40 / 517.3)
    assert settings.close_depth == pytest.approx(40 * 40 / 517.3)
    assert settings.max_frames == 29
    assert settings.depth_factor == 5000


@pytest.mark.parametrize(("factor", "expected"), [("0", 1.0), ("0.000001", 1.0), ("1000", 1000.0)])
def test_depth_factor_of_zero_means_metres(tmp_path: Path, factor: str, expected: float) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, **DEPTH, "DepthMapFactor": factor})
    assert Settings.load(path, Sensor.RGBD).depth_factor == expected


def test_rates_below_one_still_allow_a_frame(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.fps": "0.5"})
    assert Settings.load(path, Sensor.MONOCULAR).max_frames == 1


def test_rate_of_zero_is_unknown(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.fps": "0"})
    assert Settings.load(path, Sensor.MONOCULAR).camera.fps == 30.0


def test_spellings_that_opencv_reads(tmp_path: Path) -> None:
    text = "%YAML:1.0\r\n---\n" + "".join(f"{k}:{v}   # why not\n" for k, v in MONO.items())
    path = tmp_path / "a.yaml"
    path.write_text(text + "Viewer.PointSize:2\nCamera.RGB: 1.0\n")
    settings = Settings.load(path, Sensor.MONOCULAR)
    assert settings.camera.fx == 517.3
    assert settings.camera.rgb is True
    assert settings.viewer.point_size == 2


def test_matrices(tmp_path: Path) -> None:
    text = MATRIX + MATRIX.replace("LEFT", "RIGHT")
    settings = Settings.load(write(tmp_path / "a.yaml", {**MONO, **DEPTH}, text), Sensor.STEREO)
    assert settings.rectification is not None
    left = settings.rectification.left
    np.testing.assert_array_equal(left.K[1], [0, 457.296, 248.375])
    assert left.D.shape == (5,)
    assert left.P.shape == (3, 4)
    assert (left.width, left.height) == (752, 480)
    with pytest.raises(ValueError, match="read-only"):
        left.K[0, 0] = 1


def test_what_other_sensors_need_is_not_looked_at(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", {**MONO, "Camera.bf": "-1", "ThDepth": "x"}, MATRIX)
    assert Settings.load(path, Sensor.MONOCULAR).rectification is None


def test_keys_of_orb_slam3_are_read_past(tmp_path: Path) -> None:
    extra = 'File.version: "1.0"\nCamera.type: "PinHole"\nIMU.NoiseGyro: 1e-3\nStereo.b: 0.1\n'
    assert Settings.load(write(tmp_path / "a.yaml", MONO, extra), Sensor.MONOCULAR)


def test_opencv_reads_the_spelling_without_a_blank_alike(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", MONO, "Viewer.PointSize:2\n")
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    ours = Settings.load(path, Sensor.MONOCULAR).viewer.point_size
    assert ours == storage.getNode("Viewer.PointSize").real() == 2


def test_scalars_are_those_of_opencv(tmp_path: Path) -> None:
    values = {**MONO, **DEPTH, "Camera.k1": "-1.5e-05", "Camera.k2": "+0.25", "Camera.p1": "7"}
    path = write(tmp_path / "a.yaml", values, MATRIX + MATRIX.replace("LEFT", "RIGHT"))
    ours = Settings.load(path, Sensor.STEREO)
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    for name in ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "bf"):
        assert getattr(ours.camera, name) == storage.getNode(f"Camera.{name}").real()
    assert ours.rectification is not None
    for name in "KRP":
        expected = storage.getNode(f"RIGHT.{name}").mat()
        np.testing.assert_array_equal(getattr(ours.rectification.right, name), expected)
    np.testing.assert_array_equal(
        ours.rectification.right.D, np.ravel(storage.getNode("RIGHT.D").mat())
    )


# ---- refusing ------------------------------------------------------------------------------------


def test_missing_file(tmp_path: Path) -> None:
    assert "cannot open settings file" in refusal(tmp_path / "none.yaml")
    assert "cannot open settings file" in refusal(tmp_path)


def test_empty_file(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("%YAML:1.0\n")
    assert "holds no settings" in refusal(tmp_path / "a.yaml")


@pytest.mark.parametrize("name", sorted(MONO))
def test_missing_key(tmp_path: Path, name: str) -> None:
    values = {key: value for key, value in MONO.items() if key != name}
    message = refusal(write(tmp_path / "a.yaml", values))
    assert f"{name} is missing" in message
    assert str(tmp_path / "a.yaml") in message


@pytest.mark.parametrize("name", sorted(DEPTH))
@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_missing_key_of_depth_sensors(tmp_path: Path, name: str, sensor: Sensor) -> None:
    values = {key: value for key, value in {**MONO, **DEPTH}.items() if key != name}
    assert f"{name} is missing; {sensor} needs it" in refusal(
        write(tmp_path / "a.yaml", values), sensor
    )


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [
        ("Camera.fx", "abc", "'abc' is not a number; allowed: greater than 0"),
        ("Camera.fx", "", "the value is empty"),
        ("Camera.fx", "1 2", "'1 2' is not a number"),
        ("Camera.fx", "517,3", "'517,3' is not a number"),
        ("Camera.fx", "[517, 3]", "must be one number"),
        ("Camera.fx", ".nan", "not finite"),
        ("Camera.fx", "nan", "not finite"),
        ("Camera.cx", "-.Inf", "not finite"),
        ("Camera.cx", "1e999", "too large"),
        ("Camera.fx", "0", "Camera.fx is 0; allowed: greater than 0"),
        ("Camera.fx", "-517", "allowed: greater than 0"),
        ("Camera.fx", "3.4e38", "allowed: greater than 0 and at most 100000 pixels"),
        ("Camera.k1", "1e20", "allowed"),
        ("Camera.width", "0", "allowed: 1 to 65535"),
        ("Camera.width", "640.5", "must be a whole number"),
        ("Camera.fps", "-1", "allowed"),
        ("Camera.RGB", "2", "allowed: 0 (BGR) or 1 (RGB)"),
        ("Camera.RGB", "true", "'true' is not a number"),
        ("Camera.bf", "0", "allowed"),
        ("ThDepth", "-3", "allowed"),
        ("DepthMapFactor", "-5000", "allowed: 0 to"),
        ("ORBextractor.nFeatures", "0", "allowed"),
        ("ORBextractor.nFeatures", "8.7", "must be a whole number"),
        ("ORBextractor.scaleFactor", "1", "allowed: greater than 1 and at most 2"),
        ("ORBextractor.scaleFactor", "2.1", "allowed: greater than 1 and at most 2"),
        ("ORBextractor.nLevels", "17", "allowed: 1 to 16"),
        ("ORBextractor.iniThFAST", "256", "allowed: 1 to 255"),
        ("ORBextractor.minThFAST", "21", "which is 20"),
        ("Viewer.PointSize", "0", "allowed"),
        ("Camera.type", "KannalaBrandt8", "allowed: PinHole"),
    ],
)
def test_bad_value(tmp_path: Path, key: str, value: str, expected: str) -> None:
    values = {**MONO, **DEPTH, key: value}
    path = write(tmp_path / "a.yaml", values)
    line = path.read_text().splitlines().index(f"{key}: {value}") + 1
    message = refusal(path, Sensor.RGBD)
    assert message.startswith(f"{path}:{line}: {key}")
    assert expected in message


@pytest.mark.parametrize(
    ("key", "nearest"),
    [
        ("Camera.Fx", "Camera.fx"),
        ("Camera.fX ", "Camera.fx"),
        ("ORBextractor.nFeature", "ORBextractor.nFeatures"),
        ("Viewer.Pointsize", "Viewer.PointSize"),
        ("ThDepths", "ThDepth"),
    ],
)
def test_unknown_key(tmp_path: Path, key: str, nearest: str) -> None:
    path = write(tmp_path / "a.yaml", MONO, f"{key}: 1\n")
    assert refusal(path) == f"{path}:13: unknown key {key.strip()}; did you mean {nearest}?"


def test_unknown_key_without_relatives(tmp_path: Path) -> None:
    assert "remove it" in refusal(write(tmp_path / "a.yaml", MONO, "zzzzqq: 1\n"))


def test_unknown_keys_can_be_allowed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path = write(tmp_path / "a.yaml", MONO, "Camera.flavour: 3\n")
    assert Settings.load(path, Sensor.MONOCULAR, allow_unknown=True)
    assert "Camera.flavour" in caplog.text


def test_doubled_key(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", MONO, "Camera.fx: 600\n")
    assert refusal(path) == f"{path}:13: Camera.fx is given twice (first on line 4); keep one"


def test_line_that_is_no_entry(tmp_path: Path) -> None:
    path = write(tmp_path / "a.yaml", MONO, "hello\n")
    assert refusal(path) == f"{path}:13: expected 'key: value', found 'hello'"


def test_all_problems_are_told_together(tmp_path: Path) -> None:
    values = {**MONO, "Camera.fx": "x", "Camera.cy": ".inf", "ORBextractor.nLevels": "0"}
    del values["Camera.fy"]
    message = refusal(write(tmp_path / "a.yaml", values, "Camera.fz: 1\nCamera.cx: 1\n"))
    lines = message.splitlines()
    assert lines[0] == f"6 problems in settings file {tmp_path / 'a.yaml'}:"
    named = ["Camera.fx", "Camera.cy", "nLevels", "Camera.fz", "Camera.cx", "Camera.fy is missing"]
    assert len(lines) == 7
    for line, name in zip(lines[1:], named, strict=True):
        assert name in line


def test_file_of_noise_gives_a_short_message(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(np.random.default_rng(0).integers(0, 256, 20000, dtype=np.uint8).tobytes())
    assert len(refusal(path).splitlines()) <= 40


def test_new_names_of_orb_slam3_are_explained(tmp_path: Path) -> None:
    values = {key.replace("Camera.", "Camera1."): value for key, value in MONO.items()}
    assert "rename Camera1.fx" in refusal(write(tmp_path / "a.yaml", values))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("cols: 5", "cols: 4", "LEFT.D should hold 1 x 4 = 4 numbers, found 5"),
        ("cols: 5", "cols: x", "cols: 'x' is not a number"),
        ("cols: 5", "cols: 0", "cols is 0"),
        ("   cols: 5\n", "", "LEFT.D has no cols"),
        ("data:[-0.28340811,", "data:[-0.28340811", "LEFT.D"),
        ("0.00019359", "nan", "LEFT.D: nan is not finite"),
        ("[1, 0, 0, 0, 1, 0, 0, 0, 1]", "[1, 0, 0, 0, 1, 0, 0, 1, 1]", "R is not a rotation"),
        ("[1, 0, 0, 0, 1, 0, 0, 0, 1]", "[1, 0, 0, 0, 1, 0, 0, 0, 1", "not closed"),
        ("[1, 0, 0, 0, 1, 0, 0, 0, 1]", "7", "data must be a list"),
        ("rows: 3\n   cols: 4", "rows: 4\n   cols: 3", "P must be 3 x 4"),
        ("LEFT.height: 480\n", "", "rectify stereo are missing: LEFT.height"),
        ("LEFT.height: 480\n", "LEFT.height: 0\n", "LEFT.height is 0"),
        ("LEFT.R:  !!opencv-matrix\n", "LEFT.R: 3\nX:\n", "must be a matrix"),
    ],
)
def test_bad_matrix(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in MATRIX
    text = MATRIX.replace(old, new, 1) + MATRIX.replace("LEFT", "RIGHT")
    assert expected in refusal(write(tmp_path / "a.yaml", {**MONO, **DEPTH}, text), Sensor.STEREO)


# ---- doubts --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"Camera.cx": "700", "Camera.width": "640"}, "outside the image"),
        ({"Camera.cy": "-1", "Camera.height": "480"}, "outside the image"),
        ({"ORBextractor.nFeatures": "100"}, "very few"),
        ({"Camera.p2": "0.1"}, "distortion must be zero"),
    ],
)
def test_doubts_are_warnings(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, change: dict[str, str], expected: str
) -> None:
    with caplog.at_level(logging.WARNING):
        Settings.load(write(tmp_path / "a.yaml", {**MONO, **DEPTH, **change}), Sensor.STEREO)
    assert expected in caplog.text


def test_camera_that_does_not_fit_the_rectification_is_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    text = MATRIX + MATRIX.replace("LEFT", "RIGHT")
    Settings.load(write(tmp_path / "a.yaml", {**MONO, **DEPTH}, text), Sensor.STEREO)
    assert "differ from LEFT.P" in caplog.text
    assert "differs from -RIGHT.P[0,3]" in caplog.text


# ---- made in Python ------------------------------------------------------------------------------


def test_values_are_checked_without_a_file_too() -> None:
    with pytest.raises(SettingsError, match=r"Camera\.fx is -1.*Camera\.fy is not finite"):
        CameraSettings(-1.0, math.nan, 0.0, 0.0)
    with pytest.raises(SettingsError, match="which is 5"):
        OrbSettings(ini_th_fast=5)
    with pytest.raises(SettingsError, match="not a number"):
        OrbSettings(n_levels="eight")  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="ThDepth"):
        DepthSettings(0.0)
    camera = CameraSettings(500.0, 500.0, 320.0, 240.0)
    with pytest.raises(SettingsError, match=r"Camera\.bf.*ThDepth"):
        Settings(Sensor.RGBD, camera)


def test_numpy_numbers_become_plain_ones() -> None:
    camera = CameraSettings(np.float64(500), np.float32(500), np.int64(320), 240)
    assert type(camera.fx) is float
    assert type(camera.cx) is float


def test_settings_cannot_change() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        builtin_settings("tum1", Sensor.RGBD).camera.fx = 1.0  # type: ignore[misc]


def test_distortion_vector() -> None:
    camera = CameraSettings(500, 500, 320, 240, p2=0.1)
    np.testing.assert_array_equal(camera.distortion, [0, 0, 0, 0.1])
    assert camera.is_distorted
    assert dataclasses.replace(camera, k3=0.5).distortion.shape == (5,)
    assert not CameraSettings(500, 500, 320, 240).is_distorted


def test_description_names_the_figures() -> None:
    text = "\n".join(builtin_settings("tum1", Sensor.RGBD).describe())
    for figure in ("517.306", "0.262383", "1000 features", "20 and 7", "3.093 m"):
        assert figure in text


# ---- built-in ------------------------------------------------------------------------------------

VARIANTS = [
    (name, sensor)
    for name in BUILTIN_NAMES
    for sensor in Sensor
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


# ---- any settings survive a file -----------------------------------------------------------------


def number(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_subnormal=False)


CAMERAS = st.builds(
    CameraSettings,
    *(number(1e-3, 1e5), number(1e-3, 1e5), number(-1e5, 1e5), number(-1e5, 1e5)),
    *[number(-1e4, 1e4)] * 5,
    width=st.none() | st.integers(1, 65535),
    height=st.none() | st.integers(1, 65535),
    fps=number(1e-3, 1e5),
    bf=number(1e-3, 1e6),
    rgb=st.booleans(),
)
ORBS = st.integers(1, 255).flatmap(
    lambda first: st.builds(
        OrbSettings,
        st.integers(1, 10**6),
        number(1.01, 2.0),
        st.integers(1, 16),
        st.just(first),
        st.integers(1, first),
    )
)
MATRICES = st.lists(number(-1e4, 1e4), min_size=12, max_size=12)


@st.composite
def rectified_cameras(draw: st.DrawFn) -> CameraRectification:
    R, _ = cv2.Rodrigues(np.array(draw(st.lists(number(-3, 3), min_size=3, max_size=3))))
    return CameraRectification(
        K=np.array(draw(MATRICES)[:9]).reshape(3, 3),
        D=np.array(draw(MATRICES)[: draw(st.sampled_from([4, 5, 8]))]),
        R=np.asarray(R, dtype=np.float64),
        P=np.array(draw(MATRICES)).reshape(3, 4),
        width=draw(st.integers(1, 65535)),
        height=draw(st.integers(1, 65535)),
    )


@st.composite
def any_settings(draw: st.DrawFn) -> Settings:
    sensor = draw(st.sampled_from(Sensor))
    camera = draw(CAMERAS)
    factor = draw(number(0, 1e9)) if sensor is Sensor.RGBD else 1.0
    rectified = sensor is Sensor.STEREO and draw(st.booleans())
    return Settings(
        sensor=sensor,
        camera=camera if sensor.has_depth else dataclasses.replace(camera, bf=0.0),
        orb=draw(ORBS),
        depth=DepthSettings(draw(number(1e-3, 1e6)), factor) if sensor.has_depth else None,
        rectification=StereoRectification(draw(rectified_cameras()), draw(rectified_cameras()))
        if rectified
        else None,
        viewer=draw(
            st.builds(
                ViewerSettings,
                *[number(1e-3, 1e6)] * 6,
                *[number(-1e6, 1e6)] * 3,
                number(1e-3, 1e6),
            )
        ),
    )


@given(settings=any_settings())
@hypothesis_settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_round_trip(tmp_path: Path, settings: Settings) -> None:
    path = tmp_path / "a.yaml"
    settings.save(path)
    read = Settings.load(path, settings.sensor)
    assert read == settings
    assert hash(read) == hash(settings)
    # OpenCV's reader, used by other programs, sees the same numbers.
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.getNode("Camera.fx").real() == settings.camera.fx
    assert storage.getNode("Camera.p1").real() == settings.camera.p1
    assert storage.getNode("ORBextractor.nFeatures").real() == settings.orb.n_features
    if settings.rectification is not None:
        np.testing.assert_array_equal(
            storage.getNode("LEFT.P").mat(), settings.rectification.left.P
        )


@given(text=st.text(alphabet="Camera.fx:[]!- #\n\t123eD,\"'%", max_size=200))
@hypothesis_settings(
    max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
def test_any_text_is_read_or_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(SettingsError):
        Settings.load(path, Sensor.MONOCULAR)


# ---- real files ----------------------------------------------------------------------------------


@pytest.mark.shared
def test_file_of_a_real_sequence(shared_data: Path) -> None:
    path = shared_data / "sequences" / "7scenes_redkitchen_head250" / "settings.yaml"
    settings = Settings.load(path, Sensor.RGBD)
    assert settings.camera.fx == 525.0
    assert settings.depth_factor == 1000.0
    assert settings.camera.rgb
