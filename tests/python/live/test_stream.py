# SPDX-License-Identifier: BSD-3-Clause
"""The mechanism of live sources, driven by a camera with faults."""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, SettingsError, StateError
from orbslam2py.datasets import LiveFrame
from orbslam2py.live import LiveStream, stream
from orbslam2py.live.rate import RateWatch
from orbslam2py.settings import Settings, builtin_settings
from support.faulty_camera import SIZE, Faults, FaultyCamera

pytestmark = pytest.mark.watchdog(60)


def _settings(rate: float = 100.0) -> Settings:
    found = builtin_settings("euroc", Sensor.STEREO)
    camera = replace(found.camera, width=SIZE[1], height=SIZE[0], fps=rate)
    return replace(found, camera=camera, rectification=None)


SETTINGS = _settings()


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "SILENCE", 0.4)
    monkeypatch.setattr(stream, "_RETRY", 0.02)
    monkeypatch.setattr(stream, "_WAIT_SLICE", 0.02)
    # A computer that runs tests may be too busy to be in time.
    monkeypatch.setattr("orbslam2py.live.rate._WINDOW", 1e9)


def frames_of(camera: FaultyCamera, **options: object) -> tuple[list[LiveFrame], LiveStream]:
    """Read all frames as they come."""
    options = {"settings": SETTINGS, "room": 1000, **options}
    source = LiveStream(camera, **options)  # type: ignore[arg-type]
    frames = []
    with source:
        while not camera.done.is_set():
            frames += [frame] if (frame := source.take(0.05)) else []
        while (frame := source.take(0.15)) is not None:
            frames.append(frame)
    return frames, source


def check_nothing_is_lost(
    camera: FaultyCamera, source: LiveStream, frames: list[LiveFrame]
) -> None:
    """See that each delivery is in a frame, or counted as what became of it."""
    counts = source.counts()
    n_images = camera.delivered["left"] + camera.delivered["right"]
    gone = ("images_alone", "images_late", "images_of_other_size", "images_broken")
    in_pairing = sum(len(queue) for queue in source._inlet.pairing._waiting.values())
    assert n_images == 2 * counts["frames"] + sum(counts[name] for name in gone) + in_pairing
    assert counts["frames"] == len(frames) + counts["frames_dropped"]
    taken = sum(len(frame.imu) for frame in frames if frame.imu is not None)
    left = len(source._inlet.imu_queue.take(np.inf)) + len(source._inlet._join._gyro)
    assert camera.delivered["imu"] == taken + left + counts["imu_samples_left_out"]
    times = np.array([frame.timestamp for frame in frames])
    assert (np.diff(times) > 0).all()
    samples = np.vstack([frame.imu for frame in frames if frame.imu is not None])
    assert (np.diff(samples[:, 0]) > 0).all()
    for frame in frames:
        assert frame.imu is not None
        assert (frame.imu[:, 0] <= frame.timestamp + 1e-6).all()
        # The two images are of one moment.
        assert frame.images.right is not None
        assert frame.images.right[0, 0] == frame.images.image[0, 0] + 50


def numbers_of(frames: list[LiveFrame]) -> list[int]:
    return [int(frame.images.image[0, 0]) for frame in frames]


def test_a_camera_without_faults() -> None:
    camera = FaultyCamera(60)
    frames, source = frames_of(camera)
    check_nothing_is_lost(camera, source, frames)
    assert numbers_of(frames) == list(range(60))
    assert source.doubts == []
    assert source.sensor is Sensor.STEREO
    assert (source.name, source.layout, source.has_imu) == ("made_1", "made", True)
    assert abs(frames[0].timestamp - time.time()) < 60
    for before, frame in itertools.pairwise(frames):
        assert frame.imu is not None and before.stamp is not None and frame.stamp is not None
        np.testing.assert_allclose(frame.imu[:, 1:], np.tile([0.1, 0.2, 0.3, 1, 2, 9.8], (4, 1)))
        # Stamps of the device, shifted by the same time, of images and samples.
        shift = frame.timestamp - frame.stamp
        assert shift == pytest.approx(before.timestamp - before.stamp, abs=2e-6)
        assert frame.imu[-1, 0] == pytest.approx(frame.timestamp, abs=2e-6)
    times = frames[-1].times
    assert times is not None and times.exposure is not None
    assert times.exposure < times.arrival <= times.complete <= times.taken <= times.ready
    assert times.arrival - times.exposure == pytest.approx(0.002, abs=0.002)


def test_a_gyro_and_an_accelerometer_apart() -> None:
    camera = FaultyCamera(30, separate=True)
    frames, source = frames_of(camera)
    check_nothing_is_lost(camera, source, frames)
    assert source.counts()["imu_samples_left_out"] == 0
    assert all(frame.imu is not None and len(frame.imu) == 4 for frame in frames)
    np.testing.assert_allclose(frames[5].imu[:, 4:], np.tile([1, 2, 9.8], (4, 1)))  # type: ignore[index]


FAULTS = {
    "one side missing": (
        Faults(drops={10: "left", 20: "right", 21: "right"}),
        {"images_alone": 3, "frames_apart": 0},
        "sent no left image at the time of a right image, which is dropped",
    ),
    "skew": (
        Faults(skews={30: 0.008, 31: 0.002}),
        {"frames_apart": 1, "images_alone": 2},
        "8.0 ms apart; the limit",
    ),
    "jitter": (Faults(delays=dict.fromkeys(range(10, 50, 7), 0.03)), {"frames": 80}, None),
    "doubled": (Faults(doubled=frozenset({15, 40})), {"images_late": 4}, "is not after the one"),
    "clock ahead": (Faults(jumps={25: 3600.0}), {"clock_jumps": 1}, "jumped ahead by 3.6e+03 s"),
    "clock back": (Faults(jumps={25: -5.0}), {"clock_jumps": 1}, "jumped back by 5"),
    "clock to and fro": (Faults(jumps={25: 100.0, 50: -100.0}), {"clock_jumps": 2}, "jumped ahead"),
    "other size": (
        Faults(other_size=frozenset(range(30, 40))),
        {"images_of_other_size": 20, "restarts": 0},
        "sends left images of 32 x 48 pixels, and sent 32 x 24 before",
    ),
    "pulled": (Faults(pulled={30: 3}), {"restarts": 4}, "was unplugged; waiting for it"),
    "silent": (Faults(silent=frozenset({30})), {"restarts": 1}, "has sent no image for"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_faults_are_reported_and_bridged(name: str, caplog: pytest.LogCaptureFixture) -> None:
    faults, counts, message = FAULTS[name]
    camera = FaultyCamera(80, 50 if name == "skew" else 100, faults)
    with caplog.at_level(logging.WARNING):
        frames, source = frames_of(camera)
    check_nothing_is_lost(camera, source, frames)
    told = source.counts()
    assert {key: told[key] for key in counts} == counts
    assert numbers_of(frames)[-1] == 79  # it went on to the end
    if message is None:
        assert source.doubts == []
    else:
        assert any(message in record.getMessage() for record in caplog.records)
        assert any(message in doubt for doubt in source.doubts)
    if told["restarts"]:
        assert "is back after" in source.doubts[-1]
        assert told["seconds_lost"] > 0


@pytest.mark.parametrize("restarts_clock", [True, False])
def test_times_go_on_over_a_restart(restarts_clock: bool) -> None:
    camera = FaultyCamera(60, faults=Faults(pulled={30: 2}), restarts_clock=restarts_clock)
    begin = time.time()
    frames, source = frames_of(camera)
    check_nothing_is_lost(camera, source, frames)
    away = frames[31].timestamp - frames[30].timestamp
    assert away == pytest.approx(source.counts()["seconds_lost"], abs=0.3)
    assert begin < frames[0].timestamp < frames[-1].timestamp < time.time() + 0.1
    assert source.counts()["clock_jumps"] == 0


def test_clock_jump_keeps_pairs_and_rate() -> None:
    """Times after a jump go on by the clock of this computer; pairs are not torn apart."""
    camera = FaultyCamera(60, faults=Faults(jumps={30: -1000.0}))
    frames, source = frames_of(camera)
    assert numbers_of(frames) == list(range(60))
    steps = np.diff([frame.timestamp for frame in frames])
    assert abs(steps[29] - 0.01) < 0.02
    assert source.counts()["worst_skew_ms"] == 0


def test_full_queue_drops_the_oldest_image_and_no_sample() -> None:
    camera = FaultyCamera(40, rate=200)
    source = LiveStream(camera, settings=SETTINGS, room=3)
    with source:
        camera.done.wait(10)
        frames = []
        while (frame := source.take(0.15)) is not None:
            frames.append(frame)
    assert numbers_of(frames) == [37, 38, 39]
    assert source.n_dropped == 37
    assert [len(frame.imu) for frame in frames] == [152, 4, 4]  # type: ignore[arg-type]


def test_frames_wait_for_their_samples() -> None:
    """Samples that come a little later than the image belong to it."""
    camera = FaultyCamera(1)
    source = LiveStream(camera, settings=SETTINGS)
    with source:
        camera.done.wait(10)
        assert source.take(1.0) is not None
        inlet, stamp = source._inlet, 12.5
        for side in ("left", "right"):
            inlet.image(side, FaultyCamera.image(7, side), stamp)  # type: ignore[arg-type]
        assert source.take(0.01) is None
        inlet.imu(np.array([[stamp - 0.001, 0, 0, 0, 0, 0, 9.8], [stamp + 0.001, *[0] * 6]]))
        frame = source.take(0.01)
    assert frame is not None and frame.imu is not None and len(frame.imu) == 1
    assert source.counts()["imu_samples"] == 6


def test_slow_camera_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py.live.rate._WINDOW", 0.2)
    faults = Faults(slow=dict.fromkeys(range(10, 30), 4.0))
    _, source = frames_of(FaultyCamera(40, rate=50, faults=faults), settings=_settings(50))
    assert any("frames per second; the settings say 50 (Camera.fps)" in d for d in source.doubts)
    assert source.counts()["slow_periods"] >= 1


def test_rate_that_falls_and_recovers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbslam2py.live.rate._WINDOW", 3.0)
    watch = RateWatch(30)
    steps = [1 / 30] * 200 + [1 / 10] * 100 + [1 / 30] * 200
    told = [text for now in np.cumsum(steps) if (text := watch.add(float(now))) is not None]
    assert len(told) == 2
    assert told[0].startswith("delivers 1") and "the settings say 30 (Camera.fps)" in told[0]
    assert told[1] == "delivers 30.0 frames per second again"
    assert watch.lowest == pytest.approx(10, abs=0.2)


def test_one_side_that_stays_away() -> None:
    """Nothing comes that could be tracked: the device is started again."""
    camera = FaultyCamera(200, faults=Faults(drops=dict.fromkeys(range(20, 70), "right")))
    frames, source = frames_of(camera)
    check_nothing_is_lost(camera, source, frames)
    assert any("sent no right image at the time of a left" in doubt for doubt in source.doubts)
    assert any("has sent no right image for" in doubt for doubt in source.doubts)
    assert source.counts()["restarts"] >= 1


def test_patience_ends() -> None:
    camera = FaultyCamera(60, faults=Faults(pulled={10: 10**6}))
    with (
        LiveStream(camera, settings=SETTINGS, patience=0.3) as source,
        pytest.raises(DatasetError, match="made:1 was lost and did not come back"),
    ):
        for _ in source:
            pass


def test_a_device_that_hangs_does_not_hang_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "_PATIENCE", 0.1)
    camera = FaultyCamera(5)
    go_on = []

    def hang() -> None:
        while not go_on:
            time.sleep(0.01)

    camera.stop = hang  # type: ignore[method-assign]
    begin = time.monotonic()
    with LiveStream(camera, settings=SETTINGS) as source:
        assert source.take(1.0) is not None
    assert time.monotonic() - begin < 2
    go_on.append(True)


def test_wrong_use() -> None:
    camera = FaultyCamera(5)
    with pytest.raises(SettingsError, match=r"no settings for made:1.*orbslam2py calibrate"):
        LiveStream(camera)
    with pytest.raises(DatasetError, match="made:1 has no rgbd images; it can be used as: stereo"):
        LiveStream(camera, "rgbd", settings="tum1")
    source = LiveStream(camera, settings=SETTINGS)
    with pytest.raises(StateError, match="open made:1 first"):
        source.take(0.0)
    with source, pytest.raises(StateError, match="is open already"):
        source.__enter__()


@pytest.fixture
def lossy() -> Iterator[FaultyCamera]:
    rng = np.random.default_rng(5)
    several = {
        "drops": {int(k): str(rng.choice(["left", "right"])) for k in rng.integers(5, 250, 20)},
        "skews": {int(k): 0.0048 * rng.random() for k in rng.integers(5, 250, 30)},
        "delays": {int(k): 0.02 * rng.random() for k in rng.integers(5, 250, 20)},
        "jumps": {60: -20.0, 140: 1e5, 141: -1e5},
        "pulled": {100: 2, 200: 0},
        "doubled": frozenset({33, 34, 150}),
        "other_size": frozenset({20, 21, 180}),
    }
    yield FaultyCamera(260, rate=100, faults=Faults(**several), separate=True)  # type: ignore[arg-type]


def test_all_faults_at_once(lossy: FaultyCamera) -> None:
    frames, source = frames_of(lossy)
    check_nothing_is_lost(lossy, source, frames)
    assert len(frames) > 150
    assert numbers_of(frames)[-1] == 259 % 200
    assert source.counts()["clock_jumps"] == 3
    assert source.counts()["restarts"] == 4
