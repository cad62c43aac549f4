# SPDX-License-Identifier: BSD-3-Clause
"""What the IMU does in tracking: it leads, ends, drifts, and says where a map goes on."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import System
from orbslam2py import _core as core
from orbslam2py.maps import load_map
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial import ImuInterval, InertialTracker
from orbslam2py.slam.inertial_config import InertialConfig
from orbslam2py.slam.records import PoseEstimate, PoseMethod, Reason, TrackingState, Verdict
from orbslam2py.slam.state import Motion, State
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(100)

FAILED = PoseEstimate(Reason.NOT_FOUND_IN_MAP)
NOISE = np.array([1e-3, 1e-2, 1e-5, 1e-4])
#: The body of the IMU stands upright in the world; it is the camera's.
REST = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 9.81])


class MadeFrame:
    """A frame without features."""

    def __init__(self, timestamp: float, T_cw: core.Pose | None = None) -> None:
        self.timestamp = timestamp
        self.T_cw = T_cw
        self.big_change = 0
        self.map_index = 0
        self.anchored = False

    def clear_associations(self) -> None:
        pass

    def share_anchor(self, other: MadeFrame) -> None:
        self.anchored = True


def tracker(*, metric: bool = True, **changes: Any) -> InertialTracker:
    settings = ImuSettings(1e-3, 1e-2, 1e-5, 1e-4, T_ci=np.eye(4), rate=200.0)
    return InertialTracker(
        core.Map(), settings, metric=metric, idle=lambda: True, config=InertialConfig(**changes)
    )


def started(*, metric: bool = True, tilt: float = 1e-3, **changes: Any) -> InertialTracker:
    """A tracker whose IMU has started at rest, at 0 s."""
    made = tracker(metric=metric, **changes)
    deviations = np.repeat([1e-3, 0.01, 0.01, 1e-4, 0.01, tilt], 3)
    deviations[:2] = tilt
    bias = np.array([0.01, 0.0, 0.0, 0.0, 0.2, 0.0])
    made.filter = core.InertialFilter(
        core.Pose(), NOISE, core.Pose(), np.zeros(3), bias, np.diag(deviations**2)
    )
    made.last_seen = 0.0
    return made


def interval(begin: float, end: float, rates: Any = REST) -> ImuInterval:
    t = np.linspace(begin, end, 21)
    return ImuInterval(begin, end, np.column_stack([t, np.tile(rates, (21, 1))]), 0.005)


def motion_at(seconds: float) -> Motion:
    return Motion(last_frame=MadeFrame(seconds, core.Pose()))  # type: ignore[arg-type]


def led(made: InertialTracker, seconds: float) -> tuple[MadeFrame, PoseEstimate]:
    frame = MadeFrame(seconds)
    return frame, made.judge(frame, FAILED, motion_at(0.0))  # type: ignore[arg-type]


def test_the_imu_leads_for_its_longest_time() -> None:
    made = started(longest=2.0)
    frame, estimate = led(made, 1.9)
    assert estimate.found and estimate.method is PoseMethod.IMU
    assert frame.T_cw is not None and frame.anchored
    assert estimate.covariance is not None
    _, estimate = led(made, 2.1)
    assert not estimate.found
    assert made.filter is None and made.is_adrift


def test_without_a_start_nothing_leads() -> None:
    _, estimate = led(tracker(), 0.1)
    assert estimate is FAILED


def test_a_lost_camera_is_followed_to_where_a_map_begins() -> None:
    made = started()
    made.end_of_map()
    turning = REST + np.array([0.01, 0.0, 0.5, 0.0, 0.2, 0.0])  # with the bias
    lost = State(phase=TrackingState.LOST)
    for k in range(10):
        made.predict(interval(0.1 * k, 0.1 * (k + 1), turning), lost, 0.1 * (k + 1))
    T_cw = made.pose_to_begin_at
    assert T_cw is not None
    angle = np.arctan2(T_cw.inverse().rotation_matrix[1, 0], T_cw.rotation_matrix[0, 0])
    assert angle == pytest.approx(0.5, abs=1e-6)
    made.map_begun(T_cw)
    assert not made.is_adrift
    assert made.pose_to_begin_at is None


def test_a_gap_ends_it() -> None:
    made = started()
    made.end_of_map()
    made.predict(None, State(phase=TrackingState.LOST), 0.1)
    assert not made.is_adrift and made.pose_to_begin_at is None


@pytest.mark.parametrize(("metric", "tilt"), [(False, 1e-3), (True, 0.1)])
def test_one_camera_or_an_unknown_attitude_begin_at_the_origin(metric: bool, tilt: float) -> None:
    made = started(metric=metric, tilt=tilt)
    made.end_of_map()
    assert made.pose_to_begin_at is None


def test_images_of_a_new_place_end_the_lead() -> None:
    made = started(beyond=0.4)
    frames = [MadeFrame(0.1 * k) for k in range(12)]
    shows = [False, True, True, False, True, True, True, True, True, True, True, True]
    beyond = [
        made.is_beyond_map(frame, shown)  # type: ignore[arg-type]
        for frame, shown in zip(frames, shows, strict=True)
    ]
    assert beyond == [False] * 8 + [True] * 4
    made.map_continued(frames[-1])  # type: ignore[arg-type]
    assert made.last_seen == pytest.approx(1.1)
    assert made.filter is not None
    _, covariance = made.filter.pose()
    assert np.abs(covariance).max() < 1e-12, "the map goes on from this pose"


def judged(made: InertialTracker, verdict: Verdict, x: float) -> PoseEstimate:
    T_cw = np.eye(4)
    T_cw[0, 3] = x
    frame = MadeFrame(0.1, core.Pose.from_matrix(T_cw))
    estimate = PoseEstimate(
        evidence=SimpleNamespace(verdict=verdict),  # type: ignore[arg-type]
        covariance=np.eye(6) * 1e-6,
    )
    return made.judge(frame, estimate, motion_at(0.0))  # type: ignore[arg-type]


def test_a_weak_pose_far_from_the_predicted_one_is_refused() -> None:
    assert judged(started(), Verdict.WEAK, 0.01).method is not PoseMethod.IMU
    assert judged(started(), Verdict.WEAK, 1.0).method is PoseMethod.IMU
    assert judged(started(), Verdict.STRONG, 1.0).method is not PoseMethod.IMU


def test_velocity_turns_with_its_keyframe() -> None:
    made = started()
    turned = core.Pose.exp(np.array([0, 0, 0.3, 0, 0, 0]))
    made.filter = core.InertialFilter(
        core.Pose(), NOISE, core.Pose(), np.array([1.0, 0, 0]), np.zeros(6), np.eye(18) * 1e-6
    )
    made.keyframe_made(7, MadeFrame(0.0, turned))  # type: ignore[arg-type]
    found = made.keyframes.find(7)
    assert found is not None
    np.testing.assert_allclose(found[0], turned.rotation_matrix @ [1, 0, 0])
    made.reset()
    assert len(made.keyframes) == 0 and made.filter is None


def test_darkness_on_the_way_leaves_one_upright_map(tmp_path: Any) -> None:
    """Behind the darkness the place is a new one; map files know that the map is upright."""
    sequence = SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor="rgbd", frames=200, size=(320, 240), motion="shakes",
            cover=(5.0, 3.0), imu=True, imu_noise="bmi088",
        )
    )  # fmt: skip
    settings = sequence.default_settings()
    with System(settings, "rgbd", imu=sequence.imu_settings(), deterministic=True) as slam:
        records = slam.run(sequence)
        assert [one.n_keyframes > 0 for one in slam.maps] == [True]
        slam.save_map(tmp_path / "a.orbmap")
    dark = [r for r in records if 5.05 < r.timestamp - records[0].timestamp < 7.95]
    assert all(r.method is PoseMethod.IMU for r in dark)
    assert all(r.T_wc is not None for r in records)
    assert records[-1].method is not PoseMethod.IMU, "the map continues"
    down = sequence.ground_truth().T_wc[-1, :3, :3].T @ [0, 1, 0]
    assert records[-1].T_wc is not None
    lean = records[-1].T_wc[:3, :3] @ down - [0, 0, -1]
    assert np.linalg.norm(lean) < np.radians(2.0)
    saved = load_map(tmp_path / "a.orbmap")
    assert saved.contents.upright_roots == (0,)
    with System(settings, "rgbd", load_map=saved, deterministic=True) as again:
        assert again.pipeline.back_end.map.is_upright(0)
        assert again.map_contents().upright_roots == (0,)


def test_a_state_that_is_off_follows_the_images_again() -> None:
    """The deviations of a pose do not grow with its distance from the IMU's own prediction."""
    n, disturbed = 150, 100
    sequence = SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor="stereo", frames=n, size=(320, 240), imu=True,
            imu_noise="bmi088",
        )
    )  # fmt: skip
    samples, distances = sequence.imu(), []
    assert samples is not None
    settings = sequence.default_settings()
    with System(settings, "stereo", imu=sequence.imu_settings(), deterministic=True) as slam:
        tracker, before = slam.pipeline.inertial_tracker, None
        assert tracker is not None
        for index, timestamp in enumerate(sequence.timestamps):
            part = samples.since(before, timestamp)
            record = slam.track(sequence.load(index), float(timestamp), imu=part)
            before = timestamp
            if index == disturbed:
                assert tracker.filter is not None, "the IMU has started"
                aside = core.Pose.exp(np.array([0, 0, 0, 0.3, 0, 0]))
                tracker.filter.move(aside @ tracker.filter.pose()[0])
            if index >= disturbed and tracker.filter is not None:
                T_cw = core.Pose.from_matrix(record.T_cw)
                distances.append(T_cw.difference(tracker.filter.pose()[0])[1])
    assert distances[0] > 0.2
    assert max(distances[20:]) < 0.15
