# SPDX-License-Identifier: BSD-3-Clause
"""Relative poses of cameras: the transforms of a bag."""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Iterator

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.image_topics import ImageTopic
from orbslam2py.datasets.bags.messages import ENCODINGS, TRANSFORMS, read_message
from orbslam2py.datasets.bags.poses import pose_of_numbers
from orbslam2py.datasets.bags.realsense import read_extrinsics, stream_of
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    nearest_rotations,
    poses_from,
)

_log = logging.getLogger(__name__)

_STATIC, _MOVING = "/tf_static", "/tf"
#: Frames that drivers write if they know none.
_NO_FRAMES = ("", "0")
#: Most messages of moving transforms that are read, evenly over the bag.
_MOST = 500
#: Numbers of a transform that does not move differ by no more than this.
_FIXED = 1e-4


class Transforms:
    """The constant transforms between frames.

    They come from ``/tf_static``, from ``/tf`` if they are constant, and from the data of the
    RealSense SDK beside its streams.

    Parameters
    ----------
    bag
        The bag.
    """

    def __init__(self, bag: Bag) -> None:
        self._bag = bag
        #: Transforms from the second name's coordinates to the first one's.
        self._edges: dict[str, dict[str, FloatArray]] = {}
        for target, source, T in read_extrinsics(bag):
            self._connect(target, source, T, bag.path)
        for topic in self._topics(_STATIC):
            for parent, child, T in self._read(topic):
                self._connect(parent, child, T, topic.name)
        self._add_fixed_ones()

    def between(self, target: tuple[str, ...], source: tuple[str, ...]) -> FloatArray | None:
        """Find the transform from the coordinates of one camera to those of another.

        Parameters
        ----------
        target, source
            Names of their coordinates, see `names_of_coordinates`.

        Returns
        -------
        FloatArray or None
            ``T_target_source`` (4, 4) [m]; None if the bag does not contain it.
        """
        for one in target:
            for other in source:
                found = self._path(one, other)
                if found is not None:
                    return found
        return None

    def _path(self, target: str, source: str) -> FloatArray | None:
        reached = {target: np.eye(4)}
        waiting = deque([target])
        while waiting and source not in reached:
            name = waiting.popleft()
            for neighbour, T in self._edges.get(name, {}).items():
                if neighbour not in reached:
                    reached[neighbour] = reached[name] @ T
                    waiting.append(neighbour)
        return reached.get(source)

    def _topics(self, name: str) -> list[Topic]:
        return [
            topic
            for topic in self._bag.topics
            if topic.name.endswith(name)
            and topic.kind in TRANSFORMS
            and topic.encoding in ENCODINGS
        ]

    def _read(self, topic: Topic) -> Iterator[tuple[str, str, FloatArray]]:
        """Yield parent, child and ``T_parent_child`` of the messages of a topic."""
        messages, damaged = self._bag.messages(topic), 0
        for message in messages[:: 1 + len(messages) // _MOST]:
            try:
                read = read_message(self._bag.read(message), topic.kind, topic.encoding)
            except DatasetError:
                damaged += 1
                continue
            for one in read.transforms:
                at, turned = one.transform.translation, one.transform.rotation
                numbers = (at.x, at.y, at.z, turned.x, turned.y, turned.z, turned.w)
                parent, child = one.header.frame_id.strip("/"), one.child_frame_id.strip("/")
                yield parent, child, pose_of_numbers(*numbers)
        if damaged:
            _log.warning(
                "%s: %d messages of %s are damaged, left out", self._bag.path, damaged, topic.name
            )

    def _connect(self, target: str, source: str, T: FloatArray, where: object) -> None:
        R = T[:3, :3]
        if not np.isfinite(T).all() or np.abs(R @ R.T - np.eye(3)).max() > 1e-3:
            _log.warning(
                "%s: the transform between %s and %s in %s is no rotation and shift, left out",
                *(self._bag.path, target, source, where),
            )
            return
        T = poses_from(nearest_rotations(R[None]), T[None, :3, 3])[0]
        self._edges.setdefault(target, {})[source] = T
        self._edges.setdefault(source, {})[target] = inverse_poses(T)

    def _add_fixed_ones(self) -> None:
        """Return the constant transforms of ``/tf``: older drivers send all of them there."""
        found: dict[tuple[str, str], list[FloatArray]] = {}
        for topic in self._topics(_MOVING):
            for parent, child, T in self._read(topic):
                found.setdefault((parent, child), []).append(T)
        for (parent, child), all_T in found.items():
            known = child in self._edges.get(parent, {})
            if not known and np.ptp(np.stack(all_T), axis=0).max() <= _FIXED:
                self._connect(parent, child, all_T[0], _MOVING)


def names_of_coordinates(image: ImageTopic, frame: str) -> tuple[str, ...]:
    """Return the names of a camera's frame in transforms, the most certain first.

    Parameters
    ----------
    image
        Images of the camera.
    frame
        Frame id in the headers of its messages.
    """
    stream = stream_of(image)
    names = [] if stream is None else [stream]
    return (*names, *(() if frame.strip("/") in _NO_FRAMES else (frame.strip("/"),)))
