# SPDX-License-Identifier: BSD-3-Clause
"""Recordings of live sources: lossless, and the same poses again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from orbslam2py import DatasetError, OutputFileError, Sensor, System, run_sequence
from orbslam2py.datasets import LiveFrame, imu_of, open_recorded
from orbslam2py.live import InputRecorder, LiveStream, Stream, recorder
from orbslam2py.runs import RunOptions, SystemOptions
from orbslam2py.settings import Settings
from support import small_sequences as small
from support.faulty_camera import FaultyCamera

mcap_reader = pytest.importorskip("mcap.reader", reason="pip install orbslam2py[bags]")
pytestmark = pytest.mark.watchdog(100)

N = 20


def rendered(sensor: Sensor) -> FaultyCamera:
    """A camera that delivers the images of a synthetic sequence."""

    def image(number: int, stream: Stream) -> np.ndarray:
        images = small.images(sensor, number)
        return {"right": images.right, "depth": images.depth}.get(stream, images.image)  # type: ignore[return-value]

    streams: dict[Sensor, tuple[Stream, ...]] = {
        Sensor.STEREO: ("left", "right", "imu"),
        Sensor.RGBD: ("image", "depth"),
        Sensor.MONOCULAR: ("image",),
    }
    settings = small.sequence(sensor).settings
    return FaultyCamera(N, 50, streams=streams[sensor], settings=settings, images=image)


def recorded(camera: FaultyCamera, path: Path, **options: object) -> list[LiveFrame]:
    source = LiveStream(camera, room=1000, **options)  # type: ignore[arg-type]
    frames = []
    with source, InputRecorder(path, source) as made:
        while not camera.done.is_set() or len(frames) < made.n_frames:
            frames += [frame] if (frame := source.take(0.1)) else []
    assert made.n_left_out == 0
    return frames


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_the_same_poses_again(sensor: Sensor, tmp_path: Path) -> None:
    """A run over the recording gives the poses of the images of the live source, bit by bit."""
    path = tmp_path / "input.mcap"
    frames = recorded(rendered(sensor), path)
    again = open_recorded(path)
    assert again.sensor is sensor
    assert again.settings == small.sequence(sensor).settings
    assert len(again) == N
    with System(again.settings, sensor, deterministic=True) as slam:
        live = [slam.track(frame.images, frame.timestamp) for frame in frames]
    options = RunOptions(sensor, SystemOptions(deterministic=True))
    done = run_sequence(again, options)
    for row, record, frame in zip(done.result.rows, live, frames, strict=True):
        assert row.record is not None
        assert float(row.timestamp) == frame.timestamp
        np.testing.assert_array_equal(row.record.T_cw, record.T_cw)
    assert sum(record.T_cw is not None for record in live) >= N - 2


def test_raw_images_and_samples(tmp_path: Path) -> None:
    """Images lie in the file before they are rectified, and a public reader reads them."""
    path = tmp_path / "input.mcap"
    camera = rendered(Sensor.STEREO)
    frames = recorded(camera, path)
    with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
        told = {connection.topic: connection.msgcount for connection in reader.connections}
        assert told == {
            "/camera/left/image_raw": N,
            "/camera/right/image_raw": N,
            "/imu": camera.delivered["imu"],
        }
        left = [c for c in reader.connections if c.topic == "/camera/left/image_raw"]
        for k, (connection, _, data) in enumerate(reader.messages(left)):
            message = reader.deserialize(data, connection.msgtype)
            shape = (message.height, message.width)
            pixels = small.images(Sensor.STEREO, k).image
            np.testing.assert_array_equal(message.data.reshape(shape), pixels)
            stamp = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
            assert stamp == pytest.approx(frames[k].timestamp, abs=1e-6)
            assert (message.encoding, message.header.frame_id) == ("mono8", "left")
    samples = imu_of(open_recorded(path))
    assert samples is not None and len(samples) == camera.delivered["imu"]
    live = np.vstack([frame.imu for frame in frames if frame.imu is not None])
    np.testing.assert_allclose(samples.data[: len(live)], live, atol=1e-6)
    with path.open("rb") as stream:
        attached = list(mcap_reader.make_reader(stream).iter_attachments())
    assert [one.name for one in attached] == ["settings.stereo.yaml"]
    text = attached[0].data.decode()
    assert Settings.from_yaml(text, "stereo") == small.sequence(Sensor.STEREO).settings


def test_halves_colours_and_16_bits(tmp_path: Path) -> None:
    pixels = {
        "split": np.arange(24 * 64, dtype=np.uint16).reshape(24, 64).astype(np.uint8),
        "colour": np.arange(24 * 32 * 3, dtype=np.uint16).reshape(24, 32, 3).astype(np.uint8),
    }
    settings = small.sequence(Sensor.STEREO).settings
    camera_settings = replace(settings.camera, width=32, height=24)
    both = replace(settings, camera=camera_settings)
    one = Settings(Sensor.MONOCULAR, camera_settings)
    for name, chosen, split in (("split", both, True), ("colour", one, False)):
        path = tmp_path / f"{name}.mcap"
        camera = FaultyCamera(
            3, streams=("image",), settings=chosen, images=lambda *_, name=name: pixels[name]
        )
        recorded(camera, path, split=split)
        images = open_recorded(path).load(1)
        if split:
            np.testing.assert_array_equal(images.image, pixels[name][:, :32])
            np.testing.assert_array_equal(images.right, pixels[name][:, 32:])
        else:
            np.testing.assert_array_equal(images.image, pixels[name])


def test_a_recording_that_was_cut_off_is_read(tmp_path: Path) -> None:
    path = tmp_path / "input.mcap"
    recorded(rendered(Sensor.STEREO), path)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    opened = open_recorded(path)
    assert 5 < len(opened) < N
    assert opened.settings == small.sequence(Sensor.STEREO).settings


def test_a_slow_disk_is_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recorder, "_MOST_WAITING", 1000)
    camera = rendered(Sensor.STEREO)
    source = LiveStream(camera)
    with source, InputRecorder(tmp_path / "input.mcap", source) as made:
        camera.done.wait(20)
    assert made.n_left_out == N
    assert f"input.mcap lacks {N} frames: the disk was too slow" in caplog.text


def test_wrong_files(tmp_path: Path) -> None:
    source = LiveStream(rendered(Sensor.STEREO))
    with pytest.raises(DatasetError, match=r"input\.bag.*ends with \.mcap"):
        InputRecorder(tmp_path / "input.bag", source)
    with pytest.raises(OutputFileError, match=r"no/input\.mcap"):
        InputRecorder(tmp_path / "no" / "input.mcap", source)
