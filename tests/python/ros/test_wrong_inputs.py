# SPDX-License-Identifier: BSD-3-Clause
"""Wrong sources and options of ``orbslam2py run``: exit code 2, the thing and the remedy."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

from orbslam2py.ros import gathering
from orbslam2py.ros.connect import connect
from support.command_line import CommandLine, Outcome
from support.ros_messages import camera_info, raw_image

pytestmark = pytest.mark.watchdog(40)
pytest.importorskip("cyclonedds")


@pytest.fixture
def run_here(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> CommandLine:
    from orbslam2py.ros import zenoh as module  # noqa: PLC0415

    monkeypatch.setattr(module, "_PATIENCE", 300)
    monkeypatch.setattr(gathering, "DISCOVERY", 1.0)
    monkeypatch.setattr(gathering, "MESSAGES", 0.5)
    monkeypatch.setattr(gathering, "_SETTLING", 0.2)
    return CommandLine(monkeypatch, capsys, tmp_path)


def _refused(done: Outcome, *said: str) -> None:
    assert done.code == 2, done.err
    for text in said:
        assert text in done.err
    errors = [line for line in done.err.splitlines() if line.startswith("Error:")]
    assert len(errors) == 1
    assert list(Path.cwd().iterdir()) == []


def test_wrong_configurations_of_the_networks(
    run_here: CommandLine, domain: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "nowhere.xml")
    _refused(
        run_here("run", f"ros2:{domain - 110}"),  # another domain: each is configured once
        f"domain {domain - 110} cannot be joined",
        "correct the configuration that CYCLONEDDS_URI names (nowhere.xml), or unset it",
    )
    monkeypatch.setenv("ZENOH_SESSION_CONFIG_URI", "nowhere.json5")
    _refused(
        run_here("run", "zenoh:"),
        "ZENOH_SESSION_CONFIG_URI, nowhere.json5: No such file",
        "correct it, or unset the variable",
    )


def test_nobody_in_the_domain(run_here: CommandLine, domain: int) -> None:
    _refused(
        run_here("run", f"ros2:{domain}", "--sensor", "stereo"),
        f"ros2:{domain}: there are no topics in domain {domain}",
        "start the robot's nodes, or set ROS_DOMAIN_ID",
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("ros2:999",), ("'999' is no domain", "from 0 to 232")),
        (("ros2:robot",), ("'robot' is no domain",)),
        (("zenoh:tcp/127.0.0.1:9",), ("no router answers at tcp/127.0.0.1:9", "rmw_zenohd")),
        (("ros:0",), ("'ros:' is no kind of live source", "ros2:")),
        (("video.mp4", "--base-frame", "base"), ("--base-frame is for the poses", "--publish")),
        (("video.mp4", "--base-transform", "1,2,3"), ("--base-transform is for the poses",)),
        (("video.mp4", "--foxglove-port", "9000"), ("--foxglove-port is for Foxglove",)),
        (("video.mp4", "--foxglove-host", "0.0.0.0"), ("give --foxglove as well",)),
        (("zenoh:robot",), ("no router answers at robot", "zenoh:tcp/192.168.1.5:7447")),
    ],
)
def test_what_is_no_source_or_has_no_effect(
    run_here: CommandLine, arguments: tuple[str, ...], said: tuple[str, ...]
) -> None:
    _refused(run_here("run", *arguments), *said)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--topics", "left=/nowhere"), ("there is no topic /nowhere (left)", "/cam/image_raw")),
        (("--topics", "left=/words"), ("/words has the type std_msgs/msg/String", "Image")),
        (("--topics", "left=/silent"), ("nothing is published on /silent", "start the camera")),
        (("--topics", "middle=/cam"), ("the role 'middle'",)),
        (("--sensor", "stereo"), ("no stereo images; it can be used as: mono",)),
        (("--base-frame", "base"), ("no static transform (/tf_static)", "--base-transform")),
        (("--base-transform", "up"), ("--base-transform up is no place", "X,Y,Z,QX,QY,QZ,QW")),
        (("--base-transform", "1,2"), ("--base-transform 1,2 is no place",)),
        (("--publish", "dds"), ("'dds' is no network of nodes", "ros2:DOMAIN")),
        (("--record", "a.mp4"), ("a.mp4 does not end like a recording", ".rrd or .mcap")),
        (("--record", "none/a.mcap"), ("there is no folder none for a.mcap",)),
        (("--foxglove", "--foxglove-host", "192.0.2.77"), ("with --foxglove-host",)),
    ],
)
def test_what_does_not_fit_the_topics(
    run_here: CommandLine, domain: int, options: tuple[str, ...], said: tuple[str, ...]
) -> None:
    import numpy as np  # noqa: PLC0415

    robot = connect(f"ros2:{domain}")
    words, _ = (robot.publish(f"/{name}", kind) for name, kind in _OTHERS.items())
    image = robot.publish("/cam/image_raw", "sensor_msgs/msg/Image", latched=True)
    info = robot.publish("/cam/camera_info", "sensor_msgs/msg/CameraInfo", latched=True)
    from orbslam2py.ros.types import to_cdr  # noqa: PLC0415

    image.send(to_cdr(raw_image(np.zeros((24, 32), np.uint8), "mono8")))
    info.send(to_cdr(camera_info((32, 24))))
    assert words
    try:
        sensor = () if "--sensor" in options else ("--sensor", "mono")
        done = run_here("run", f"ros2:{domain}", *sensor, "--output", "out", *options)
    finally:
        robot.close()
    _refused(done, *said)


_OTHERS = {"words": "std_msgs/msg/String", "silent": "sensor_msgs/msg/Image"}


@pytest.mark.parametrize(
    ("arguments", "package", "module", "extra"),
    [
        (("ros2:0",), "cyclonedds", "orbslam2py.ros.dds", "ros2"),
        (("zenoh:",), "zenoh", "orbslam2py.ros.zenoh", "ros2"),
        (("BAG", "--foxglove"), "foxglove", "orbslam2py.ros.foxglove", "foxglove"),
        (("BAG", "--record", "a.mcap"), "foxglove", "orbslam2py.ros.foxglove", "foxglove"),
        (("BAG", "--publish", "ros2:"), "cyclonedds", "orbslam2py.ros.dds", "ros2"),
    ],
)
def test_a_package_that_is_missing_is_named(
    run_here: CommandLine,
    monkeypatch: pytest.MonkeyPatch,
    bag: Path,
    arguments: tuple[str, ...],
    package: str,
    module: str,
    extra: str,
) -> None:
    real: Any = importlib.import_module

    def import_module(name: str, *more: Any) -> Any:
        if name == module:
            raise ModuleNotFoundError(f"No module named '{package}'", name=package)
        return real(name, *more)

    monkeypatch.setattr(importlib, "import_module", import_module)
    given = [str(bag) if one == "BAG" else one for one in arguments]
    _refused(
        run_here("run", *given, "--output", "out"),
        f"needs the package {package}, which is not installed",
        f'pip install "orbslam2py[{extra}]"',
    )


def test_a_computer_without_wheels_of_cyclone_is_told_of_zenoh(
    run_here: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    real: Any = importlib.import_module

    def import_module(name: str, *more: Any) -> Any:
        if name == "orbslam2py.ros.dds":
            raise ModuleNotFoundError("No module named 'cyclonedds'", name="cyclonedds")
        return real(name, *more)

    monkeypatch.setattr(importlib, "import_module", import_module)
    monkeypatch.setattr("platform.machine", lambda: "aarch64")
    _refused(run_here("run", "ros2:0"), "RMW_IMPLEMENTATION=rmw_zenoh_cpp", "take zenoh:")
