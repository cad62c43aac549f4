# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU on their way into the pipeline: by `track`, `add_imu` and `run`."""

from __future__ import annotations

import logging
import threading
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, System
from orbslam2py.settings import ImuSettings
from orbslam2py.slam.inertial import ImuInterval
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(60)

OPTIONS = SyntheticOptions(
    world="room", sensor="rgbd", frames=8, size=(320, 240), motion="shakes", pace=2, imu=True
)


@pytest.fixture(scope="module")
def made() -> SyntheticSequence:
    return SyntheticSequence(OPTIONS)


def system_for(made: SyntheticSequence, **options: Any) -> System:
    given = {"imu": made.imu_settings(), "deterministic": True, **options}
    return System(made.settings, made.sensor, **given)


def check(interval: ImuInterval | None, made: SyntheticSequence, index: int) -> None:
    """The interval of a frame holds the samples since the one before."""
    samples = made.imu()
    assert interval is not None and samples is not None
    begin, end = made.timestamps[index - 1 : index + 1]
    assert (interval.begin, interval.end) == (begin, end)
    inside = (samples.timestamps > begin + 1e-6) & (samples.timestamps < end - 1e-6)
    np.testing.assert_allclose(interval.samples[1:-1], samples.data[inside])
    at_end = [np.interp(end, samples.timestamps, row) for row in samples.data.T[1:]]
    np.testing.assert_allclose(interval.samples[-1, 1:], at_end)


def test_samples_come_with_their_image(made: SyntheticSequence) -> None:
    with system_for(made) as slam:
        for frame in made:
            slam.track(frame.images, frame.timestamp, imu=frame.imu)
            if frame.index:
                check(slam.pipeline.inertial.interval, made, frame.index)


def test_samples_come_in_one_or_from_another_thread(made: SyntheticSequence) -> None:
    samples = made.imu()
    assert samples is not None
    with system_for(made) as slam:

        def add() -> None:
            for row in samples.data[::-1]:
                slam.add_imu(row)

        thread = threading.Thread(target=add)
        thread.start()
        thread.join()
        slam.run(islice(made, 3))
        check(slam.pipeline.inertial.interval, made, 2)


def test_an_image_that_is_refused_keeps_its_samples(made: SyntheticSequence) -> None:
    samples = made.imu()
    assert samples is not None
    begin, between, end = (float(made.timestamps[k]) for k in range(3))
    with system_for(made) as slam:
        slam.track(made.load(0), begin, imu=samples.since(None, begin))
        with pytest.raises(ImageError):
            slam.track(made.load(0).image[:30], between, imu=samples.since(begin, between))
        slam.track(made.load(2), end, imu=samples.since(between, end))
        interval = slam.pipeline.inertial.interval
    assert interval is not None and interval.is_complete
    assert (interval.begin, interval.end) == (begin, end)


def test_a_reset_begins_anew(made: SyntheticSequence) -> None:
    with system_for(made) as slam:
        slam.run(islice(made, 3))
        slam.reset()
        slam.run(islice(made, 1))
        assert slam.pipeline.inertial.interval is None


def test_samples_of_an_unknown_imu(
    made: SyntheticSequence, caplog: pytest.LogCaptureFixture
) -> None:
    with system_for(made, imu=None) as slam:
        for frame in islice(made, 3):
            slam.track(frame.images, frame.timestamp, imu=frame.imu)
    told = [r.getMessage() for r in caplog.records if r.levelno >= logging.WARNING]
    assert len(told) == 1 and "read_imu_settings" in told[0]


def test_a_wrong_array_changes_nothing(made: SyntheticSequence) -> None:
    with system_for(made) as slam:
        with pytest.raises(DatasetError, match=r"\(n, 7\)"):
            slam.track(made.load(0), 1.0, imu=np.zeros((3, 6)))
        with pytest.raises(DatasetError, match=r"\(n, 7\)"):
            slam.add_imu("samples.csv")
        slam.track(made.load(0), 1.0)
        assert slam.pipeline.recorder.trajectory().timestamps.tolist() == [1.0]


def test_the_settings_file_may_describe_the_imu(made: SyntheticSequence, tmp_path: Path) -> None:
    path = tmp_path / "all.yaml"
    told = "IMU.NoiseGyro: 1e-3\nIMU.NoiseAcc: 1e-2\nIMU.GyroWalk: 1e-5\nIMU.AccWalk: 1e-4\n"
    T_bc = "[1.0, 0.0, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]"
    place = f"IMU.T_b_c1: !!opencv-matrix\n  rows: 4\n  cols: 4\n  dt: d\n  data: {T_bc}\n"
    path.write_text(made.settings.to_yaml() + told + place)
    with System(path, made.sensor) as slam:
        found = slam.pipeline.inertial.settings
    assert isinstance(found, ImuSettings)
    assert found.gyro_noise == 1e-3
    assert found.T_ci[0, 3] == -0.1
    path.write_text(made.settings.to_yaml() + told)  # without a place it is of no use
    with System(path, made.sensor) as slam:
        assert slam.pipeline.inertial.settings is None


def test_frames_of_a_recording_have_their_samples(made: SyntheticSequence) -> None:
    samples = made.imu()
    assert samples is not None
    rows = [frame.imu for frame in made]
    joined = np.concatenate([one for one in rows if one is not None])
    np.testing.assert_array_equal(joined, samples.data[: len(joined)])
    assert joined[-1, 0] >= samples.data[-1, 0] - 1e-9
    without = SyntheticSequence(SyntheticOptions(world="room", frames=2, size=(320, 240)))
    assert [frame.imu for frame in without] == [None, None]
