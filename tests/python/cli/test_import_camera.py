# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py import-camera``: what it tells, and where the remedies of its messages lead."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import Sensor, Settings
from orbslam2py.settings.sensor import WITHOUT_RIG
from support import fisheye_cameras
from support import foreign_cameras as files
from support.camera_files import written
from support.command_line import CommandLine, Outcome
from support.fisheye_cameras import FILES
from support.foreign_cameras import BASELINE, CX, CY, FX, FY, D, kalibr_pair

IMPORT = ("import-camera", "file", "--output", "my.yaml")
THIN_PRISM = files.ROS1.replace(str(list(D)), str([*files.RATIONAL, 0.01, 0.02, 0.03, 0.04]))
TILTED = files.ROS1.replace(str(list(D)), str([*files.RATIONAL, 0.01, 0, 0, 0, 0.002, 0.001]))
OTHER_LENSES = {
    "thin prism": ("1 THIN_PRISM_FISHEYE 640 480 300 300 320 240\n", "thin prism"),
    "polynomial": ('{"intrinsic": {"model": "radial_poly", "k1": 339.7}}', "polynomial"),
    "scaramuzza": ("model_type: SCARAMUZZA\nimage_width: 640\nimage_height: 480\n", "Scaramuzza"),
}


def refused(done: Outcome) -> str:
    assert done.code == 2, done.err
    assert done.err.startswith("Error: file")
    assert done.err.count("\n") <= 4
    assert not Path("my.yaml").exists()
    return done.err


def line_in(text: str) -> list[str]:
    """The command that a message ends with."""
    words = shlex.split(text.strip().splitlines()[-1])
    assert words[0] == "orbslam2py"
    return words[1:]


def numbers_of(path: str, sensor: str = "mono") -> tuple[float, ...]:
    camera = Settings.load(path, sensor).camera
    return camera.fx, camera.fy, camera.cx, camera.cy


@pytest.fixture(autouse=True)
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


# ---- round trip ----------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "text", [files.ROS2, files.OST, files.VINS_MONO, files.SIMPLE, files.OAK, files.zed("VGA")]
)
@pytest.mark.parametrize("sensor", WITHOUT_RIG)
def test_what_is_written_is_read(
    command: CommandLine, tmp_path: Path, text: str, sensor: Sensor
) -> None:
    """By settings check, with the same numbers."""
    written(tmp_path, text, "file")
    more = ("--camera", "1") if text == files.OAK and sensor is not Sensor.STEREO else ()
    done = command(*IMPORT, "--sensor", sensor, *more)
    pair = text in (files.OAK, files.zed("VGA"))
    if sensor is Sensor.STEREO and not pair:
        assert done.code == 2
        assert "give the calibration of both cameras to import-camera" in done.err
        return
    assert done.code == 0, done.err
    checked = command("settings", "check", "my.yaml", "--sensor", sensor)
    assert checked.code == 0, checked.err
    said = [line for line in done.out.splitlines() if not line.startswith(("Settings", "the two"))]
    assert checked.out.splitlines()[: len(said)] == said
    if sensor is not Sensor.STEREO:
        assert numbers_of("my.yaml", sensor) == (FX, FY, CX, CY)


def test_one_of_a_pair_is_told(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, files.OPENCV_PAIR, "file")
    done = command(*IMPORT, "--sensor", "mono")
    assert "Note: file holds 2 cameras; the settings are of camera 0, not of camera 1" in done.err
    assert command(*IMPORT, "--force", "--sensor", "mono", "--quiet").err == ""
    done = command(*IMPORT, "--force")
    assert done.err == ""
    assert "turned by 0.0 degrees against each other, and 100% of their views" in done.out
    assert "baseline 0.12 m" in done.out


def test_half_a_pixel_of_nerfstudio_is_told(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, files.NERFSTUDIO, "file")
    assert "Note: file: cx and cy of nerfstudio count from the image's" in command(*IMPORT).err
    assert numbers_of("my.yaml") == (FX, FY, CX, CY)


# ---- remedies ------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("text", "given", "factor", "assumed"),
    [
        (files.RECORD3D, (), 1000, True),
        (files.POLYCAM, (), 1000, True),
        (files.RECORD3D, ("--depth-factor", "5000"), 5000, False),
        (files.REPLICA, (), 6553.5, False),
    ],
)
def test_the_depth_factor_is_printed(
    command: CommandLine,
    tmp_path: Path,
    text: str,
    given: tuple[str, ...],
    factor: float,
    assumed: bool,
) -> None:
    written(tmp_path, text, "file")
    done = command(*IMPORT, "--sensor", "rgbd", *given)
    assert done.code == 0, done.err
    assert f"depth images: {factor:g} units per metre\n" in done.out
    told = "file does not say the units of the depth images; 1000 units per metre (millimetres)"
    assert (told in done.err) == assumed
    assert Settings.load("my.yaml", "rgbd").depth_factor == factor
    assert "units per metre" not in command(*IMPORT, "--force").out


@pytest.mark.parametrize("name", ["kalibr ds", "colmap", "vins mei", "basalt ucm", "stella"])
@pytest.mark.parametrize("sensor", [Sensor.MONOCULAR, Sensor.RGBD])
def test_fisheye_is_read_and_told(
    command: CommandLine, tmp_path: Path, name: str, sensor: Sensor
) -> None:
    text, model, lens = FILES[name]
    written(tmp_path, text, "file")
    done = command(*IMPORT, "--sensor", sensor)
    assert done.code == 0, done.err
    assert f"fisheye lens {model}: " in done.out
    assert "WARNING" not in done.err.upper()
    camera = Settings.load("my.yaml", sensor).camera
    assert (camera.model, camera.lens) == (model, lens)
    assert numbers_of("my.yaml", sensor) == (FX, FY, CX, CY)
    checked = command("settings", "check", "my.yaml", "--sensor", sensor)
    assert checked.code == 0, checked.err
    assert f"fisheye lens {model}: " in checked.out
    assert "stereo" not in checked.out


@pytest.mark.parametrize("name", ["kalibr equi", "basalt eucm", "ros", "numbers"])
def test_one_fisheye_is_no_pair(command: CommandLine, tmp_path: Path, name: str) -> None:
    written(tmp_path, FILES[name][0], "file")
    message = refused(command(*IMPORT, "--sensor", "stereo"))
    assert "a stereo pair of fisheye cameras needs both cameras" in message
    assert "--sensor mono uses one camera alone" in message
    assert command(*IMPORT, "--sensor", "mono").code == 0


def test_a_fisheye_file_of_orb_slam3_is_settings_already(
    command: CommandLine, tmp_path: Path
) -> None:
    written(tmp_path, fisheye_cameras.MONO, "file")
    assert "file is a settings file already" in refused(command(*IMPORT))
    assert command("settings", "check", "./file").code == 0


def test_pair_of_fisheyes(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, kalibr_pair(0).replace("radtan", "equidistant"), "file")
    done = command(*IMPORT)
    assert done.code == 0, done.err
    assert "fisheye pair, matched without rectification" in done.out
    settings = Settings.load("my.yaml", "stereo")
    assert settings.right is not None
    assert settings.camera.lens == D[:4]
    assert settings.baseline == pytest.approx(float(np.linalg.norm(settings.right.centre)))
    assert command(*IMPORT, "--camera", "0", "--force").code == 0
    assert Settings.load("my.yaml", "mono").camera.lens == D[:4]


@pytest.mark.parametrize("name", OTHER_LENSES)
def test_other_lenses(command: CommandLine, tmp_path: Path, name: str) -> None:
    text, lens = OTHER_LENSES[name]
    written(tmp_path, text, "file")
    message = refused(command(*IMPORT))
    assert lens in message
    assert "which is not supported; calibrate the camera with a supported fisheye" in message
    assert "orbslam2py calibrate" in message
    assert "--fx" not in message


def test_thin_prism_is_read(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, THIN_PRISM, "file")
    done = command(*IMPORT)
    assert done.code == 0
    assert "lens thin_prism: k1" in done.out
    camera = Settings.load("my.yaml", "mono").camera
    assert (camera.model, camera.lens) == (
        "thin_prism",
        (*files.RATIONAL, 0.01, 0.02, 0.03, 0.04),
    )
    assert command("settings", "show", "my.yaml").code == 0


def test_a_tilted_sensor_is_undistorted_by_opencv(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, TILTED, "file")
    message = refused(command(*IMPORT))
    assert "14 coefficients (a tilted sensor)" in message
    assert "cv2.undistort with K and D" in message
    assert command(*line_in(message)).code == 0
    assert numbers_of("my.yaml") == (FX, FY, CX, CY), "cv2.undistort keeps the camera matrix"


def test_numbers_in_an_unknown_file(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, '{"cam": {"intr": {"fx": 500, "fy": 501, "cx": 320, "cy": 240}}}', "file")
    message = refused(command(*IMPORT))
    assert "file is no camera file we know, but cam.intr holds fx, fy, cx, cy" in message
    assert command(*line_in(message)).code == 0
    assert numbers_of("my.yaml") == (500, 501, 320, 240)


@pytest.mark.parametrize("lens", ['"xi": 1.2', '"note": "fisheye"'])
def test_numbers_of_another_lens_are_not_filled_in(
    command: CommandLine, tmp_path: Path, lens: str
) -> None:
    text = f'{{"cam": {{"fx": 500, "fy": 501, "cx": 320, "cy": 240, {lens}}}}}'
    written(tmp_path, text, "file")
    assert "--fx FX --fy FY" in refused(command(*IMPORT))


@pytest.mark.parametrize("degrees", [110, 180])
def test_back_to_back(command: CommandLine, tmp_path: Path, degrees: float) -> None:
    written(tmp_path, kalibr_pair(degrees), "file")
    message = refused(command(*IMPORT))
    assert f"cam0 and cam1 are turned by {degrees} degrees against each other" in message
    assert message.strip().endswith("take one of them with --camera 0")
    assert command(*IMPORT, "--camera", "0").code == 0
    assert numbers_of("my.yaml") == (FX, FY, CX, CY)
    message = command(*IMPORT, "--force", "--sensor", "stereo").err
    assert message.strip().endswith("take one of them with --camera 0 --sensor mono")
    assert command(*IMPORT, "--force", "--camera", "0", "--sensor", "mono").code == 0


def test_cameras_that_hardly_look_the_same_way(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, kalibr_pair(60), "file")
    done = command(*IMPORT)
    assert done.code == 0
    assert "the two cameras are turned by 60.0 degrees against each other" in done.err
    assert "use one of them (import-camera with --camera 0)" in done.err
    assert "scaled" not in done.err, "it is not the images"
    assert command("settings", "check", "my.yaml").err == done.err
    assert command(*IMPORT, "--camera", "0", "--force").err == ""


def test_left_and_right_exchanged(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, kalibr_pair(0, BASELINE), "file")
    assert "give --camera 1 --sensor stereo" in refused(command(*IMPORT))
    assert command(*IMPORT, "--camera", "1", "--sensor", "stereo").code == 0
    assert Settings.load("my.yaml", "stereo").baseline == pytest.approx(BASELINE)


@pytest.mark.parametrize("unit", [1000, 100])
def test_baseline_in_another_unit(command: CommandLine, tmp_path: Path, unit: float) -> None:
    written(tmp_path, kalibr_pair(0, -unit * BASELINE), "file")
    done = command(*IMPORT)
    assert done.code == 0
    assert f"file gives a baseline of {unit * BASELINE:g} m; if it is in another unit" in done.err
    assert "with --baseline" in done.err
    fixed = command(*IMPORT, "--baseline", str(BASELINE), "--force")
    assert (fixed.code, fixed.err) == (0, "")
    settings = Settings.load("my.yaml", "stereo")
    assert settings.baseline == pytest.approx(BASELINE)
    written(tmp_path, kalibr_pair(0), "right")
    assert command("import-camera", "right", "-o", "right.yaml").code == 0
    right = Settings.load("right.yaml", "stereo").rectification
    assert right is not None
    assert settings.rectification is not None
    np.testing.assert_allclose(settings.rectification.right.P, right.right.P, rtol=1e-6)


def test_size_that_is_missing(command: CommandLine, tmp_path: Path) -> None:
    text = files.OPENCV_PAIR.replace("image_width: 640\nimage_height: 480\n", "")
    written(tmp_path, text, "file")
    assert "give it with --size WIDTHxHEIGHT" in refused(command(*IMPORT))
    assert command(*IMPORT, "--size", "640x480").code == 0
    assert Settings.load("my.yaml", "stereo").camera.width == 640


def test_resolution_that_is_chosen(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, files.zed("VGA", "HD"), "file")
    message = refused(command(*IMPORT))
    option = re.search(r"choose yours with (--size \S+)", message)
    assert option
    assert command(*IMPORT, *option[1].split()).code == 0
    assert Settings.load("my.yaml", "stereo").camera.width == 672


def test_settings_that_are_given_as_calibration(command: CommandLine, tmp_path: Path) -> None:
    new = "settings new --sensor mono --fx 9 --fy 9 --cx 4 --cy 4 -o file"
    assert command(*new.split()).code == 0
    message = refused(command(*IMPORT))
    assert "is a settings file already" in message
    assert command("settings", "check", "file").code == 0


@pytest.mark.parametrize(
    "text",
    [
        *(files.ROS1, files.OST, files.EUROC, files.VINS, files.zed("HD"), files.OAK),
        *(files.BASALT_PAIR, files.NERFSTUDIO, files.OPEN3D, files.REPLICA, files.RECORD3D),
        *(files.POLYCAM, files.FCA, files.SIMPLE, files.OPENCV_PAIR),
    ],
)
@pytest.mark.parametrize("sensor", WITHOUT_RIG)
def test_calibration_given_as_settings(
    command: CommandLine, tmp_path: Path, text: str, sensor: Sensor
) -> None:
    """The line that is told works, if one camera is enough or the file holds two."""
    written(tmp_path, text, "file")
    line = line_in(refused(command("settings", "check", "file", "--sensor", sensor)))
    done = command(*line)
    pair = text in (files.zed("HD"), files.OAK, files.OPENCV_PAIR, files.BASALT_PAIR)
    if sensor is Sensor.STEREO and not pair:
        assert {"METRES", "RIGHT.yaml"} & set(line)
        assert done.code == 2
        return
    assert done.code == 0, done.err
    assert command("settings", "check", "my.yaml", "--sensor", sensor).code == 0
