# SPDX-License-Identifier: BSD-3-Clause
"""Small bags of every kind with whatever a test wants in them."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from orbslam2py.trajectory.rotations import quaternions_from_rotations

KINDS = ("rosbag1", "rosbag2", "mcap")
IMAGE = "sensor_msgs/msg/Image"
COMPRESSED = "sensor_msgs/msg/CompressedImage"
INFO = "sensor_msgs/msg/CameraInfo"
FLOAT = "std_msgs/msg/Float32"
IMU = "sensor_msgs/msg/Imu"
STRING = "std_msgs/msg/String"
TRANSFORM = "geometry_msgs/msg/Transform"
TF = "tf2_msgs/msg/TFMessage"
#: Stamp of the first message, and the step between them [ns]: real ones, with all digits.
START, STEP = 1_700_000_000_123_456_789, 50_000_000


@dataclass(frozen=True)
class Made:
    """A message, before it is known for which kind of bag."""

    topic: str
    kind: str
    stamp: int
    fields: tuple[Any, ...]
    frame: str = "camera"
    recorded: int | None = None


def raw_image(
    topic: str,
    stamp: int,
    array: npt.NDArray[Any],
    encoding: str,
    *,
    frame: str = "camera",
    padding: int = 0,
    big_endian: bool = False,
) -> Made:
    """A raw image; rows may be padded, and 16 bits swapped."""
    height, width = array.shape[:2]
    if big_endian:
        array = array.astype(array.dtype.newbyteorder(">"))
    rows = np.ascontiguousarray(array).view(np.uint8).reshape(height, -1)
    rows = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
    fields = (height, width, encoding, int(big_endian), rows.shape[1], rows.reshape(-1))
    return Made(topic, IMAGE, stamp, fields, frame)


def packed_image(topic: str, stamp: int, content: bytes, form: str) -> Made:
    """A compressed image."""
    return Made(topic, COMPRESSED, stamp, (form, np.frombuffer(content, np.uint8)))


def encoded(array: npt.NDArray[Any], suffix: str) -> bytes:
    done, content = cv2.imencode(suffix, array)
    assert done
    return content.tobytes()


def compressed_depth(raw: npt.NDArray[np.uint16], scale: float = 0.0, shift: float = 0.0) -> bytes:
    """What image_transport's compressedDepth sends."""
    return struct.pack("<iff", 0, scale, shift) + encoded(raw, ".png")


def camera_info(
    topic: str,
    stamp: int,
    *,
    size: tuple[int, int] = (32, 24),
    K: npt.ArrayLike | None = None,
    D: Sequence[float] = (0, 0, 0, 0, 0),
    R: npt.ArrayLike | None = None,
    P: npt.ArrayLike | None = None,
    bf: float = 0.0,
    model: str = "plumb_bob",
) -> Made:
    """A calibration: by default f = 20 in the middle of the image, without distortion."""
    width, height = size
    own = [[20, 0, (width - 1) / 2], [0, 20, (height - 1) / 2], [0, 0, 1]]
    camera = np.asarray(own if K is None else K, np.float64)
    projection = np.hstack([camera, [[-bf], [0], [0]]]) if P is None else np.asarray(P, np.float64)
    rotation = np.eye(3) if R is None else np.asarray(R, np.float64)
    matrices = (np.asarray(D, np.float64), camera.ravel(), rotation.ravel(), projection.ravel())
    return Made(topic, INFO, stamp, (height, width, model, *matrices, 0, 0, None))


def text(topic: str, stamp: int, content: str) -> Made:
    return Made(topic, STRING, stamp, (content,))


def imu(topic: str, stamp: int, gyro: Sequence[float], accel: Sequence[float]) -> Made:
    """A sample of an IMU that tells no orientation."""
    return Made(topic, IMU, stamp, (gyro, accel), "imu")


def transform(topic: str, T: npt.NDArray[np.float64]) -> Made:
    """A transform (4, 4) alone."""
    return Made(topic, TRANSFORM, START, (T,))


def frames(
    topic: str, *edges: tuple[str, str, npt.NDArray[np.float64]], stamp: int = START
) -> Made:
    """Transforms of tf: parent, child, and ``T_parent_child`` (4, 4)."""
    return Made(topic, TF, stamp, edges)


def write(folder: Path, kind: str, messages: Sequence[Made]) -> Path:
    """Write a bag; returns the file of ROS 1, the folder of ROS 2."""
    ros1 = kind == "rosbag1"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    if ros1:
        definition = "geometry_msgs/TransformStamped[] transforms"
        store.register(get_types_from_msg(definition, TF))
    folder.parent.mkdir(parents=True, exist_ok=True)
    path = folder.with_suffix(".bag") if ros1 else folder
    plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
    writer: Any = Writer1(path) if ros1 else Writer2(path, version=8, storage_plugin=plugin)
    with writer:
        connections: dict[tuple[str, str], Any] = {}
        for made in messages:
            key = (made.topic, made.kind)
            if key not in connections:
                connections[key] = writer.add_connection(*key, typestore=store)
            message = message_of(store, made, ros1=ros1)
            serialise = store.serialize_ros1 if ros1 else store.serialize_cdr
            recorded = made.stamp if made.recorded is None else made.recorded
            writer.write(connections[key], recorded, serialise(message, made.kind))
    return path


def file_of(path: Path) -> Path:
    """The file that holds the messages."""
    if path.is_file():
        return path
    return next(one for one in path.iterdir() if one.suffix in (".db3", ".mcap"))


def message_of(store: Any, made: Made, *, ros1: bool) -> Any:
    """The message as an object of rosbags."""
    types = store.types
    if made.kind in (STRING, FLOAT):
        return types[made.kind](*made.fields)
    if made.kind == TRANSFORM:
        return _transform_of(types, made.fields[0])
    if made.kind == TF:
        return types[TF]([_edge_of(types, *edge, ros1=ros1) for edge in made.fields])
    fields = list(made.fields)
    if made.kind == IMU:
        vector = types["geometry_msgs/msg/Vector3"]
        turned = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        gyro, accel = (vector(*map(float, one)) for one in made.fields)
        unknown = np.full(9, -1.0)
        fields = [turned, unknown, gyro, unknown, accel, unknown]
    if made.kind == INFO:
        fields[-1] = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
    time = types["builtin_interfaces/msg/Time"](made.stamp // 10**9, made.stamp % 10**9)
    head = types["std_msgs/msg/Header"]
    header = head(0, time, made.frame) if ros1 else head(time, made.frame)
    return types[made.kind](header, *fields)


def _transform_of(types: Any, T: npt.NDArray[np.float64]) -> Any:
    x, y, z, w = (
        quaternions_from_rotations(T[None, :3, :3])[0] if np.isfinite(T).all() else np.zeros(4)
    )
    return types[TRANSFORM](
        types["geometry_msgs/msg/Vector3"](*T[:3, 3].tolist()),
        types["geometry_msgs/msg/Quaternion"](float(x), float(y), float(z), float(w)),
    )


def _edge_of(types: Any, parent: str, child: str, T: npt.NDArray[np.float64], *, ros1: bool) -> Any:
    time = types["builtin_interfaces/msg/Time"](0, 0)
    head = types["std_msgs/msg/Header"]
    header = head(0, time, parent) if ros1 else head(time, parent)
    edge = types["geometry_msgs/msg/TransformStamped"]
    return edge(header, child, _transform_of(types, T))
