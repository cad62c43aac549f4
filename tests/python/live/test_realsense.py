# SPDX-License-Identifier: BSD-3-Clause
"""RealSense cameras: the real SDK with its software device, from the device to a trajectory."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, run_sequence
from orbslam2py.datasets import LiveFrame, imu_of, open_recorded
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.live import LiveStream, Request, open_source
from orbslam2py.runs import RunOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.software_realsense import BEGIN, SERIAL, SoftwareRealSense, paced, rs

from orbslam2py.live import realsense  # isort: skip  # after the check that there is the SDK

pytestmark = pytest.mark.watchdog(100)
SIZE, N = (320, 240), 24


@pytest.fixture(autouse=True)
def _busy_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the computer that runs the test be slow."""
    monkeypatch.setattr("orbslam2py.live.inlet._IMU_WAIT", 5.0)
    monkeypatch.setattr("orbslam2py.live.rate._WINDOW", 1e9)


def made_of(sequence: SyntheticSequence, fps: int = 30) -> SoftwareRealSense:
    camera = sequence.camera
    return SoftwareRealSense(
        (camera.fx, camera.fy, camera.cx, camera.cy), SIZE, fps, baseline=sequence.baseline
    )


def sequence_of(sensor: Sensor, **options: object) -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(
            world="corridor",
            sensor=sensor,
            frames=N,
            size=SIZE,
            fps=10,
            **options,  # type: ignore[arg-type]
        )
    )


def stream_of(made: SoftwareRealSense, sensor: Sensor | None, *, imu: bool = False) -> LiveStream:
    request = Request(SERIAL, sensor, imu)
    device = realsense.RealSense(f"realsense:{SERIAL}", made.find, request)
    return LiveStream(device, sensor, room=100)


def played(
    made: SoftwareRealSense, sequence: SyntheticSequence, seconds: float
) -> threading.Thread:
    """Play the images of a sequence in a thread, with their stamps."""
    images = [sequence.load(k) for k in range(len(sequence))]
    samples = sequence.imu()

    def send(k: int) -> None:
        at = 1e3 * float(sequence.timestamps[k] - sequence.timestamps[0])
        if samples is not None:
            until = sequence.timestamps[k] + 0.005
            begin = sequence.timestamps[k - 1] + 0.005 if k else 0.0
            for row in samples.data[(samples.timestamps > begin) & (samples.timestamps <= until)]:
                own = 1e3 * float(row[0] - sequence.timestamps[0])
                made.send_motion("accel", row[4:], own)
                made.send_motion("gyro", row[1:4], own)
        if images[k].right is not None:
            made.send_image("left", images[k].image, at)
            made.send_image("right", images[k].right, at)  # type: ignore[arg-type]
        if images[k].depth is not None:
            colour = cv2.cvtColor(images[k].image, cv2.COLOR_GRAY2BGR)
            made.send_image("image", colour, at)
            # Millimetres: the made-up camera has other units.
            depth = np.round(images[k].depth.astype(float) / 5).astype(np.uint16)  # type: ignore[union-attr]
            made.send_image("depth", depth, at)

    thread = threading.Thread(target=paced, args=(len(images), seconds, send), daemon=True)
    thread.start()
    return thread


def frames_of(source: LiveStream, player: threading.Thread) -> list[LiveFrame]:
    frames = []
    while player.is_alive():
        frames += [frame] if (frame := source.take(0.05)) else []
    while (frame := source.take(0.3)) is not None:
        frames.append(frame)
    return frames


def test_infrared_pair_with_imu() -> None:
    sequence = sequence_of(Sensor.STEREO, imu=True)
    made = made_of(sequence)
    source = stream_of(made, None, imu=True)
    assert source.sensor is Sensor.STEREO
    settings, camera = source.settings, sequence.camera
    np.testing.assert_allclose(
        [settings.camera.fx, settings.camera.fy, settings.camera.cx, settings.camera.cy],
        [camera.fx, camera.fy, camera.cx, camera.cy],
        rtol=1e-6,
    )
    assert (settings.camera.width, settings.camera.height, settings.camera.fps) == (*SIZE, 30)
    assert settings.baseline == pytest.approx(sequence.baseline, rel=1e-6)
    assert settings.rectification is None
    assert source.imu_settings is not None
    np.testing.assert_allclose(source.imu_settings.T_ci[:3, 3], [0.01, 0.02, 0.03], atol=1e-8)
    assert source.imu_settings.rate == 200
    with source:
        # Its dots would move with the camera.
        assert made.stereo.get_option(rs.option.emitter_enabled) == 0
        frames = frames_of(source, played(made, sequence, 0.02))
    assert len(frames) == N
    assert source.doubts == []
    truth = sequence.imu()
    assert truth is not None
    for k, frame in enumerate(frames):
        images = sequence.load(k)
        np.testing.assert_array_equal(frame.images.image, images.image)
        np.testing.assert_array_equal(frame.images.right, images.right)
        at = sequence.timestamps[k] - sequence.timestamps[0]
        assert frame.stamp == pytest.approx(BEGIN / 1e3 + at, abs=1e-6)
        if k == 0:
            continue
        assert frame.imu is not None
        own = (truth.timestamps > sequence.timestamps[k - 1]) & (
            truth.timestamps <= sequence.timestamps[k]
        )
        assert len(frame.imu) == own.sum()
        np.testing.assert_allclose(frame.imu[:, 1:], truth.data[own, 1:], atol=1e-5)


def test_colour_with_registered_depth() -> None:
    sequence = sequence_of(Sensor.RGBD)
    made = made_of(sequence, 10)
    source = stream_of(made, Sensor.RGBD)
    assert source.settings.depth_factor == 1000
    with source:
        assert made.stereo.get_option(rs.option.emitter_enabled) == 1
        frames = frames_of(source, played(made, sequence, 0.05))
    assert len(frames) == N
    assert source.doubts == []
    by_stamp = {round(1e3 * (frame.stamp or 0) - BEGIN): frame for frame in frames}
    for k in range(N):
        frame = by_stamp[round(1e3 * (sequence.timestamps[k] - sequence.timestamps[0]))]
        images = sequence.load(k)
        grey = cv2.cvtColor(frame.images.image, cv2.COLOR_BGR2GRAY)
        np.testing.assert_array_equal(grey, images.image)
        assert frame.images.depth is not None and images.depth is not None
        # One camera is where the other one is.
        apart = np.abs(frame.images.depth.astype(float) - images.depth.astype(float) / 5)
        assert (apart <= 0.51).mean() > 0.9  # the SDK differs at the border and at edges


def test_depth_is_registered_to_colour() -> None:
    """A wall at 1 m, seen by a colour camera 50 mm to the left: 15 pixels to the right."""
    made = SoftwareRealSense((300, 300, 160, 120), SIZE, T_colour_depth=(0.05, 0, 0))
    depth = np.zeros(SIZE[::-1], np.uint16)
    depth[100:140, 100:200] = 1000

    def send(k: int) -> None:
        made.send_image("depth", depth, 33 * k)
        made.send_image("image", np.zeros((*SIZE[::-1], 3), np.uint8), 33 * k)

    source = stream_of(made, Sensor.RGBD)
    with source:
        thread = threading.Thread(target=paced, args=(3, 0.02, send))
        thread.start()
        frames = frames_of(source, thread)
    assert len(frames) == 3
    expected = np.zeros_like(depth)
    expected[100:140, 115:215] = 1000
    seen = frames[0].images.depth
    assert seen is not None
    assert (seen != expected).mean() < 0.005  # the SDK may differ at borders


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_from_the_device_to_a_trajectory(sensor: Sensor, tmp_path: Path) -> None:
    sequence = sequence_of(sensor)
    made = made_of(sequence)
    source = stream_of(made, sensor)
    begun = threading.Event()

    class Player:
        """Plays once the run takes frames."""

        def __enter__(self) -> None:
            played(made, sequence, 0.15)
            begun.set()

        def __exit__(self, *_: object) -> None:
            pass

    done = run_sequence(
        source,
        RunOptions(sensor, max_frames=N - 4),
        output=tmp_path / "run",
        watch=lambda _: Player(),
        report_page=False,
    )
    assert begun.is_set()
    assert done.report["tracked"] >= N - 6
    path, truth = done.trajectory, sequence.ground_truth()
    shift = path.timestamps[0] - truth.timestamps[0]
    figures = evaluate_trajectory(path, replace(truth, timestamps=truth.timestamps + shift))
    assert figures.ate is not None and figures.ate.rmse < 0.03
    text = (tmp_path / "run" / "settings.yaml").read_text()
    assert f"Camera.width: {SIZE[0]}" in text


def test_a_camera_that_lacks_something() -> None:
    made = made_of(sequence_of(Sensor.STEREO))
    for request, message in {
        Request(sensor=Sensor.STEREO, size=(640, 480)): "no images for stereo with 640 x 480",
        Request(sensor=Sensor.STEREO, fps=15): "at 15 frames per second; it has:\n  infrared 1",
    }.items():
        device = realsense.RealSense("realsense:7", made.find, request)
        with pytest.raises(DatasetError, match=f"realsense:7 has .*{message}"):
            _ = device.streams
    with pytest.raises(DatasetError, match="realsense:12 is not there: no RealSense camera"):
        open_source("realsense:12", "stereo")


def test_messages_of_the_sdk(monkeypatch: pytest.MonkeyPatch) -> None:
    usb = realsense.find_usb.__globals__["UsbDevice"]
    plugged = usb("Intel RealSense D435I", Path("/dev/bus/usb/002/003"), False)
    monkeypatch.setattr(realsense, "find_usb", lambda *_: [plugged])
    with pytest.raises(DatasetError, match=r"D435I is plugged in.*99-realsense-libusb\.rules"):
        open_source("realsense:", "stereo")
    assert "99-realsense-libusb.rules" in realsense.find_devices()[0].description
    busy = "xioctl(VIDIOC_S_FMT) failed, errno=16 Last Error: Device or resource busy"
    assert "realsense:1 is in use by another program" in realsense._problem("realsense:1", busy)
    denied = "failed to open usb interface: Permission denied"
    assert "udev rule" in realsense._problem("realsense:1", denied)


def test_own_recordings_are_read(tmp_path: Path) -> None:
    """A recording of the SDK itself, read by our reader of bags."""
    sequence = sequence_of(Sensor.STEREO, imu=True)
    made = made_of(sequence)
    path = tmp_path / "recorded.db3"
    recorder = rs.recorder(str(path), made.device)
    wanted = ("Infrared", "Gyro", "Accel")
    sensors = []
    for sensor in recorder.query_sensors():
        profiles = [p for p in sensor.get_stream_profiles() if p.stream_name()[:5] in str(wanted)]
        if profiles:
            sensor.open(profiles)
            sensor.start(lambda frame: None)
            sensors.append(sensor)
    played(made, sequence, 0.02).join()
    time.sleep(0.3)
    for sensor in sensors:
        sensor.stop()
        sensor.close()
    del sensor, sensors, recorder
    opened = open_recorded(path, "stereo")
    assert len(opened) == N
    np.testing.assert_allclose(np.diff(opened.timestamps), np.diff(sequence.timestamps), atol=1e-6)
    assert opened.settings.baseline == pytest.approx(sequence.baseline, rel=1e-5)
    for k in (0, N - 1):
        np.testing.assert_array_equal(opened.load(k).image, sequence.load(k).image)
        np.testing.assert_array_equal(opened.load(k).right, sequence.load(k).right)
    # Samples by the clock of the images, not by their times of arrival.
    read, truth = imu_of(opened), sequence.imu()
    assert read is not None and truth is not None
    since = read.timestamps - opened.timestamps[0] + sequence.timestamps[0]
    for column in (1, 3, 4, 6):
        expected = np.interp(since, truth.timestamps, truth.data[:, column])
        np.testing.assert_allclose(read.data[:, column], expected, atol=2e-4)
