# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py run`` with an IMU, right and wrong."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

QUICK = ("--no-report", "--max-frames", "3", "--output", "out")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Two seconds of shaking, with the files of an IMU."""
    options = SyntheticOptions(
        world="room", sensor="rgbd", frames=60, size=(320, 240), motion="shakes", pace=3, imu=True
    )
    return SyntheticSequence(options).write(tmp_path_factory.mktemp("imu") / "made")


@pytest.fixture
def made(recorded, tmp_path, monkeypatch):
    shutil.copytree(recorded, tmp_path / "made")
    monkeypatch.chdir(tmp_path)
    return Path("made")


def report():
    return json.loads(Path("out/report.json").read_text())


def test_the_imu_of_the_recording_is_used(command, made):
    done = command("run", str(made), *QUICK)
    assert done.code == 0, done.err
    assert "IMU" in done.out
    assert report()["imu"]["verdict"] == "unknown"
    assert report()["imu"]["samples"] >= 20


def test_it_may_be_left_out(command, made):
    (made / "imu.csv").write_text("broken\n")
    done = command("run", str(made), "--no-imu", *QUICK)
    assert done.code == 0, done.err
    assert "IMU" not in done.out + done.err
    assert report()["imu"] is None


def test_a_broken_table_does_not_stop_a_run_that_did_not_ask_for_it(command, made):
    (made / "imu.csv").write_text("broken\n")
    done = command("run", str(made), *QUICK)
    assert done.code == 0, done.err
    assert "the IMU is not used" in done.err
    assert report()["tracked"] == 3


def test_a_fault_is_told_and_the_camera_goes_on(command, made):
    lines = (made / "imu.csv").read_text().splitlines()
    rows = np.array([[float(field) for field in line.split(",")] for line in lines[1:]])
    rows[:, 1:4] *= 180 / np.pi
    (made / "imu.csv").write_text(
        "\n".join([lines[0], *(",".join(map(repr, row)) for row in rows.tolist())]) + "\n"
    )
    done = command("run", str(made), "--deterministic", "--no-report", "--output", "out")
    assert done.code == 0, done.err
    said = "the IMU does not fit the camera, and its use is held back: "
    assert done.err.count(said) == 1
    assert "it is in degrees per second; multiply by 0.0174533" in " ".join(done.err.split())
    assert report()["imu"]["verdict"] == "held back"
    assert [fault["kind"] for fault in report()["imu"]["faults"]] == ["degrees"]
    assert report()["tracked"] == 60


WRONG = {
    "no settings": (["--imu"], ["imu.yaml"], "nothing is known of the IMU", "--imu-settings FILE"),
    "no samples": (["--imu"], ["imu.csv"], "has no samples of an IMU", "--imu-samples FILE"),
    "no file": (["--imu-settings", "none.yaml"], [], "none.yaml", "check the path"),
    "no table": (["--imu-samples", "none.csv"], [], "none.csv", "check the path"),
    "no IMU file": (
        ["--imu-settings", "made/rgb.txt"],
        [],
        "contains nothing about an IMU",
        "Kalibr",
    ),
    "no chip": (["--imu-settings", "made/imu.yaml", "--imu-noise", "xyz1"], [], "xyz1", "bmi088"),
    "unit alone": (["--accel-unit", "g"], [], "--accel-unit", "give it, or leave"),
    "table without": (
        ["--no-imu", "--imu-samples", "made/imu.csv"],
        [],
        "--no-imu leaves the IMU out",
        "leave out one",
    ),
    "three tables": (3 * ["--imu-samples", "made/imu.csv"], [], "--imu-samples is given 3", "one"),
    "two of one": (
        2 * ["--imu-samples", "made/imu.csv"],
        [],
        "neither its header nor its name says",
        "name the file gyro.csv or accelerometer.csv",
    ),
    "wrong unit": (
        ["--imu-samples", "made/imu.csv", "--gyro-unit", "rpm"],
        [],
        "rpm",
        "deg/s",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_wrong_input_is_told(command, made, name):
    arguments, missing, thing, remedy = WRONG[name]
    for file in missing:
        (made / file).unlink()
    before = sorted(path.name for path in made.iterdir())
    done = command("run", str(made), *arguments, *QUICK)
    told = " ".join(done.err.replace("│", " ").split())
    assert done.code == 2, told
    assert thing in told
    assert remedy in told
    assert not Path("out").exists()
    assert sorted(path.name for path in made.iterdir()) == before
