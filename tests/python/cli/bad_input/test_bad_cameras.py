# SPDX-License-Identifier: BSD-3-Clause
"""Numbers and files of a camera that cannot be used: the thing, the remedy, nothing lost."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.camera_files import KALIBR, KITTI, OPENCV, ROS
from support.command_line import CommandLine, Outcome

NUMBERS = ("--fx", "525", "--fy", "525", "--cx", "319.5", "--cy", "239.5")
NEW = ("settings", "new", *NUMBERS)


def expect_told(done: Outcome, *messages: str) -> None:
    assert done.code == 2, done.err
    assert done.err.startswith("Error: ")
    assert done.err.count("\n") <= 13
    for message in messages:
        assert message in done.err
    for noise in ("Traceback", "Errno", "SettingsError", "ValueError"):
        assert noise not in done.err
    assert not Path("out.yaml").exists()


@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        ((*NEW, "--sensor", "stereo"), ("baseline is missing", "--baseline 0.12")),
        ((*NEW, "--sensor", "mono", "--baseline", "0.1"), ("baseline", "leave it out for mono")),
        ((*NEW, "--sensor", "mono", "--depth-factor", "1"), ("depth factor", "leave it out")),
        ((*NEW, "--sensor", "rgbd", "--depth-factor", "0"), ("DepthMapFactor is 0", "1000 for")),
        ((*NEW, "--sensor", "rgbd", "--baseline", "0"), ("baseline is 0", "in metres")),
        ((*NEW, "--sensor", "mono", "--fps", "0"), ("Camera.fps is 0", "greater than 0")),
        ((*NEW, "--sensor", "mono", "--size", "640"), ("--size is '640'", "like 640x480")),
        ((*NEW, "--sensor", "mono", "--size", "0x480"), ("Camera.width is 0", "1 to 65535")),
        ((*NEW, "--sensor", "mono", "--distortion", "1,2"), ("'1,2'", "k1,k2,p1,p2")),
        (
            (*NEW, "--sensor", "mono", "--distortion", "1,2,3,4,5,6"),
            ("'1,2,3,4,5,6'", "eight or twelve"),
        ),
        (
            (*NEW, "--sensor", "mono", "--distortion", "a,b,c,d"),
            ("'a,b,c,d'", "four, five, eight or twelve"),
        ),
        ((*NEW, "--sensor", "mono", "--features", "0"), ("nFeatures is 0", "usual: 1000")),
        (
            (*NEW, "--sensor", "stereo", "--baseline", "0.1", "--distortion", "0.1,0,0,0"),
            ("must be rectified", "import-camera"),
        ),
        ((*NEW[:3], "-5", *NEW[4:], "--sensor", "mono"), ("Camera.fx is -5", "greater than 0")),
        ((*NEW[:3], "nan", *NEW[4:], "--sensor", "mono"), ("Camera.fx is not finite", "usual")),
        ((*NEW, "--sensor", "mono", "-o", "no/out.yaml"), ("no: no such folder",)),
        (("settings", "show", "tum9"), ("no built-in settings 'tum9'", "did you mean tum")),
        (
            ("settings", "show", "tum1", "--sensor", "stereo"),
            ("for rgbd and mono, not for stereo",),
        ),
        (("settings", "show", "none.yaml"), ("cannot open settings file none.yaml",)),
        (("settings", "check", "none.yaml"), ("cannot open settings file none.yaml",)),
        (("settings", "check", "."), ("cannot open settings file .",)),
    ],
)
def test_bad_numbers(
    command: CommandLine, arguments: tuple[str, ...], messages: tuple[str, ...]
) -> None:
    if arguments[1] == "new" and "-o" not in arguments:
        arguments = (*arguments, "-o", "out.yaml")
    expect_told(command(*arguments), *messages)


@pytest.mark.parametrize(
    ("text", "messages"),
    [
        ("", ("holds no settings",)),
        ("fx: 500\n", ("unknown key fx; did you mean Camera.fx?", "orbslam2py settings new")),
        ("Camera.width: 640\nCamera.height: 480\n", ("Camera.fx is missing", "settings new")),
        (KALIBR, ("a camchain of Kalibr", "orbslam2py import-camera a.yaml --sensor mono")),
        (OPENCV, ("a calibration of OpenCV", "orbslam2py import-camera a.yaml --sensor mono")),
        (ROS, ("a camera_info of ROS", "orbslam2py import-camera a.yaml --sensor mono")),
        (KITTI, ("a calibration of KITTI", "orbslam2py import-camera a.yaml --sensor mono")),
    ],
)
def test_bad_files(command: CommandLine, text: str, messages: tuple[str, ...]) -> None:
    Path("a.yaml").write_text(text)
    expect_told(command("settings", "check", "a.yaml"), *messages)


@pytest.mark.parametrize("sensor", ["mono", "stereo", "rgbd"])
def test_calibration_given_to_run(command: CommandLine, tmp_path: Path, sensor: str) -> None:
    """The line that is told works as it stands."""
    Path("a.yaml").write_text(KITTI)
    done = command("run", tmp_path, "--sensor", sensor, "--settings", "a.yaml")
    if "a.yaml is" not in done.err:  # an empty folder may be told first
        done = command("settings", "check", "a.yaml", "--sensor", sensor)
    line = done.err.splitlines()[-1].split()
    assert line[0] == "orbslam2py"
    assert command(*line[1:]).code == 0
    assert command("settings", "check", "my.yaml", "--sensor", sensor).code == 0


@pytest.mark.parametrize(
    ("more", "messages"),
    [
        (
            ("--sensor", "stereo"),
            ("needs the images of both cameras", "give two folders or videos"),
        ),
        (("--baseline", "0.1"), ("leave it out for mono",)),
        (("--sensor", "rgbd", "--depth-factor", "-1"), ("DepthMapFactor is -1", "1000 for")),
    ],
)
def test_calibrate_refuses_before_it_searches(
    command: CommandLine, more: tuple[str, ...], messages: tuple[str, ...]
) -> None:
    line = ("calibrate", "none.mp4", "--board", "9x6", "--square", "0.025", "-o", "out.yaml")
    expect_told(command(*line, *more), *messages)
