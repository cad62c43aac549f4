# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py settings``."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from orbslam2py import Sensor, Settings
from orbslam2py.settings import BUILTIN_NAMES, builtin_settings
from support.camera_files import KALIBR_PAIR, KITTI, written
from support.command_line import CommandLine

NUMBERS = ("--fx", "525", "--fy", "520", "--cx", "319.5", "--cy", "239.5")


def test_new_settings_of_a_phone(command: CommandLine) -> None:
    done = command("settings", "new", "--sensor", "rgbd", *NUMBERS, "-o", "phone.yaml")
    assert (done.code, done.err) == (0, "")
    assert "points are close below 3 m" in done.out
    assert "depth images: 1000 units per metre" in done.out
    assert "(millimetres) are assumed; if they are others, give --depth-factor" in done.out
    settings = Settings.load("phone.yaml", Sensor.RGBD)
    assert (settings.camera.fx, settings.camera.fy, settings.depth_factor) == (525, 520, 1000)


def test_all_options_of_new(command: CommandLine) -> None:
    more = ("--size", "1280x720", "--fps", "15", "--depth-factor", "5000", "--baseline", "0.05")
    more += ("--distortion", "-0.1,0.02,0.001,-0.002,0.3", "--features", "1234", "--rgb")
    done = command("settings", "new", "--sensor", "rgbd", *NUMBERS, *more, "-o", "a.yaml")
    assert done.code == 0, done.err
    assert "depth images: 5000 units per metre" in done.out
    assert "assumed" not in done.out
    settings = Settings.load("a.yaml", Sensor.RGBD)
    camera = settings.camera
    assert (camera.width, camera.height, camera.fps, camera.rgb) == (1280, 720, 15, True)
    assert camera.distortion.tolist() == [-0.1, 0.02, 0.001, -0.002, 0.3]
    assert settings.baseline == pytest.approx(0.05)
    assert (settings.orb.n_features, settings.depth_factor) == (1234, 5000)


@pytest.mark.parametrize(("sensor", "more"), [("mono", ()), ("stereo", ("--baseline", "0.12"))])
def test_without_a_file_it_is_printed(
    command: CommandLine, sensor: str, more: tuple[str, ...]
) -> None:
    done = command("settings", "new", "--sensor", sensor, *NUMBERS, *more)
    assert (done.code, done.err) == (0, "")
    Path("a.yaml").write_text(done.out)
    assert Settings.load("a.yaml", Sensor(sensor)).camera.fx == 525


def test_doubts_about_new_settings_are_told(command: CommandLine) -> None:
    line = ("settings", "new", "--sensor", "mono", *NUMBERS, "--size", "300x480", "-o", "a.yaml")
    done = command(*line)
    assert done.code == 0
    assert "Warning: a.yaml: Camera.cx 319.5 lies outside the image (300 wide)" in done.err


def test_new_settings_replace_nothing(command: CommandLine) -> None:
    Path("a.yaml").write_text("mine")
    line = ("settings", "new", "--sensor", "mono", *NUMBERS, "-o", "a.yaml")
    done = command(*line)
    assert done.code == 2
    assert "a.yaml exists; use --force" in done.err
    assert Path("a.yaml").read_text() == "mine"
    assert command(*line, "--force", "--quiet").out == ""
    assert Settings.load("a.yaml", Sensor.MONOCULAR)


@pytest.mark.parametrize(
    ("choice", "more", "sensor"),
    [
        ("tum1", (), Sensor.RGBD),
        ("TUM1", ("--sensor", "mono"), Sensor.MONOCULAR),
        ("kitti06", (), Sensor.STEREO),
        ("euroc", (), Sensor.STEREO),
    ],
)
def test_built_in_settings_are_shown(
    command: CommandLine, choice: str, more: tuple[str, ...], sensor: Sensor
) -> None:
    done = command("settings", "show", choice, *more)
    assert (done.code, done.err) == (0, "")
    Path("a.yaml").write_text(done.out)
    assert "ORBextractor.originalCoordinates: 0\n" in done.out
    assert Settings.load("a.yaml", sensor) == builtin_settings(choice, sensor)


def test_settings_are_checked(command: CommandLine) -> None:
    builtin_settings("tum1", Sensor.RGBD).save("mine.yaml")
    done = command("settings", "check", "mine.yaml")
    assert (done.code, done.err) == (0, "")
    assert "mine.yaml is complete for rgbd, mono" in done.out
    assert "points are close below 3.093 m" in done.out
    assert command("settings", "check", "mine.yaml", "--sensor", "mono").code == 0
    text = Path("mine.yaml").read_text()
    Path("mine.yaml").write_text(text.replace("Camera.cx: 318.64304", "Camera.cx: 700"))
    done = command("settings", "check", "mine.yaml")
    assert done.code == 0
    assert done.err.count("Warning: mine.yaml: Camera.cx 700 lies outside the image") == 1


def test_the_sensor_that_is_asked_for_is_confirmed_or_refused(command: CommandLine) -> None:
    new = ("settings", "new", *NUMBERS, "--sensor")
    assert command(*new, "rgbd", "--baseline", "0.1", "-o", "depth.yaml").code == 0
    assert command(*new, "mono", "-o", "mono.yaml").code == 0
    assert "complete for rgbd, mono" in command("settings", "check", "depth.yaml").out
    done = command("settings", "check", "depth.yaml", "--sensor", "stereo")
    assert (done.code, done.err) == (0, "")
    assert "depth.yaml is complete for stereo, rgbd, mono" in done.out
    done = command("settings", "check", "mono.yaml", "--sensor", "stereo")
    assert (done.code, done.out) == (2, "")
    assert "complete for mono, not for stereo: take it for mono" in done.err


@pytest.mark.parametrize("action", ["show", "check"])
def test_settings_may_come_through_a_pipe(command: CommandLine, action: str) -> None:
    builtin_settings("tum1", Sensor.RGBD).save("mine.yaml")
    usual = command("settings", action, "mine.yaml")
    text = Path("mine.yaml").read_text()
    os.mkfifo("pipe.yaml")
    threading.Thread(target=Path("pipe.yaml").write_text, args=(text,), daemon=True).start()
    done = command("settings", action, "pipe.yaml")
    assert (done.code, done.err) == (0, "")
    assert done.out.replace("pipe.yaml", "mine.yaml") == usual.out


def test_built_in_settings_are_listed(command: CommandLine) -> None:
    done = command("settings", "list")
    assert done.code == 0
    for name in BUILTIN_NAMES:
        assert name in done.out
    assert "1241 x 376" in done.out
    assert "stereo, mono" in done.out


@pytest.mark.parametrize("sensor", ["mono", "rgbd"])
def test_import_for_a_sensor(command: CommandLine, tmp_path: Path, sensor: str) -> None:
    written(tmp_path, KALIBR_PAIR, "camchain.yaml")
    more = ("--depth-factor", "1000") if sensor == "rgbd" else ()
    line = ("import-camera", "camchain.yaml", "--sensor", sensor, *more, "-o", "a.yaml")
    done = command(*line)
    assert done.code == 0, done.err
    assert Settings.load("a.yaml", Sensor(sensor)).camera.is_distorted


def test_doubts_about_an_imported_camera_are_told(command: CommandLine, tmp_path: Path) -> None:
    """The same of the import, of new settings and of a check."""
    half = KALIBR_PAIR.replace("[640, 480]", "[320, 240]")
    written(tmp_path, half, "camchain.yaml")
    done = command("import-camera", "camchain.yaml", "--camera", "0", "-o", "a.yaml")
    assert done.code == 0
    assert "Warning: a.yaml: Camera.cx 325.75 lies outside the image (320 wide)" in done.err
    assert "Warning: a.yaml: the calibration does not fit the images" in done.err
    assert "calibration of larger or smaller images, of about 64" in done.err
    checked = command("settings", "check", "a.yaml")
    assert (checked.code, checked.err) == (0, done.err)
    again = ("import-camera", "camchain.yaml", "--camera", "0", "-o", "a.yaml", "--force")
    assert command(*again, "--quiet").err == ""
    numbers = ("--fx", "520.5", "--fy", "515.25", "--cx", "325.75", "--cy", "236.125")
    line = ("settings", "new", "--sensor", "mono", *numbers, "--size", "320x240", "-o", "b.yaml")
    assert command(*line).err.replace("b.yaml", "a.yaml") == done.err


def test_doubts_about_an_imported_pair_are_told(command: CommandLine, tmp_path: Path) -> None:
    """The raw cameras are named, of which the rectified one is made."""
    half = KALIBR_PAIR.replace("[640, 480]", "[320, 240]").replace("325.75, 236.125", "310, 230")
    written(tmp_path, half, "camchain.yaml")
    done = command("import-camera", "camchain.yaml", "-o", "a.yaml")
    assert done.code == 0
    assert done.err.count("the calibration does not fit the images") == 2
    for name in ("LEFT", "RIGHT"):
        assert f"Warning: a.yaml: {name}.K: the calibration does not fit the images" in done.err
    assert command("settings", "check", "a.yaml").err == done.err


def test_settings_go_to_the_terminal_by_its_name(command: CommandLine) -> None:
    """What was written is not read again: here it cannot be."""
    done = command("settings", "new", "--sensor", "mono", *NUMBERS, "-o", "/dev/null", "--force")
    assert (done.code, done.err) == (0, "")


def test_import_of_kitti(command: CommandLine, tmp_path: Path) -> None:
    written(tmp_path, KITTI, "calib.txt")
    line = ("import-camera", "calib.txt", "--sensor", "stereo", "--camera", "2", "-o", "a.yaml")
    done = command(*line)
    assert done.code == 0, done.err
    assert Settings.load("a.yaml", Sensor.STEREO).baseline == pytest.approx(0.4)
