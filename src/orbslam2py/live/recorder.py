# SPDX-License-Identifier: BSD-3-Clause
"""Recording of the input: an MCAP file with ROS 2 messages, which `run` takes as a bag."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.libraries import require, type_store
from orbslam2py.datasets.bags.messages import IMAGE, IMU
from orbslam2py.errors import DatasetError, OutputFileError
from orbslam2py.live.pairing import Part, Parts
from orbslam2py.settings import Settings

if TYPE_CHECKING:
    from orbslam2py.live.stream import LiveStream

_log = logging.getLogger(__name__)

#: Bytes that wait for the disk at most; later data are left out, and counted.
_MOST_WAITING = 512 << 20
#: Seconds to wait for the disk at the end before it is given up.
_PATIENCE = 60.0
#: Bytes of a chunk: so much is lost if the computer goes down.
_CHUNK = 1 << 20
#: Topics and frames by stream.
_TOPICS = {
    "image": ("/camera/image_raw", "camera"),
    "left": ("/camera/left/image_raw", "left"),
    "right": ("/camera/right/image_raw", "right"),
    "depth": ("/camera/depth_registered/image_raw", "camera"),
}
_IMU_TOPIC, _IMU_FRAME = "/imu", "imu"
#: Encodings of ROS by type and number of channels.
_ENCODINGS = {
    ("uint8", 1): "mono8",
    ("uint8", 3): "bgr8",
    ("uint16", 1): "mono16",
    ("float32", 1): "32FC1",
}
_DEPTH_OF_16_BITS = "16UC1"
_BYTES_OF_SAMPLE = 64
_NANO = 10**9


class InputRecorder:
    """Writes all complete frames and all samples of a live source, also those that are not read.

    Images are written as they came, before they are rectified or scaled to 8 bits, with the
    settings as an attachment. Writing is done in a thread; if the disk cannot follow, frames are
    left out, which is counted and reported.

    Parameters
    ----------
    path
        The file, with the ending ``.mcap``; an existing one is replaced.
    source
        The live source; recording begins when this object is entered.

    Raises
    ------
    DatasetError
        If the name has another ending, or the packages that write are not installed.
    OutputFileError
        If the file cannot be written.
    """

    def __init__(self, path: str | Path, source: LiveStream) -> None:
        self.path = Path(path)
        if self.path.suffix != ".mcap":
            raise DatasetError(
                f"--record-input {self.path}: the recording is an MCAP file; give a name that "
                "ends with .mcap"
            )
        self._source = source
        self._store = type_store("cdr")
        writer = _mcap_writer()
        try:
            self._file = self.path.open("wb")
        except OSError as error:
            raise OutputFileError(cannot_open(self.path, error)) from error
        self._writer = writer.Writer(
            self._file, chunk_size=_CHUNK, compression=writer.CompressionType.LZ4
        )
        self._channels: dict[str, int] = {}
        self._changed = threading.Condition()
        self._waiting: deque[tuple[Parts | None, FloatArray | None, int]] = deque()
        self._n_bytes = 0
        self._closed = False
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="input-recorder", daemon=True)
        #: Frames written, and frames that were left out because the disk was too slow.
        self.n_frames = 0
        self.n_left_out = 0

    def __enter__(self) -> InputRecorder:
        self._writer.start(profile="ros2", library="orbslam2py")
        self._attach_settings(self._source.settings)
        self._thread.start()
        self._source.set_tap(self._take)
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Write what waits and end the file; what went wrong is logged."""
        self._source.set_tap(None)
        with self._changed:
            if self._closed:
                return
            self._closed = True
            self._changed.notify_all()
        self._thread.join(_PATIENCE)
        if self._thread.is_alive():
            _log.warning("%s is not complete: the disk does not answer", self.path)
            return
        try:
            if self._error is None:
                self._writer.finish()
        except OSError as error:
            self._error = error
        finally:
            self._file.close()
        if self._error is not None:
            _log.warning(
                "%s is not complete: %s; make room and record again", self.path, self._error
            )
        if self.n_left_out:
            _log.warning("%s lacks %d frames: the disk was too slow", self.path, self.n_left_out)

    # ---- called by the source --------------------------------------------------------------------
    def _take(self, parts: Parts | None, samples: FloatArray | None) -> None:
        size = sum(part.array.nbytes for part in parts.values()) if parts is not None else 0
        size += _BYTES_OF_SAMPLE * (0 if samples is None else len(samples))
        with self._changed:
            if self._closed:
                return
            is_full = self._n_bytes + size > _MOST_WAITING
            if parts is not None and (is_full or self._error is not None):
                self.n_left_out += 1
                return
            self._n_bytes += size
            self._waiting.append((parts, samples, size))
            self._changed.notify_all()

    # ---- in the thread ---------------------------------------------------------------------------
    def _run(self) -> None:
        while True:
            with self._changed:
                while not self._waiting:
                    if self._closed:
                        return
                    self._changed.wait()
                parts, samples, size = self._waiting.popleft()
                self._n_bytes -= size
            if self._error is not None:
                continue  # what waits is given up
            try:
                if parts is not None:
                    self._write_frame(parts)
                if samples is not None:
                    self._write_samples(samples)
            except Exception as error:  # an exception here would end the thread unseen
                self._error = error
                _log.warning("%s cannot be written any more: %s", self.path, error)

    def _write_frame(self, parts: Parts) -> None:
        for stream, array, part in _images_of(parts, is_split=self._source.is_split):
            topic, frame = _TOPICS[stream]
            message = self._image(array, part.time, frame, is_depth=stream == "depth")
            self._write(topic, IMAGE, message, part.time)
        self.n_frames += 1

    def _write_samples(self, samples: FloatArray) -> None:
        types = self._store.types
        vector = types["geometry_msgs/msg/Vector3"]
        unknown, none = np.full(9, 0.0), np.zeros(9)
        none[0] = -1  # there is no orientation
        for row in samples.tolist():
            message = types[IMU](
                header=self._header(row[0], _IMU_FRAME),
                orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                orientation_covariance=none,
                angular_velocity=vector(x=row[1], y=row[2], z=row[3]),
                angular_velocity_covariance=unknown,
                linear_acceleration=vector(x=row[4], y=row[5], z=row[6]),
                linear_acceleration_covariance=unknown,
            )
            self._write(_IMU_TOPIC, IMU, message, row[0])

    def _header(self, seconds: float, frame: str) -> Any:
        types = self._store.types
        second, rest = divmod(_nanoseconds(seconds), _NANO)
        stamp = types["builtin_interfaces/msg/Time"](sec=second, nanosec=rest)
        return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)

    def _image(self, array: NDArray[Any], seconds: float, frame: str, *, is_depth: bool) -> Any:
        array = np.ascontiguousarray(array)
        height, width = array.shape[:2]
        encoding = _ENCODINGS[array.dtype.name, array.shape[2] if array.ndim == 3 else 1]
        if is_depth and array.dtype == np.uint16:
            encoding = _DEPTH_OF_16_BITS
        return self._store.types[IMAGE](
            header=self._header(seconds, frame),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=0,
            step=array.nbytes // height,
            data=array.reshape(-1).view(np.uint8),
        )

    def _write(self, topic: str, kind: str, message: Any, seconds: float) -> None:
        if topic not in self._channels:
            text, _ = self._store.generate_msgdef(kind, ros_version=2)
            schema = self._writer.register_schema(kind, "ros2msg", text.encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", schema)
        stamp = _nanoseconds(seconds)
        data = bytes(self._store.serialize_cdr(message, kind))
        self._writer.add_message(self._channels[topic], stamp, data, stamp)

    def _attach_settings(self, settings: Settings) -> None:
        now = time.time_ns()
        self._writer.add_attachment(
            now,
            now,
            f"settings.{settings.sensor}.yaml",
            "application/yaml",
            settings.to_yaml().encode(),
        )


def _images_of(parts: Parts, *, is_split: bool) -> list[tuple[str, NDArray[Any], Part]]:
    """Images of a frame by stream; the halves of those that hold two views."""
    if not is_split:
        return [(stream, part.array, part) for stream, part in parts.items()]
    part = parts["image"]
    middle = part.array.shape[1] // 2
    halves = (part.array[:, :middle], part.array[:, middle : 2 * middle])
    return [(side, half, part) for side, half in zip(("left", "right"), halves, strict=True)]


def _nanoseconds(seconds: float) -> int:
    """Whole microseconds, as frames have their times: the numbers read back are the same."""
    return round(round(seconds, 6) * 1e6) * 1000


def _mcap_writer() -> Any:
    try:
        return require("mcap.writer")
    except DatasetError as error:
        raise DatasetError(
            "--record-input needs the packages mcap and rosbags; install them: "
            'pip install "orbslam2py[bags]"'
        ) from error
