# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic sequences as bags of ROS 1 and ROS 2."""

from __future__ import annotations

import errno
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.libraries import require, type_store
from orbslam2py.datasets.bags.messages import CAMERA_INFO, IMAGE, POSES
from orbslam2py.settings import CameraSettings
from orbslam2py.trajectory.rotations import quaternions_from_rotations

#: Layouts that are bags.
BAG_LAYOUTS = ("rosbag1", "rosbag2", "mcap")

#: Topics of the images by sensor: of the first, and of what belongs to it.
_TOPICS = {
    "mono": ("/camera/image_raw",),
    "stereo": ("/camera/left/image_rect", "/camera/right/image_rect"),
    "rgbd": ("/camera/rgb/image_raw", "/camera/depth_registered/image_raw"),
}
_TRUTH = "/ground_truth"
#: Depth in bags is in millimetres (REP 118).
_DEPTH_PER_METRE = 1000.0
_NANO = 10**9


@dataclass(frozen=True)
class BagContents:
    """The contents of a bag.

    Attributes
    ----------
    sensor
        ``mono``, ``stereo`` or ``rgbd``.
    camera
        The camera; both cameras of a pair are equal.
    nanoseconds
        Time stamps of the frames.
    T_wc
        True poses of the camera, (n, 4, 4).
    load
        Images of a frame: that of the camera, and the right or depth image; depth is uint16.
    depth_per_metre
        Units of the depth per metre.
    """

    sensor: str
    camera: CameraSettings
    nanoseconds: list[int]
    T_wc: FloatArray
    load: Callable[[int], tuple[NDArray[Any], ...]]
    depth_per_metre: float


def write_bag(
    contents: BagContents, folder: Path, layout: str, progress: Callable[[int, int], None]
) -> None:
    """Write a bag into a folder: its file, and for ROS 2 ``metadata.yaml``.

    Parameters
    ----------
    contents
        The contents of the bag.
    folder
        An existing folder.
    layout
        One of `BAG_LAYOUTS`.
    progress
        Called after each frame with the number of frames written and of all frames.

    Raises
    ------
    DatasetError
        If the package rosbags is not installed.
    OSError
        If it cannot be written.
    """
    encoding = "ros1" if layout == "rosbag1" else "cdr"
    make = _Messages(encoding)
    topics = _TOPICS[contents.sensor]
    infos = [f"{topic.rpartition('/')[0]}/camera_info" for topic in topics]
    with _opened(folder, layout) as writer:
        store = type_store(encoding)
        connections = {
            name: writer.add_connection(name, kind, typestore=store)
            for names, kind in ((topics, IMAGE), (infos, CAMERA_INFO), ((_TRUTH,), POSES[0]))
            for name in names
        }
        n = len(contents.nanoseconds)
        for i, stamp in enumerate(contents.nanoseconds):
            images = list(contents.load(i))
            if contents.sensor == "rgbd":
                millimetres = images[1] * (_DEPTH_PER_METRE / contents.depth_per_metre)
                images[1] = np.rint(millimetres).astype(np.uint16)
            for number, (topic, info, image) in enumerate(zip(topics, infos, images, strict=True)):
                shift = -contents.camera.bf * (number == 1 and contents.sensor == "stereo")
                header = make.header(stamp, i, "left" if contents.sensor == "stereo" else "camera")
                calibration = make.info(header, contents.camera, image.shape[:2], shift)
                writer.write(connections[info], stamp, make.bytes(calibration))
                writer.write(connections[topic], stamp, make.bytes(make.image(header, image)))
            pose = make.pose(make.header(stamp, i, "world"), contents.T_wc[i])
            writer.write(connections[_TRUTH], stamp, make.bytes(pose))
            progress(i + 1, n)


@contextmanager
def _opened(folder: Path, layout: str) -> Iterator[Any]:
    if layout == "rosbag1":
        with require("rosbags.rosbag1").Writer(folder / "images.bag") as writer:
            yield writer
        return
    rosbag2 = require("rosbags.rosbag2")
    plugin = rosbag2.StoragePlugin.MCAP if layout == "mcap" else rosbag2.StoragePlugin.SQLITE3
    inner = folder / "images"  # it makes its folder itself
    try:
        with rosbag2.Writer(inner, version=8, storage_plugin=plugin) as writer:
            yield writer
    except sqlite3.Error as error:  # which is no OSError, also where the disk is the reason
        if "full" in str(error):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error
        raise OSError(f"SQLite fails: {error}") from error
    for path in inner.iterdir():
        path.replace(folder / path.name)
    inner.rmdir()


class _Messages:
    """Makes messages of ROS 1 or ROS 2."""

    def __init__(self, encoding: str) -> None:
        self._ros1 = encoding == "ros1"
        self._store = type_store(encoding)
        self._types = self._store.types

    def header(self, stamp: int, number: int, frame: str) -> Any:
        time = self._types["builtin_interfaces/msg/Time"](stamp // _NANO, stamp % _NANO)
        head = self._types["std_msgs/msg/Header"]
        return head(number, time, frame) if self._ros1 else head(time, frame)

    def image(self, header: Any, image: NDArray[Any]) -> Any:
        height, width = image.shape
        encoding = "mono8" if image.dtype == np.uint8 else "16UC1"
        data = np.ascontiguousarray(image).view(np.uint8).reshape(-1)
        step = width * image.itemsize
        return self._types[IMAGE](header, height, width, encoding, 0, step, data)

    def info(self, header: Any, camera: CameraSettings, size: tuple[int, ...], shift: float) -> Any:
        K = camera.matrix
        P = np.hstack([K, [[shift], [0.0], [0.0]]])
        region = self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        matrices = (np.zeros(5), K.ravel(), np.eye(3).ravel(), P.ravel())
        kind = self._types[CAMERA_INFO]
        return kind(header, size[0], size[1], "plumb_bob", *matrices, 0, 0, region)

    def pose(self, header: Any, T_wc: FloatArray) -> Any:
        point = self._types["geometry_msgs/msg/Point"](*T_wc[:3, 3].tolist())
        q = quaternions_from_rotations(T_wc[None, :3, :3])[0].tolist()
        turned = self._types["geometry_msgs/msg/Quaternion"](*q)
        pose = self._types["geometry_msgs/msg/Pose"](point, turned)
        return self._types[POSES[0]](header, pose)

    def bytes(self, message: Any) -> Any:
        kind = message.__msgtype__
        if self._ros1:
            return self._store.serialize_ros1(message, kind)
        return self._store.serialize_cdr(message, kind)
