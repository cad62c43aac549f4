# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU in videos: the track of GoPro cameras, and tables beside a video."""

from __future__ import annotations

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import VideoSequence, read_gopro_imu
from orbslam2py.settings import CameraSettings, Settings

SETTINGS = Settings(Sensor.MONOCULAR, CameraSettings(fx=100, fy=100, cx=64, cy=48, fps=10))
N, SECONDS = 20, 3  # samples in a payload, payloads of one second


def item(key: str, kind: str, size: int, content: bytes) -> bytes:
    head = key.encode() + struct.pack(">BBH", ord(kind) if kind else 0, size, len(content) // size)
    return head + content + bytes(-len(content) % 4)


def nested(key: str, *parts: bytes) -> bytes:
    return item(key, "", 1, b"".join(parts))


def stream(name: str, rows: FloatArray, scale: int, orientation: str | None) -> bytes:
    whole = np.round(rows * scale).astype(">i2").tobytes()
    parts = [item("STNM", "c", 1, b"made up"), item("SCAL", "s", 2, struct.pack(">h", scale))]
    if orientation is not None:
        parts.append(item("ORIN", "c", 1, orientation.encode()))
    return nested("STRM", *parts, item(name, "s", 6, whole))


def payload(gyro: FloatArray, accel: FloatArray, orientation: str | None) -> bytes:
    return nested(
        "DEVC",
        item("DVNM", "c", 1, b"Camera"),
        stream("ACCL", accel, 417, orientation),
        stream("GYRO", gyro, 939, orientation),
    )


def box(name: str, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack(">I4s", 8 + len(content), name.encode()) + content


def full(name: str, *numbers: int) -> bytes:
    return box(name, bytes(4), struct.pack(f">{len(numbers)}I", *numbers))


def with_track(video: Path, payloads: list[bytes]) -> None:
    """Append the track to a video: a second ``moov``, with the payloads before it."""
    at = video.stat().st_size + 8
    # Two chunks: the first one holds all payloads but one.
    places = [at, at + sum(map(len, payloads[:-1]))]
    tables = box(
        "stbl",
        box("stsd", bytes(4), struct.pack(">II4s", 1, 16, b"gpmd"), bytes(8)),
        full("stts", 1, len(payloads), 1000),
        full("stsc", 2, 1, len(payloads) - 1, 1, 2, 1, 1),
        full("stsz", 0, len(payloads), *map(len, payloads)),
        full("stco", 2, *places),
    )
    head = full("mdhd", 0, 0, 1000, 1000 * len(payloads), 0)
    with video.open("ab") as file:
        file.write(box("mdat", *payloads))
        file.write(box("moov", box("trak", box("mdia", head, box("minf", tables)))))


def video_of(folder: Path) -> Path:
    path = folder / "GX010001.MP4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), 10, (128, 96))  # type: ignore[attr-defined]
    for k in range(10 * SECONDS):
        writer.write(np.full((96, 128, 3), 8 * k, np.uint8))
    writer.release()
    return path


def readings(seed: int) -> FloatArray:
    return np.random.default_rng(seed).uniform(-2, 2, (SECONDS * N, 3))


def payloads_of(gyro: FloatArray, accel: FloatArray, orientation: str | None) -> list[bytes]:
    parts = zip(np.split(gyro, SECONDS), np.split(accel, SECONDS), strict=True)
    return [payload(g, a, orientation) for g, a in parts]


def test_gyro_and_accelerometer_in_the_order_of_the_axes(tmp_path: Path) -> None:
    path, gyro, accel = video_of(tmp_path), readings(1), readings(2)
    # Recorded as Y, -X, Z.
    recorded_gyro, recorded_accel = (rows[:, [1, 0, 2]] * [1, -1, 1] for rows in (gyro, accel))
    with_track(path, payloads_of(recorded_gyro, recorded_accel, "YxZ"))
    video = VideoSequence(path, settings=SETTINGS)
    assert len(video) == 10 * SECONDS
    samples = video.imu()
    assert samples is not None and samples.doubts == ()
    np.testing.assert_allclose(samples.timestamps, (np.arange(SECONDS * N) + 0.5) / N)
    np.testing.assert_allclose(samples.gyro, gyro, atol=0.5 / 939)
    np.testing.assert_allclose(samples.accel, accel, atol=0.5 / 417)


def test_an_unknown_order_is_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    path, gyro, accel = video_of(tmp_path), readings(1), readings(2)
    with_track(path, payloads_of(gyro, accel, None))
    samples = read_gopro_imu(path)
    assert samples is not None
    np.testing.assert_allclose(samples.gyro, gyro, atol=0.5 / 939)
    assert "does not contain the order of the axes" in caplog.text


def test_other_videos_have_no_samples(tmp_path: Path) -> None:
    path = video_of(tmp_path)
    assert VideoSequence(path, settings=SETTINGS).imu() is None
    with_track(path, [nested("DEVC", item("DVNM", "c", 1, b"Camera"))] * 2)
    assert read_gopro_imu(path) is None


@pytest.mark.parametrize("damage", ["length", "type", "columns", "table"])
def test_a_damaged_track_is_told(tmp_path: Path, damage: str) -> None:
    path, gyro, accel = video_of(tmp_path), readings(1), readings(2)
    payloads = payloads_of(gyro, accel, "YxZ")
    if damage == "length":
        payloads[1] = payloads[1][:60] + b"\xff\xff" + payloads[1][62:]
        payloads[1] = payloads[1].replace(b"GYROs\x06\x00\x14", b"GYROs\x06\xff\xff")
    elif damage == "type":
        payloads[1] = payloads[1].replace(b"GYROs", b"GYROq")
    elif damage == "columns":
        payloads[1] = payloads[1].replace(b"GYROs\x06\x00\x14", b"GYROs\x02\x00\x3c")
    with_track(path, payloads)
    if damage == "table":
        whole = path.read_bytes()
        at = whole.rindex(b"stco") + 8
        path.write_bytes(whole[:at] + b"\xff\xff\xff\xff" + whole[at + 4 :])
    with pytest.raises(DatasetError, match=r"GX010001.MP4.*damaged.*--no-imu"):
        read_gopro_imu(path)


@pytest.mark.parametrize("cut", [1, 40, 200])
def test_a_video_that_is_cut_off_does_not_hang(tmp_path: Path, cut: int) -> None:
    path = video_of(tmp_path)
    with_track(path, payloads_of(readings(1), readings(2), "YxZ"))
    path.write_bytes(path.read_bytes()[:-cut])
    assert read_gopro_imu(path) is None


def test_a_table_and_settings_beside_a_video(tmp_path: Path) -> None:
    path = video_of(tmp_path)
    rows = np.column_stack([np.arange(40) / 20, np.full((40, 3), 90.0), np.full((40, 3), 0.5)])
    header = "time [s],gyro_x [deg/s],gyro_y,gyro_z,accel_x [g],accel_y,accel_z"
    np.savetxt(tmp_path / "GX010001.imu.csv", rows, delimiter=",", header=header, comments="")
    place = "  rows: 4\n  cols: 4\n  dt: d\n  data: [1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1]\n"
    (tmp_path / "imu.yaml").write_text(
        "IMU.NoiseGyro: 1e-3\nIMU.NoiseAcc: 1e-2\nIMU.GyroWalk: 1e-5\nIMU.AccWalk: 1e-4\n"
        f"IMU.T_b_c1: !!opencv-matrix\n{place}"
    )
    video = VideoSequence(path, settings=SETTINGS)
    samples, settings = video.imu(), video.imu_settings()
    assert samples is not None and settings is not None
    np.testing.assert_allclose(samples.gyro, np.pi / 2)
    np.testing.assert_allclose(samples.accel, 0.5 * 9.80665)
    assert settings.gyro_noise == 1e-3
