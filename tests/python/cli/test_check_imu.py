# SPDX-License-Identifier: BSD-3-Clause
"""The command ``orbslam2py check-imu``."""

import re
import shutil

import numpy as np
import pytest

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two seconds of shaking: enough turning to compare."""
    options = SyntheticOptions(
        world="room", sensor="stereo", frames=40, size=(320, 240), motion="shakes", pace=3, imu=True
    )
    return SyntheticSequence(options).write(tmp_path_factory.mktemp("imu") / "made")


def spoilt(made, folder, change):
    shutil.copytree(made, folder)
    table = folder / "mav0" / "imu0" / "data.csv"
    header, *lines = table.read_text().splitlines()
    rows = np.array([[float(field) for field in line.split(",")] for line in lines])
    change(rows)
    text = [",".join([str(int(row[0])), *map(repr, row[1:].tolist())]) for row in rows]
    table.write_text("\n".join([header, *text]) + "\n")
    return folder


def test_right_samples_fit(command, made, tmp_path):
    done = command("check-imu", str(made), "--plot", str(tmp_path / "imu.png"))
    assert done.code == 0, done.out + done.err
    assert "The IMU fits" in done.out
    assert "time offset: +0." in done.out or "time offset: -0." in done.out
    assert (tmp_path / "imu.png").stat().st_size > 10_000


def degrees(rows):
    rows[:, 1:4] *= 180 / np.pi


def gravities(rows):
    rows[:, 4:] /= 9.81


def late(rows):
    rows[:, 0] += 40_000_000


@pytest.mark.parametrize(
    ("change", "kind"), [(degrees, "degrees"), (gravities, "g"), (late, "time_offset")]
)
def test_faults_are_named(command, made, tmp_path, change, kind):
    folder = spoilt(made, tmp_path / "spoilt", change)
    done = command("check-imu", str(folder))
    assert done.code == 1, done.out + done.err
    assert f"Fault ({kind}):" in done.out


def test_a_table_beside_the_recording(command, made, tmp_path):
    rows = np.loadtxt(made / "mav0" / "imu0" / "data.csv", delimiter=",")
    rows[:, 0] /= 1e9
    rows[:, 1:4] = np.degrees(rows[:, 1:4])
    np.savetxt(tmp_path / "phone.csv", rows, delimiter=",")
    table = ("--imu", str(tmp_path / "phone.csv"))
    done = command("check-imu", str(made), *table, "--gyro-unit", "deg/s")
    assert done.code == 0, done.out + done.err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--imu-settings", "none.yaml"], ["none.yaml"]),
        (["--imu", "none.csv"], ["none.csv"]),
        (["--imu", "wrong.csv"], ["wrong.csv:2", "a time and six numbers"]),
        (["--gyro-unit", "deg/s"], ["--gyro-unit", "--imu"]),
        (["--plot", "a.docx"], ["--plot a.docx", ".png"]),
        (["--plot", "kept.png"], ["kept.png exists", "--force"]),
        (["--imu-settings", "wrong.csv"], ["wrong.csv", "contains nothing about an IMU"]),
        (
            ["--imu-settings", "half.yaml", "--imu-noise", "bmi1"],
            ["bmi1", "adis16448"],
        ),
        (["--imu-settings", "half.yaml"], ["half.yaml", "gyro_noise", "--imu-noise"]),
    ],
)
def test_wrong_input(command, made, tmp_path, arguments, said):
    (tmp_path / "wrong.csv").write_text("what is this\n0,1\n")
    (tmp_path / "kept.png").write_text("mine")
    (tmp_path / "half.yaml").write_text("IMU.Frequency: 200\n")
    done = command("check-imu", str(made), *arguments)
    assert done.code == 2
    for text in said:
        assert text in done.out + done.err
    assert (tmp_path / "kept.png").read_text() == "mine"


def test_a_recording_without_an_imu(command, made, tmp_path):
    shutil.copytree(made, tmp_path / "bare", ignore=shutil.ignore_patterns("imu0"))
    done = command("check-imu", "bare")
    assert done.code == 2
    assert "has no samples of an IMU; give a table with --imu-samples FILE" in done.err


@pytest.mark.shared
@pytest.mark.parametrize("name", ["euroc_V1_01_flight90", "euroc_V1_01_rest40"])
def test_euroc(command, shared_data, name):
    done = command("check-imu", str(shared_data / "sequences" / name))
    assert done.code == 0, done.out
    assert "The IMU fits" in done.out
    if name.endswith("flight90"):
        angle = re.search(r"([0-9.]+) degrees from the settings", done.out)
        assert angle is not None
        assert float(angle[1]) < 1.0
