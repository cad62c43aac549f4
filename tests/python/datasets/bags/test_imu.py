# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU in bags: one topic, two of a RealSense, several, none."""

import logging

import numpy as np
import pytest

from orbslam2py.datasets import BagSequence, imu_of
from support import bags

GREY = bags.raw_image("/cam/image_raw", bags.START, np.full((24, 32), 90, np.uint8), "mono8")
STEP = 5_000_000  # ns


def samples(topic, n=5, step=STEP, gyro=(0.1, 0.2, 0.3), accel=(1, 2, 9.8)):
    return [bags.imu(topic, bags.START + k * step, gyro, accel) for k in range(n)]


def opened(path, kind, *messages):
    return BagSequence(bags.write(path / "b", kind, [GREY, *messages]), "mono")


@pytest.mark.parametrize("kind", bags.KINDS)
def test_one_topic(tmp_path, kind):
    sequence = opened(tmp_path, kind, *samples("/imu0"))
    read = imu_of(sequence)
    assert len(read) == 5
    assert read.timestamps[0] == pytest.approx(sequence.timestamps[0], abs=1e-6)
    assert np.diff(read.timestamps) == pytest.approx(0.005, abs=1e-6)
    assert read.data[3, 1:].tolist() == [0.1, 0.2, 0.3, 1, 2, 9.8]


def test_gyro_and_accelerometer_of_a_realsense(tmp_path):
    gyro = samples("/device_0/sensor_2/Gyro_0/imu/data", 9, accel=(0, 0, 0))
    accel = [
        bags.imu(
            "/device_0/sensor_2/Accel_0/imu/data",
            bags.START + 4 * k * STEP,
            (0, 0, 0),
            (k, 0, 9.8),
        )
        for k in range(3)
    ]
    read = opened(tmp_path, "mcap", *gyro, *accel).imu()
    assert len(read) == 9
    assert read.gyro[4].tolist() == [0.1, 0.2, 0.3]
    assert read.accel[:, 0] == pytest.approx(np.arange(9) / 4, abs=1e-4)


def test_of_several_the_longest_is_taken_with_a_warning(tmp_path, caplog):
    messages = [*samples("/imu/a", 3), *samples("/imu/b", 6, accel=(5, 5, 5))]
    with caplog.at_level(logging.WARNING):
        read = opened(tmp_path, "mcap", *messages).imu()
    assert read.accel[0].tolist() == [5, 5, 5]
    assert "of the IMUs /imu/a, /imu/b that with the most messages is taken, /imu/b" in caplog.text


def test_without_an_imu(tmp_path, caplog):
    assert opened(tmp_path / "none", "mcap").imu() is None
    with caplog.at_level(logging.WARNING):
        assert opened(tmp_path / "half", "mcap", *samples("/gyro/sample")).imu() is None
    assert "cannot distinguish gyro and accelerometer of /gyro/sample" in caplog.text
