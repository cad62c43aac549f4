# SPDX-License-Identifier: BSD-3-Clause
"""Odometry goes on smoothly when the map is corrected; the jump is from ``map`` to ``odom``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import Sensor, System
from orbslam2py import _core as core
from orbslam2py.ros import messages
from orbslam2py.ros.base_frame import BaseFrame
from orbslam2py.ros.odometry import OdometryStep, SmoothOdometry
from orbslam2py.ros.output import RosOutput
from orbslam2py.ros.stamps import nanoseconds
from orbslam2py.slam.watched_frame import WatchedFrame
from orbslam2py.trajectory.robot_frames import RobotBase, pose_of_forward_camera
from orbslam2py.trajectory.rotations import rotations_from_quaternions
from support.memory_transport import MemoryNetwork, MemoryTransport
from support.small_sequences import new_system, play, sequence, track

N = 24


def _correct(system: System, metres: float) -> None:
    """Move a map aside as a whole, as a correction of a loop does around the camera."""
    slam_map = system.pipeline.back_end.map
    moved = core.Pose.exp([0, 0.05, 0, metres, 0, 0])
    for keyframe in slam_map.keyframe_ids().tolist():
        slam_map.set_pose(keyframe, slam_map.keyframe_pose(keyframe) @ moved)


class _Odometry:
    def __init__(self, system: System) -> None:
        self.steps: list[OdometryStep | None] = []
        self.T_wc: list[np.ndarray] = []
        self._smooth = SmoothOdometry(system.pipeline.back_end.map)
        system.pipeline.frame_watchers += (self._see,)

    def _see(self, watched: WatchedFrame) -> None:
        self.steps.append(self._smooth.add(watched))
        assert watched.record.T_wc is not None
        self.T_wc.append(watched.record.T_wc)


def test_it_is_the_path_of_the_camera_if_nothing_is_corrected() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        odometry = _Odometry(system)
        play(system, N)
    for step, T_wc in zip(odometry.steps, odometry.T_wc, strict=True):
        assert step is not None
        # Local bundle adjustment moves keyframes a little; these corrections are not followed.
        np.testing.assert_allclose(step.T_oc, T_wc, atol=0.02)
    true = sequence(Sensor.STEREO).ground_truth()
    assert true is not None
    moved = np.linalg.inv(true.T_wc[0]) @ true.T_wc[N - 1]
    last = odometry.steps[-1]
    assert last is not None
    np.testing.assert_allclose(last.T_oc[:3, 3], moved[:3, 3], atol=0.03)


def test_a_correction_between_two_images_does_not_enter() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        slam_map = system.pipeline.back_end.map
        smooth = SmoothOdometry(slam_map)
        kept: list[Any] = []
        steps: list[OdometryStep | None] = []

        def see(watched: WatchedFrame) -> None:
            if len(kept) == N // 2:  # the correction comes after tracking, before we look
                _correct(system, 0.5)
            kept.append(watched.kept_pose())
            steps.append(smooth.add(watched))

        system.pipeline.frame_watchers += (see,)
        play(system, N // 2 + 1)
    true = sequence(Sensor.STEREO).ground_truth()
    assert true is not None
    before, after = steps[-2], steps[-1]
    assert before is not None
    assert after is not None
    moved = np.linalg.inv(before.T_oc) @ after.T_oc
    expected = np.linalg.inv(true.T_wc[N // 2 - 1]) @ true.T_wc[N // 2]
    np.testing.assert_allclose(moved, expected, atol=0.01)
    assert np.linalg.norm(moved[:3, 3]) < 0.1  # and not half a metre


def test_a_lost_image_has_no_step_and_a_reset_goes_on_where_it_was() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        smooth, steps = SmoothOdometry(system.pipeline.back_end.map), []
        system.pipeline.frame_watchers += (lambda watched: steps.append(smooth.add(watched)),)
        play(system, 10)
        system.reset()
        track(system, 10)
        track(system, 11)
    before, first, second = steps[9:]
    assert first.T_before_after is None
    np.testing.assert_allclose(first.T_oc, before.T_oc)
    assert second.T_before_after is not None
    assert np.linalg.norm(second.T_oc[:3, 3]) > np.linalg.norm(before.T_oc[:3, 3])


@pytest.fixture(scope="module")
def published() -> MemoryNetwork:
    """What is published of a run, with a base half a metre behind and below the camera."""
    network = MemoryNetwork()
    T = pose_of_forward_camera()
    T[:3, 3] = 0.5, 0.0, 0.5
    base = BaseFrame("base_link", "left_optical", RobotBase(T), "left_optical", T)
    with new_system(Sensor.STEREO, deterministic=True) as system:
        transport = MemoryTransport(network)
        with RosOutput(transport, system, base, nanoseconds, Path("unused.orbmap")):
            play(system, N)
    assert transport.is_closed
    return network


def _matrix(position: Any, turned: Any) -> np.ndarray:
    T = np.eye(4)
    q = np.array([[turned.x, turned.y, turned.z, turned.w]])
    T[:3, :3] = rotations_from_quaternions(q)[0]
    T[:3, 3] = position.x, position.y, position.z
    return T


def test_frames_and_stamps_are_those_of_the_images(published: MemoryNetwork) -> None:
    stamps = [nanoseconds(t) for t in sequence(Sensor.STEREO).timestamps[:N]]
    poses = published.messages("/orbslam2py/pose", messages.POSE)
    found = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in poses]
    assert found == stamps
    assert {one.header.frame_id for one in poses} == {"map"}
    odometry = published.messages("/orbslam2py/odom", messages.ODOMETRY)
    assert {(one.header.frame_id, one.child_frame_id) for one in odometry} == {
        ("odom", "base_link")
    }


def test_transforms_chain_to_the_pose_in_the_map(published: MemoryNetwork) -> None:
    poses = published.messages("/orbslam2py/pose", messages.POSE)
    trees = published.messages("/tf", messages.TF)
    for pose, tree in zip(poses, trees, strict=True):
        to_odom, to_base = tree.transforms
        assert (to_odom.header.frame_id, to_odom.child_frame_id) == ("map", "odom")
        assert (to_base.header.frame_id, to_base.child_frame_id) == ("odom", "base_link")
        chain = _matrix(to_odom.transform.translation, to_odom.transform.rotation) @ _matrix(
            to_base.transform.translation, to_base.transform.rotation
        )
        np.testing.assert_allclose(
            chain, _matrix(pose.pose.position, pose.pose.orientation), atol=1e-9
        )
    (fixed,) = published.messages("/tf_static", messages.TF)[0].transforms
    assert (fixed.header.frame_id, fixed.child_frame_id) == ("base_link", "left_optical")
    at, turned = fixed.transform.translation, fixed.transform.rotation
    assert (at.x, at.y, at.z) == (0.5, 0.0, 0.5)
    q = np.array([turned.x, turned.y, turned.z, turned.w])
    np.testing.assert_allclose(q * -np.sign(q[0]), [-0.5, 0.5, -0.5, 0.5], atol=1e-12)


def test_the_base_moves_as_the_truth_says(published: MemoryNetwork) -> None:
    true = sequence(Sensor.STEREO).ground_truth()
    assert true is not None
    T = pose_of_forward_camera()
    T[:3, 3] = 0.5, 0.0, 0.5
    expected = RobotBase(T).pose(np.linalg.inv(true.T_wc[0]) @ true.T_wc[N - 1])
    last = published.messages("/orbslam2py/pose", messages.POSE)[-1].pose
    found = _matrix(last.position, last.orientation)
    np.testing.assert_allclose(found[:3, 3], expected[:3, 3], atol=0.03)
    assert found[0, 3] > 0.3  # forward is x


def test_the_covariance_is_of_position_then_rotation(published: MemoryNetwork) -> None:
    message = published.messages("/orbslam2py/pose_with_covariance", messages.POSE_WITH_COVARIANCE)[
        -1
    ]
    covariance = message.pose.covariance.reshape(6, 6)
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-15)
    assert np.linalg.eigvalsh(covariance).min() > 0
    deviations = np.sqrt(np.diag(covariance))
    assert (deviations[:3] < 0.05).all()  # metres
    assert (deviations[3:] < 0.02).all()  # radians
    # Along the view a pair sees its own place less well than it sees its direction.
    assert deviations[:3].max() > deviations[3:].min()


def test_the_twist_is_the_speed_of_the_base(published: MemoryNetwork) -> None:
    odometry = published.messages("/orbslam2py/odom", messages.ODOMETRY)
    speeds = [one.twist.twist.linear.x for one in odometry[1:]]
    assert 0.5 < np.median(speeds) < 0.9  # the corridor is walked at 0.7 m/s
    assert odometry[0].twist.covariance[0] == 1e9  # not known yet
    assert 0 < odometry[-1].twist.covariance[0] < 10


def test_path_and_points_are_of_the_map(published: MemoryNetwork) -> None:
    path = published.messages("/orbslam2py/path", messages.PATH)[-1]
    stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in path.poses]
    assert stamps == sorted(stamps)
    assert len(stamps) >= 2
    cloud = published.messages("/orbslam2py/points", messages.POINTS)[-1]
    assert [(field.name, field.offset, field.datatype) for field in cloud.fields] == [
        ("x", 0, 7),
        ("y", 4, 7),
        ("z", 8, 7),
    ]
    positions = cloud.data.view("<f4").reshape(-1, 3)
    assert len(positions) == cloud.width > 100
    assert np.median(positions[:, 0]) > 1.0  # before the camera
    assert published.messages("/orbslam2py/state", messages.STRING)[-1].data == "OK"


def test_services_are_offered(published: MemoryNetwork) -> None:
    assert set(published.services) == {
        "/orbslam2py/save_map",
        "/orbslam2py/reset",
        "/orbslam2py/localize",
    }


def test_another_map_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    base = BaseFrame("base_link", "left", RobotBase(), "left", None)
    transport = MemoryTransport(MemoryNetwork())
    with (
        new_system(Sensor.STEREO, deterministic=True) as system,
        RosOutput(transport, system, base, nanoseconds, None),
    ):
        play(system, 3)
        system.reset()
        track(system, 3)
    assert "the camera is in map 1 now" in caplog.text
    assert "/tf_static" not in transport.network.sent
