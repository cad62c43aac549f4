# SPDX-License-Identifier: BSD-3-Clause
"""OAK cameras: the real package, with its replay node in the place of the cameras.

What needs a device is not tested here: its cameras, depth, IMU, synchronisation and loss.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, Sensor, run_sequence
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.live import LiveStream, Request, open_source
from orbslam2py.runs import RunOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import Trajectory

dai: Any = pytest.importorskip(
    "depthai", reason="depthai (96 MB) is not installed: pip install orbslam2py[oak]"
)
from orbslam2py.live import oak, oak_calibration  # noqa: E402

pytestmark = pytest.mark.watchdog(100)
SIZE, N, FPS = (320, 240), 30, 8
LEFT, RIGHT, COLOUR = oak_calibration.LEFT, oak_calibration.RIGHT, oak_calibration.COLOUR


def calibration_of(K: Any, baseline: float, lens: tuple[float, ...] = ()) -> Any:
    """What a camera has in its memory, made by the package itself."""
    handler = dai.CalibrationHandler()
    for socket in (LEFT, RIGHT, COLOUR):
        handler.setCameraIntrinsics(socket, [list(map(float, row)) for row in K], *SIZE)
        handler.setDistortionCoefficients(socket, [*lens, *[0.0] * (14 - len(lens))])
    eye, t = np.eye(3).tolist(), [-100 * baseline, 0.0, 0.0]
    handler.setCameraExtrinsics(LEFT, RIGHT, eye, t, t)
    handler.setImuExtrinsics(LEFT, eye, [1.0, 2.0, 3.0], [1.0, 2.0, 3.0])
    return handler


def replayed(path: Path) -> oak.Opened:
    """A pipeline without a device: a replay node in the place of a camera.

    Two of them would have a clock each, from their own start.
    """
    pipeline = dai.Pipeline(False)
    replay = pipeline.create(dai.node.ReplayVideo)
    replay.setReplayVideoFile(path)
    replay.setOutFrameType(dai.ImgFrame.Type.GRAY8)
    replay.setFps(FPS)
    replay.setLoop(False)
    return oak.Opened(pipeline, {"image": replay.out})


def written(path: Path, sequence: SyntheticSequence) -> Path:
    """Write a video with both views side by side."""
    size = (2 * SIZE[0], SIZE[1])
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), FPS, size)
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write videos")
    for k in range(len(sequence)):
        images = sequence.load(k)
        assert images.right is not None
        writer.write(cv2.cvtColor(np.hstack([images.image, images.right]), cv2.COLOR_GRAY2BGR))
    writer.release()
    return path


def sequence_of(world: str, frames: int) -> SyntheticSequence:
    options = SyntheticOptions(world=world, sensor="stereo", frames=frames, size=SIZE, fps=FPS)
    return SyntheticSequence(options)


def stream_of(path: Path, sequence: SyntheticSequence, room: int = 3) -> LiveStream:
    handler = calibration_of(sequence.camera.matrix, sequence.baseline)
    settings = oak_calibration.settings_of(handler, "oak:", Sensor.STEREO, SIZE, FPS)
    device = oak.Oak(
        *("oak:", Sensor.MONOCULAR, Request("", Sensor.MONOCULAR)),
        make=lambda: replayed(path),
        read_calibration=lambda: handler,
    )
    return LiveStream(device, "stereo", settings=settings, split=True, room=room)


def test_from_replay_to_a_trajectory(tmp_path: Path) -> None:
    sequence = sequence_of("corridor", N)
    source = stream_of(written(tmp_path / "both.avi", sequence), sequence, room=N)
    assert (source.sensor, source.layout) == (Sensor.STEREO, "oak")
    assert source.settings.baseline == pytest.approx(sequence.baseline, rel=1e-5)
    done = run_sequence(source, RunOptions(Sensor.STEREO, max_frames=N))
    assert done.report["tracked"] == N
    # The replay sets its own times: frames are those of the video in its order.
    path, truth = done.trajectory, sequence.ground_truth()
    figures = evaluate_trajectory(path, Trajectory(path.timestamps, truth.T_wc))
    assert figures.ate is not None and figures.ate.rmse < 0.05
    assert done.report["input"]["frames"] == N
    stages = done.report["milliseconds"]
    assert 0 <= stages["latency.transport"]["median"] < stages["latency.total"]["median"]


def test_the_end_of_the_pipeline_is_noticed(tmp_path: Path) -> None:
    sequence = sequence_of("room", 4)
    with stream_of(written(tmp_path / "both.avi", sequence), sequence, room=100) as source:
        frames = 0
        deadline = time.monotonic() + 20
        while frames < 6 and time.monotonic() < deadline:
            frames += source.take(0.1) is not None
    # It was started again after the end of the video.
    assert frames >= 6
    assert any("was it unplugged?; waiting for it" in doubt for doubt in source.doubts)


def test_settings_of_the_calibration() -> None:
    K = np.array([[300.0, 0, 158], [0, 301, 121], [0, 0, 1]])
    handler = calibration_of(K, 0.075, (0.1, -0.05, 1e-3, 2e-3, 0.01))
    stereo = oak_calibration.settings_of(handler, "oak:1", Sensor.STEREO, SIZE, 30)
    assert stereo.baseline == pytest.approx(0.075, rel=1e-6)
    assert stereo.rectification is not None
    np.testing.assert_allclose(stereo.rectification.left.K, K, rtol=1e-6)
    np.testing.assert_allclose(
        stereo.rectification.right.D[:5], [0.1, -0.05, 1e-3, 2e-3, 0.01], rtol=1e-6
    )
    mono = oak_calibration.settings_of(handler, "oak:1", Sensor.MONOCULAR, SIZE, 30)
    np.testing.assert_allclose([mono.camera.k1, mono.camera.fy], [0.1, 301], rtol=1e-6)
    rgbd = oak_calibration.settings_of(handler, "oak:1", Sensor.RGBD, SIZE, 30)
    assert (rgbd.camera.k1, rgbd.depth_factor) == (0, 1000)  # undistorted by the camera
    half = oak_calibration.settings_of(handler, "oak:1", Sensor.MONOCULAR, (160, 120), 30)
    assert half.camera.fx == pytest.approx(150, rel=1e-6)
    imu = oak_calibration.imu_settings_of(handler, Sensor.STEREO, 200)
    assert imu is not None
    np.testing.assert_allclose(imu.T_ci[:3, 3], [0.01, 0.02, 0.03], atol=1e-7)


def test_wrong_cameras(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DatasetError, match="oak:12 has no calibration"):
        oak_calibration.settings_of(dai.CalibrationHandler(), "oak:12", Sensor.STEREO, SIZE, 30)
    if dai.Device.getAllAvailableDevices():
        pytest.skip("a camera is plugged in")
    with pytest.raises(DatasetError, match="oak:12 is not there: no OAK camera is plugged in"):
        open_source("oak:12", "stereo")
    usb = oak.find_usb.__globals__["UsbDevice"]
    plugged = usb("Movidius MyriadX", Path("/dev/bus/usb/001/004"), False)
    monkeypatch.setattr(oak, "find_usb", lambda *_: [plugged])
    with pytest.raises(DatasetError, match=r"Movidius MyriadX is plugged in.*80-movidius\.rules"):
        open_source("oak:", "stereo")
    assert "80-movidius.rules" in oak.find_devices()[0].description
    busy = "X_LINK_DEVICE_ALREADY_IN_USE"
    assert "oak: is in use by another program" in oak._problem("oak:", busy)
