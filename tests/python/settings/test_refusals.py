# SPDX-License-Identifier: BSD-3-Clause
"""Settings files that are refused or doubted, and what is said."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.settings import Sensor, Settings
from support.settings_files import DEPTH, MATRIX, MONO, refusal, write


# ---- refusing ------------------------------------------------------------------------------------
def test_missing_file(tmp_path: Path) -> None:
    assert "cannot open settings file" in refusal(tmp_path / "none.yaml")
    assert "cannot open settings file" in refusal(tmp_path)


def test_empty_file(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("%YAML:1.0\n")
    assert "holds no settings" in refusal(tmp_path / "a.yaml")


@pytest.mark.parametrize("name", sorted(MONO))
def test_missing_key(tmp_path: Path, name: str) -> None:
    """The original silently reads 0 or a huge number (OD-1)."""
    values = {key: value for key, value in MONO.items() if key != name}
    message = refusal(write(tmp_path / "a.yaml", values))
    assert f"{name} is missing" in message
    assert str(tmp_path / "a.yaml") in message


@pytest.mark.parametrize(
    ("name", "sensor"),
    [
        ("Camera.bf", Sensor.STEREO),
        ("Camera.bf", Sensor.RGBD),
        ("ThDepth", Sensor.STEREO),
        ("ThDepth", Sensor.RGBD),
        ("DepthMapFactor", Sensor.RGBD),
    ],
)
def test_missing_key_of_depth_sensors(tmp_path: Path, name: str, sensor: Sensor) -> None:
    """Without the factor, millimetres were metres, and nothing was said."""
    values = {key: value for key, value in {**MONO, **DEPTH}.items() if key != name}
    assert f"{name} is missing; {sensor} needs it" in refusal(
        write(tmp_path / "a.yaml", values), sensor
    )


def test_a_pair_needs_no_factor_of_depth_images(tmp_path: Path) -> None:
    values = {**MONO, "Camera.bf": "40.0", "ThDepth": "40.0"}
    assert Settings.load(write(tmp_path / "a.yaml", values), Sensor.STEREO).depth_factor == 1.0


@pytest.mark.parametrize(
    ("present", "sensor", "told"),
    [
        ((), "stereo", "complete for mono, not for stereo: take it for mono (--sensor mono), or"),
        ((), "rgbd", "complete for mono, not for rgbd: take it for mono"),
        (("ThDepth",), "rgbd", "complete for mono, not for rgbd: take it for mono"),
    ],
)
def test_what_a_file_serves_is_told_where_it_lacks_something(
    tmp_path: Path, present: tuple[str, ...], sensor: str, told: str
) -> None:
    values = {**MONO, **dict.fromkeys(present, "40.0")}
    message = refusal(write(tmp_path / "a.yaml", values), Sensor(sensor))
    assert told in message
    # Where more is wrong it serves nobody.
    message = refusal(write(tmp_path / "a.yaml", {**values, "Camera.fy": "0"}), Sensor(sensor))
    assert "complete for" not in message


def test_a_missing_factor_is_told_with_usual_values(tmp_path: Path) -> None:
    values = {**MONO, "Camera.bf": "40.0", "ThDepth": "40.0"}
    message = refusal(write(tmp_path / "a.yaml", values), Sensor.RGBD)
    for usual in ("1000 for millimetres", "5000 for TUM", "1 for metres"):
        assert usual in message


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
        ("DepthMapFactor", "-5000", "1000 for millimetres"),
        ("DepthMapFactor", "0", "DepthMapFactor is 0; allowed: 1e-05 to 1e+09"),
        ("DepthMapFactor", "0.000001", "allowed: 1e-05 to 1e+09"),
        ("ORBextractor.nFeatures", "0", "allowed"),
        ("ORBextractor.nFeatures", "8.7", "must be a whole number"),
        ("ORBextractor.scaleFactor", "1", "allowed: greater than 1 and at most 2"),
        ("ORBextractor.scaleFactor", "2.1", "allowed: greater than 1 and at most 2"),
        ("ORBextractor.nLevels", "17", "allowed: 1 to 16"),
        ("ORBextractor.iniThFAST", "255", "ORBextractor.iniThFAST is 255; allowed: 1 to 254"),
        ("ORBextractor.iniThFAST", "0", "ORBextractor.iniThFAST is 0; allowed: 1 to 254"),
        ("ORBextractor.minThFAST", "255", "ORBextractor.minThFAST is 255; allowed: 1 to 254"),
        ("ORBextractor.minThFAST", "21", "which is 20"),
        (
            "ORBextractor.originalCoordinates",
            "2",
            "allowed: 0 (true places) or 1 (as the",
        ),
        ("ORBextractor.originalCoordinates", "yes", "'yes' is not a number"),
        ("Viewer.PointSize", "0", "allowed"),
        ("Camera.type", "KannalaBrandt8", "needs Camera.k1, Camera.k2, Camera.k3, Camera.k4; add"),
        ("Camera.type", "Cylinder", "allowed: PinHole"),
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
        ("ORBextractor.originalCoordinate", "ORBextractor.originalCoordinates"),
        ("Viewer.Pointsize", "Viewer.PointSize"),
        ("ThDepths", "ThDepth"),
    ],
)
def test_unknown_key(tmp_path: Path, key: str, nearest: str) -> None:
    """The original silently reads 0 for a key that is misspelt (OD-1)."""
    path = write(tmp_path / "a.yaml", MONO, f"{key}: 1\n")
    assert refusal(path) == f"{path}:13: unknown key {key.strip()}; did you mean {nearest}?"


def test_unknown_key_without_relatives(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    assert Settings.load(write(tmp_path / "a.yaml", MONO, "zzzzqq: 1\n"), Sensor.MONOCULAR)
    assert "do not describe the camera: zzzzqq" in caplog.text


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
    """Among them that stereo images are not rectified, which the original accepts (OD-7)."""
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


def test_a_rectification_of_another_image_size_is_doubted(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    small = MATRIX.replace("458.654", "114.66").replace("457.296", "114.32")
    text = small + MATRIX.replace("LEFT", "RIGHT")
    Settings.load(write(tmp_path / "a.yaml", {**MONO, **DEPTH}, text), Sensor.STEREO)
    assert "LEFT: rectification changes the focal length from 114.66 to 435.2" in caplog.text
    assert "RIGHT: rectification changes" not in caplog.text
