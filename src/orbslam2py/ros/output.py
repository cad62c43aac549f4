# SPDX-License-Identifier: BSD-3-Clause
"""Publishes poses and map of a running system as topics and transforms (REP 103, REP 105)."""

from __future__ import annotations

import contextlib
import logging
import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import OrbSlamError
from orbslam2py.maps.changes import MapFollower
from orbslam2py.recordings.growing_map import GrowingMap
from orbslam2py.ros import messages
from orbslam2py.ros.base_frame import BaseFrame
from orbslam2py.ros.image_output import ImageOutput, SeenImage
from orbslam2py.ros.messages import Heading, Transform
from orbslam2py.ros.odometry import OdometryStep, SmoothOdometry
from orbslam2py.ros.services import serve
from orbslam2py.ros.transport import NODE, Publication, Transport
from orbslam2py.ros.types import to_cdr
from orbslam2py.slam.records import TrackingRecord, TrackingState
from orbslam2py.slam.system import System
from orbslam2py.slam.watched_frame import WatchedFrame
from orbslam2py.trajectory.robot_frames import twist_between
from orbslam2py.trajectory.rotations import inverse_poses

_log = logging.getLogger(__name__)

MAP, ODOM = "map", "odom"
#: Seconds between two states of the map: its points and the path of its keyframes.
_MAP_EVERY = 1.0
#: Images that wait for being published at most.
_ROOM = 50
#: Variance of a velocity that is not known: filters pass over it.
_UNKNOWN = 1e9
#: Seconds between two looks at whether the thread still takes images.
_WAIT_SLICE = 0.2
#: Topics by their last name: type, and whether later subscribers get the last message.
_TOPICS = {
    "pose": (messages.POSE, False),
    "pose_with_covariance": (messages.POSE_WITH_COVARIANCE, False),
    "odom": (messages.ODOMETRY, False),
    "path": (messages.PATH, True),
    "points": (messages.POINTS, True),
    "state": (messages.STRING, True),
}
_TF, _TF_STATIC = "/tf", "/tf_static"

#: Stamp [ns] of the image of a time stamp of the system [s], as its publisher wrote it.
StampOf = Callable[[float], int]


@dataclass(frozen=True, eq=False)
class _News:
    record: TrackingRecord
    step: OdometryStep | None
    seen: SeenImage | None
    is_upright: bool
    """Whether an IMU has turned the map of the pose upright."""


class RosOutput:
    """Publishes poses, odometry, path, points and transforms while a system runs.

    Tracking is delayed by the sum of two poses an image; all else happens in a thread. Use it as a
    context: entered before the first image, left after the last one.

    Parameters
    ----------
    transport
        The connection; closed at the end.
    system
        The published system.
    base
        The frame of the robot.
    stamp_of
        Returns the stamp of the images for a time of the system.
    map_path
        File in which the service ``save_map`` saves the map; None: no services.
    with_images
        Also publish images with their keypoints and the calibration, for viewers.
    every_image
        Pass over no image: the track call waits until there is room for it.
    """

    def __init__(
        self,
        transport: Transport,
        system: System,
        base: BaseFrame,
        stamp_of: StampOf,
        map_path: Path | None,
        *,
        with_images: bool = False,
        every_image: bool = False,
    ) -> None:
        self._transport = transport
        self._pipeline = system.pipeline
        self._base = base
        self._stamp_of = stamp_of
        self._odometry = SmoothOdometry(system.pipeline.back_end.map)
        self._slam_map = system.pipeline.back_end.map
        self._odom_is_upright: bool | None = None
        self._follower = MapFollower(self._slam_map)
        self._map = GrowingMap()
        self._keyframes: dict[int, tuple[float, FloatArray]] = {}
        self._before: TrackingRecord | None = None
        self._state, self._map_due = "", 0.0
        self._stamp: int = 0
        self._has_begun = False
        self._map_index: int | None = None
        self._failed: set[str] = set()
        self._queue: queue.Queue[_News | None] = queue.Queue(_ROOM)
        self._out: dict[str, Publication] = {
            name: transport.publish(f"/{NODE}/{name}", kind, latched=latched)
            for name, (kind, latched) in _TOPICS.items()
        }
        if base.publishes_tf:
            self._out[_TF] = transport.publish(_TF, messages.TF)
            if base.T_base_child is not None:
                self._out[_TF_STATIC] = transport.publish(_TF_STATIC, messages.TF, latched=True)
        self._images = ImageOutput(transport, system, base, every=every_image, wanted=with_images)
        self._every_image = every_image
        if map_path is not None:
            serve(transport, system, map_path)
        self._thread = threading.Thread(target=self._run, name="ros output", daemon=True)

    def __enter__(self) -> RosOutput:
        self._pipeline.frame_watchers += (self._see,)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._pipeline.frame_watchers = tuple(
            watch for watch in self._pipeline.frame_watchers if watch != self._see
        )
        self._queue.put(None)
        self._thread.join()
        self._transport.close()

    # ---- in the thread that tracks ---------------------------------------------------------------
    def _see(self, watched: WatchedFrame) -> None:
        record = watched.record
        is_upright = bool(self._slam_map.is_upright(record.map_index))
        step, seen = self._odometry.add(watched), self._images.seen(watched)
        news = _News(record, step, seen, is_upright)
        if self._every_image:
            while self._thread.is_alive():
                with contextlib.suppress(queue.Full):
                    self._queue.put(news, timeout=_WAIT_SLICE)
                    return
            return
        while True:
            try:
                self._queue.put_nowait(news)
                return
            except queue.Full:
                self._queue.get_nowait()

    # ---- in the thread of the output -------------------------------------------------------------
    def _run(self) -> None:
        while (news := self._queue.get()) is not None:
            try:
                self._publish(news)
                if time.monotonic() >= self._map_due:
                    self._publish_map()
                    self._map_due = time.monotonic() + _MAP_EVERY
            except Exception:
                _log.exception("%s: an image was not published", self._transport.prefix)
        self._publish_map()

    def _publish(self, news: _News) -> None:
        record, step = news.record, news.step
        self._stamp = self._stamp_of(record.timestamp)
        if not self._has_begun:
            self._has_begun = True
            self._publish_static_transform()
        if news.seen is not None:
            self._images.publish(news.seen, self._stamp)
        state = record.state.name
        self._say_state(f"{state}: {record.reason}" if str(record.reason) else state)
        if record.state is not TrackingState.OK or record.T_wc is None or step is None:
            self._before = None
            return
        if self._map_index not in (None, record.map_index):
            _log.warning(
                "%s: the camera is in map %d now; poses in the frame %s are relative to its first "
                "keyframe",
                *(self._transport.prefix, record.map_index, MAP),
            )
        self._map_index = record.map_index
        robot, base = self._base.robot, self._base.name
        is_upright = news.is_upright
        T_mb = robot.pose(record.T_wc, is_upright=is_upright)
        if self._odom_is_upright is None:  # it begins in the world of the first pose
            self._odom_is_upright = is_upright
        T_ob = robot.pose(step.T_oc, is_upright=self._odom_is_upright)
        in_map = Heading(self._stamp, MAP)
        self._send("pose", messages.pose_stamped(in_map, T_mb))
        if record.covariance is not None:
            covariance = robot.covariance(
                record.covariance, (robot.to_map(is_upright) @ record.T_wc)[:3, :3]
            )
            message = messages.pose_with_covariance(in_map, T_mb, covariance)
            self._send("pose_with_covariance", message)
            self._publish_odometry(record, step, T_ob)
        if _TF in self._out:
            corrected = Transform(in_map, ODOM, T_mb @ inverse_poses(T_ob))
            moved = Transform(Heading(self._stamp, ODOM), base, T_ob)
            self._send(_TF, messages.transforms([corrected, moved]))
        self._before = record

    def _publish_static_transform(self) -> None:
        if _TF_STATIC in self._out and self._base.T_base_child is not None:
            head = Heading(self._stamp, self._base.name)
            fixed = Transform(head, self._base.child, self._base.T_base_child)
            self._send(_TF_STATIC, messages.transforms([fixed]))

    def _publish_odometry(
        self, record: TrackingRecord, step: OdometryStep, T_ob: FloatArray
    ) -> None:
        robot, before = self._base.robot, self._before
        T_bc = robot.T_base_camera
        assert record.covariance is not None
        twist, of_twist = np.zeros(6), np.zeros((6, 6))
        if step.T_before_after is not None and before is not None and step.seconds > 0:
            twist = twist_between(robot.pose(step.T_before_after), step.seconds)
            both = record.covariance + (
                before.covariance if before.covariance is not None else record.covariance
            )
            of_twist = robot.covariance(both, T_bc[:3, :3]) / step.seconds**2
        else:
            of_twist = _UNKNOWN * np.eye(6)
        T_oc = robot.to_map(bool(self._odom_is_upright)) @ step.T_oc
        covariance = robot.covariance(record.covariance, T_oc[:3, :3])
        head = Heading(self._stamp, ODOM)
        message = messages.odometry(head, self._base.name, T_ob, covariance, twist, of_twist)
        self._send("odom", message)

    def _publish_map(self) -> None:
        changes = self._follower.update()
        if not changes:
            return
        if changes.restarted:
            self._keyframes.clear()
        self._map.apply(changes)
        for gone in changes.keyframes_removed.tolist():
            self._keyframes.pop(gone, None)
        given = changes.keyframes_set
        for number, seconds, T_wc in zip(
            given.ids.tolist(), given.timestamps.tolist(), given.T_wc, strict=True
        ):
            self._keyframes[number] = (seconds, np.asarray(T_wc, np.float64))
        robot, head = self._base.robot, Heading(self._stamp, MAP)
        positions = np.asarray(self._map.picture().points, np.float64)
        # Asked after the changes: a map is turned first, then called upright.
        is_upright = bool(self._slam_map.is_upright(changes.map_index))
        positions = robot.points(positions, is_upright=is_upright)
        self._send("points", messages.points(head, positions))
        order = sorted(self._keyframes.values(), key=lambda one: one[0])
        if order:
            stamps = [self._stamp_of(seconds) for seconds, _ in order]
            T_wc = np.stack([T_wc for _, T_wc in order])
            poses = robot.pose(T_wc, is_upright=is_upright)
            self._send("path", messages.path(head, stamps, poses))

    def _say_state(self, state: str) -> None:
        if state != self._state:
            self._state = state
            self._send("state", messages.string(state))

    def _send(self, name: str, message: Any) -> None:
        try:
            self._out[name].send(to_cdr(message), self._stamp)
        except OrbSlamError as error:
            if name not in self._failed:
                self._failed.add(name)
                _log.warning("%s", error)
