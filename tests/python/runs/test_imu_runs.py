# SPDX-License-Identifier: BSD-3-Clause
"""Runs with an IMU: which samples come with which frame, and when there is none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, SettingsError, run_sequence
from orbslam2py.batches.job import Job
from orbslam2py.batches.jobs import options_of
from orbslam2py.datasets import ImuSamples, LiveFrame
from orbslam2py.runs import RunOptions, SequenceRunner, SystemOptions
from orbslam2py.settings import ImuSettings
from orbslam2py.slam.inertial import ImuBuffer, ImuInterval
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.cameras import Camera

pytestmark = pytest.mark.watchdog(60)

OPTIONS = SyntheticOptions(
    world="room", sensor="rgbd", frames=10, size=(320, 240), motion="shakes", imu=True
)


@pytest.fixture(scope="module")
def made() -> SyntheticSequence:
    return SyntheticSequence(OPTIONS)


@pytest.fixture
def taken(monkeypatch: pytest.MonkeyPatch) -> list[ImuInterval | None]:
    """The intervals that the pipeline took."""
    found: list[ImuInterval | None] = []
    take = ImuBuffer.take

    def watched(self: ImuBuffer, timestamp: float) -> ImuInterval | None:
        found.append(take(self, timestamp))
        return found[-1]

    monkeypatch.setattr(ImuBuffer, "take", watched)
    return found


def run(source: Any, **options: Any) -> Any:
    how = RunOptions("rgbd", SystemOptions(deterministic=True), **options)
    return SequenceRunner(source, source.settings, None, how).run()


def check_all(
    taken: list[ImuInterval | None], samples: ImuSamples, times: list[float], offset: float = 0.0
) -> None:
    """Every interval holds all samples between its images, once."""
    assert len(taken) == len(times)
    for interval, begin, end in zip(taken[1:], times, times[1:], strict=False):
        assert interval is not None and interval.is_complete
        assert (interval.begin, interval.end) == (begin, end)
        t = samples.timestamps - offset
        inside = (t > begin + 1e-6) & (t < end - 1e-6)
        assert len(interval.samples) == inside.sum() + 2
        np.testing.assert_allclose(interval.samples[1:-1, 1:], samples.data[inside, 1:])


@pytest.mark.parametrize("stride", [1, 3])
def test_all_samples_reach_the_system(
    made: SyntheticSequence, taken: list[ImuInterval | None], stride: int
) -> None:
    result = run(made, stride=stride)
    samples = made.imu()
    assert samples is not None
    check_all(taken, samples, made.timestamps[::stride].tolist())
    assert result.imu["samples"] > 80
    assert result.imu["verdict"] == "unknown"
    assert result.warnings == []


def test_the_time_offset_of_the_settings_counts(
    made: SyntheticSequence, taken: list[ImuInterval | None]
) -> None:
    samples, settings = made.imu(), made.imu_settings()
    assert samples is not None and settings is not None
    late = samples.data + np.array([0.1, 0, 0, 0, 0, 0, 0])
    options = {
        "imu_samples": ImuSamples("late", late),
        "imu_settings": replace(settings, time_offset=0.1),
    }
    run(made, **options)
    check_all(taken, ImuSamples("late", late), made.timestamps.tolist(), offset=0.1)


def test_samples_of_dropped_frames_are_not_lost(
    made: SyntheticSequence,
    taken: list[ImuInterval | None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from orbslam2py.runs import feeds  # noqa: PLC0415

    monkeypatch.setattr(feeds._Clock, "must_drop", lambda self, position: position in (2, 3, 6))
    how = RunOptions("rgbd", realtime=True)
    result = SequenceRunner(made, made.settings, None, how).run()
    assert result.n_dropped == 3
    samples = made.imu()
    assert samples is not None
    kept = [t for k, t in enumerate(made.timestamps.tolist()) if k not in (2, 3, 6)]
    check_all(taken, samples, kept)


def test_no_imu(made: SyntheticSequence, taken: list[ImuInterval | None]) -> None:
    result = run(made, imu=False)
    assert taken == []
    assert result.imu is None


class Bare:
    """The images of a sequence, with the IMU that a test wants."""

    def __init__(
        self,
        inner: SyntheticSequence,
        samples: ImuSamples | Exception | None,
        settings: ImuSettings | Exception | None,
    ) -> None:
        self._inner = inner
        self._given = {"imu": samples, "imu_settings": settings}

    def __len__(self) -> int:
        return 3

    def __getattr__(self, name: str) -> Any:
        if name not in self._given:
            return getattr(self._inner, name)

        def give() -> Any:
            given = self._given[name]
            if isinstance(given, Exception):
                raise given
            return given

        return give


MISSING = {
    "no settings": ("imu", None, SettingsError, "nothing is known of the IMU.*--imu-settings FILE"),
    "no samples": (None, "imu_settings", DatasetError, "has no samples.*--imu-samples FILE"),
    "broken samples": (DatasetError("imu.csv:3: bad"), "imu_settings", DatasetError, "imu.csv:3"),
    "broken settings": ("imu", SettingsError("imu.yaml:1: bad"), SettingsError, "imu.yaml:1"),
}


@pytest.mark.parametrize("name", MISSING)
def test_what_is_missing_stops_a_run_only_if_it_was_asked_for(
    made: SyntheticSequence, name: str, caplog: pytest.LogCaptureFixture
) -> None:
    samples, settings, error, said = MISSING[name]
    source: Any = Bare(
        made,
        made.imu() if samples == "imu" else samples,  # type: ignore[arg-type]
        made.imu_settings() if settings == "imu_settings" else settings,  # type: ignore[arg-type]
    )
    with pytest.raises(error, match=said):
        run(source, imu=True)
    assert run(source).n_tracked == 3
    assert ("the IMU is not used: " in caplog.text) == name.startswith("broken")


def test_options_that_contradict_each_other(made: SyntheticSequence) -> None:
    with pytest.raises(DatasetError, match="--no-imu leaves the IMU out"):
        RunOptions("rgbd", imu=False, imu_settings=made.imu_settings())
    with pytest.raises(SettingsError, match=r"imu is 'no'; give True or False"):
        RunOptions("rgbd", imu="no")  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match=r"imu_samples is .* give ImuSamples"):
        RunOptions("rgbd", imu_samples=np.zeros((3, 7)))  # type: ignore[arg-type]


class LiveWithImu(Camera):
    """A camera whose frames bring the samples since the frame before."""

    def imu_settings(self) -> ImuSettings | None:
        return SyntheticSequence(OPTIONS).imu_settings()

    def take(self, timeout: float, /) -> LiveFrame | None:
        frame = super().take(timeout)
        samples = SyntheticSequence(OPTIONS).imu()
        assert samples is not None
        if frame is None:
            return None
        t = samples.data[(samples.timestamps <= frame.timestamp)]
        return replace(frame, imu=t[t[:, 0] > frame.timestamp - 0.0501])


def test_frames_of_a_camera_bring_samples(
    made: SyntheticSequence, taken: list[ImuInterval | None]
) -> None:
    camera = LiveWithImu(made)
    result = SequenceRunner(
        camera, camera.settings, None, RunOptions(Sensor.RGBD, max_frames=4)
    ).run()
    assert result.imu is not None
    assert result.imu["samples"] > 0
    assert len(taken) == 4


def test_a_report_tells_of_the_imu(made: SyntheticSequence, tmp_path: Path) -> None:
    options = RunOptions("rgbd", SystemOptions(deterministic=True), max_frames=3)
    done = run_sequence(made, options, output=tmp_path / "out", report_page=False)
    assert done.report["imu"]["verdict"] == "unknown"
    assert done.report["options"]["imu"] is None


def test_jobs_of_a_batch_may_leave_it_out() -> None:
    for wanted in (True, False):
        job = Job("a", "a", options=options_of({"imu": wanted}))
        assert job.run_options(Sensor.RGBD).imu is wanted
