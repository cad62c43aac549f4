# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU beside a synthetic camera."""

import json

import numpy as np
import pytest

from orbslam2py import SettingsError
from orbslam2py import _core as core
from orbslam2py.datasets import open_sequence
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.synthetic.imu import T_CI
from orbslam2py.synthetic.spline import PoseSpline

SMALL = {"frames": 30, "size": (64, 64)}


def sequence(**options):
    return SyntheticSequence(SyntheticOptions(**(SMALL | {"imu": True} | options)))


@pytest.mark.parametrize(
    "options",
    [{"world": "room"}, {"world": "corridor", "motion": "shakes"}, {"motion": "stairs", "pace": 2}],
)
def test_the_samples_lead_from_image_to_image(options):
    made = sequence(**options)
    samples = made.imu()
    T_wi = made.ground_truth().T_wc @ T_CI
    t = made.timestamps
    path = PoseSpline(t, T_wi)
    h = 1e-5
    assert path.poses(t) == pytest.approx(T_wi, abs=1e-12)
    for i in (3, 15, 26):
        before, after = path.poses(np.array([t[i] - h, t[i] + h]))
        velocity = (after[:3, 3] - before[:3, 3]) / (2 * h)
        at = core.Preintegration(
            samples.data, gyro_noise=1e-4, accel_noise=1e-3, begin=t[i], end=t[i + 1]
        )
        T_wb, _ = at.predict(core.Pose.from_matrix(T_wi[i]), velocity, np.array([0, 9.81, 0]))
        assert T_wb.matrix == pytest.approx(T_wi[i + 1], abs=5e-4)


def test_noise_of_a_chip():
    exact, noisy, again = sequence(), sequence(imu_noise="mpu6050"), sequence(imu_noise="mpu6050")
    errors = noisy.imu().data[:, 1:] - exact.imu().data[:, 1:]
    assert np.array_equal(noisy.imu().data, again.imu().data)
    assert errors[:, :3].std(axis=0) == pytest.approx(np.radians(0.005) * np.sqrt(200), rel=0.2)
    assert np.abs(errors.mean(axis=0)).max() > 1e-3
    assert noisy.imu_settings().gyro_noise == pytest.approx(np.radians(0.005))


def test_without_an_imu_nothing_changes(tmp_path):
    made = sequence(imu=False, frames=3, sensor="mono")
    assert made.imu() is None
    assert made.imu_settings() is None
    folder = made.write(tmp_path / "a", "euroc")
    assert "imu" not in json.loads((folder / "synthetic.json").read_text())
    assert not (folder / "mav0" / "imu0").exists()
    beside = sequence(frames=3, sensor="mono").write(tmp_path / "b")
    images = sorted((folder / "mav0" / "cam0" / "data").iterdir())
    others = sorted((beside / "mav0" / "cam0" / "data").iterdir())
    assert [one.read_bytes() for one in images] == [one.read_bytes() for one in others]


@pytest.mark.parametrize(
    ("sensor", "layout"),
    [("mono", None), ("stereo", "euroc"), ("rgbd", None), ("mono", "tum"), ("stereo", "kitti")],
)
def test_what_is_written_is_read(tmp_path, sensor, layout):
    made = sequence(frames=5, sensor=sensor, imu_noise="bmi088")
    folder = made.write(tmp_path / "made", layout)
    opened = open_sequence(folder, sensor)
    assert opened.imu().data == pytest.approx(made.imu().data, abs=1e-9)
    settings = opened.imu_settings()
    assert settings.T_ci == pytest.approx(T_CI)
    assert settings.rate == 200
    assert settings.accel_noise == made.imu_settings().accel_noise


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"imu": False, "imu_noise": "bmi088"}, "give imu"),
        ({"imu_noise": "bmi1"}, "there are adis16448"),
        ({"pieces": 2}, "jumps between pieces"),
        ({"imu": 1}, "give True or False"),
    ],
)
def test_wrong_options(options, message):
    with pytest.raises(SettingsError, match=message):
        sequence(**options)


def test_layouts_without_a_place_for_it(tmp_path):
    with pytest.raises(SettingsError, match="without an IMU; take euroc"):
        sequence(frames=3).write(tmp_path / "bag", "mcap")
    with pytest.raises(SettingsError, match="3 frames or more"):
        sequence(frames=2, sensor="mono").write(tmp_path / "short")
    assert not list(tmp_path.iterdir())
