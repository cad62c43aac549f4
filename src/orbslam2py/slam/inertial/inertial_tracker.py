# SPDX-License-Identifier: BSD-3-Clause
"""What the IMU does in tracking: start, prediction, and poses where images give none.

``docs/method/inertial.md#tracking``.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.settings.imu import ImuSettings
from orbslam2py.slam.inertial.imu_buffer import ImuInterval
from orbslam2py.slam.inertial.inertial_views import InertialViews
from orbslam2py.slam.records import (
    InertialState,
    PoseEstimate,
    PoseMethod,
    Reason,
    TrackingState,
    Verdict,
)
from orbslam2py.slam.state import Motion, State, Velocity

_log = logging.getLogger(__name__)

#: Seconds without a pose of an image that the IMU leads through.
LONGEST = 5.0
# ---- start ----
_LEAST_VIEWS = 8
_LEAST_SECONDS = 1.2
#: Deviations of gravity's direction [rad] and of the scale's logarithm with which the IMU starts.
_GRAVITY_KNOWN, _SCALE_KNOWN = 0.03, 0.03
#: Weighted squared residual per degree of freedom beyond which IMU and camera do not fit.
_MISFIT = 3.0
#: Difference [m/s^2] of gravity's length from 9.81 that is allowed where it is estimated.
_GRAVITY_OFF = 1.5
#: Deviations of a bias before anything is known: gyro [rad/s], accelerometer [m/s^2].
_FIRST_BIAS = (0.1, 0.2)
#: Factor on the stated deviations of views, and their least values: rad, share of the position.
_VIEW_FACTOR, _LEAST_TURN = 1.5, 2e-3
# ---- filter ----
#: Seconds in which the errors of map points are common to all images: together they count as one.
_COMMON = 0.5
#: Their errors in the image [rad], which no residual shows.
_OF_MAP = 1e-3
#: Random walk of the logarithm of the scale of one camera's map [1/sqrt(s)].
_SCALE_WALK = 2e-3
#: Squared Mahalanobis distance (6 degrees of freedom) that one pose in a million exceeds.
_FAR = 38.0
#: Images in a row that contradict the IMU, after which it starts anew.
_CONTRADICTIONS = 5
#: Corrections of gravity [rad] and scale that are worth moving the map for.
_WORTH = 2e-3
#: Seconds from one such correction to the next.
_ALIGN_EVERY = 2.0


class InertialTracker:
    """Gaussian of pose, velocity and biases from image to image.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map that is tracked in. It is turned and scaled when the IMU starts.
    settings : ImuSettings
        The IMU beside the camera.
    metric : bool
        The unit of the map is the metre: with depth.
    idle : callable
        Whether nobody else works on the map.
    """

    def __init__(
        self,
        slam_map: core.Map,
        settings: ImuSettings,
        *,
        metric: bool,
        idle: Callable[[], bool],
    ) -> None:
        self._map = slam_map
        self._T_cb = core.Pose.from_matrix(settings.T_ci)
        self._noise = np.array(
            [settings.gyro_noise, settings.accel_noise, settings.gyro_walk, settings.accel_walk]
        )
        self._metric = metric
        self._idle = idle
        self._views = InertialViews()
        #: Samples, and velocities and biases at keyframes, for bundle adjustment.
        self.keyframes = core.InertialKeyframes(self._T_cb, self._noise)
        #: None: the IMU has not started.
        self.filter: core.InertialFilter | None = None
        #: Seconds of the last image whose pose is its own.
        self._last_seen = -math.inf
        self._T_lw: core.Pose | None = None
        self._big_change = 0
        self._depth = 1.0
        self._innovation: float | None = None
        self._last_covariance: FloatArray | None = None
        self._samples: FloatArray | None = None
        self._map_index = -1
        self._n_contradictions = 0
        self._new_view = False
        self._bias = np.zeros(6)
        self._bias_deviations = _FIRST_BIAS
        # Seconds of the image at which the map was last turned.
        self._aligned_at = -math.inf
        #: May the IMU be used at all; the check of the IMU takes it back.
        self.allowed = True
        #: May the IMU start; the check of the IMU allows it once it has found that the IMU fits.
        self.may_start = True

    # ---- before an image is searched -------------------------------------------------------------
    def predict(self, interval: ImuInterval | None, state: State, timestamp: float) -> State:
        """Predict the pose of an image.

        Parameters
        ----------
        interval : ImuInterval or None
            Samples since the image before.
        state : State
            The state before the image.
        timestamp : float
            Of the image, seconds.

        Returns
        -------
        State
            With the predicted motion and its covariance, if the IMU has started.
        """
        self._innovation = None
        usable = interval is not None and interval.is_complete and len(interval.samples) > 1
        self._samples = interval.samples if usable and interval is not None else None
        followed = state.phase is TrackingState.OK and state.motion.last_frame is not None
        if self._samples is None or not followed or not self.allowed:
            self.forget()
            return state
        state = state.following(self._map)
        motion = state.motion
        if motion.last.map_index != self._map_index:
            self.forget()
            self._map_index = motion.last.map_index
        if self.filter is None:
            state = self._start(state)
        if self.filter is None:
            return state
        self._follow(state.motion)
        self._depth = state.motion.median_depth()
        state = self._realign(state)
        self.keyframes.add_samples(self._samples)
        self.filter.predict(self._samples, 0.0 if self._metric else _SCALE_WALK)
        T_cw, covariance = self.filter.pose()
        T_lw = state.motion.last.T_cw
        assert T_lw is not None
        seconds = timestamp - state.motion.last.timestamp
        predicted = replace(
            state.motion,
            velocity=Velocity(T_cw @ T_lw.inverse(), seconds),
            prediction_covariance=covariance,
        )
        return replace(state, motion=predicted)

    def _follow(self, motion: Motion) -> None:
        """Move the state with the map.

        Loops and merges move the map. Local bundle adjustment corrects the last pose in it: that is
        one more measurement.
        """
        assert self.filter is not None
        last = motion.last
        T_lw = last.T_cw
        assert T_lw is not None
        if self._T_lw is not None:
            T_cw, _ = self.filter.pose()
            moved = T_cw @ self._T_lw.inverse() @ T_lw
            if last.big_change != self._big_change:
                self.filter.move(moved)
            elif self._last_covariance is not None and _differ(self._T_lw, T_lw):
                self.filter.update(moved, self._last_covariance)
        self._T_lw = T_lw
        self._big_change = last.big_change

    # ---- after it --------------------------------------------------------------------------------
    def judge(
        self, frame: core.TrackedFrame, estimate: PoseEstimate, motion: Motion
    ) -> PoseEstimate:
        """Refuse a pose that the IMU contradicts, and give the predicted one where there is none.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame; its pose is set where the IMU leads.
        estimate : PoseEstimate
            What the image gave.
        motion : Motion
            The last frame with a pose of its own.
        """
        if estimate.found and self._contradicts(frame, estimate):
            if _is_strong(estimate):
                # The image says where it is, as after a loss: the next one has to confirm it.
                self.forget()
                return replace(estimate, unconfirmed=True)
            estimate = estimate.failed(Reason.WEAK_EVIDENCE)
        if estimate.found:
            return estimate
        return self._lead(frame, motion) or estimate

    def _contradicts(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> bool:
        """Whether a pose with little evidence, or the first one after a gap, is too far off."""
        if self.filter is None or frame.T_cw is None or estimate.covariance is None:
            return False
        if _is_strong(estimate) and not self._leads:
            return False
        # The stated covariance of a weak pose holds the difference to the prediction itself.
        covariance = estimate.covariance if _is_strong(estimate) else np.zeros((6, 6))
        far = self.filter.distance(frame.T_cw, self._of_image(covariance))
        return far > _FAR

    def tracked(self, frame: core.TrackedFrame, estimate: PoseEstimate) -> None:
        """Take the pose of an image.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            With its pose.
        estimate : PoseEstimate
            The pose, as it was accepted.
        """
        if frame.T_cw is None:
            return
        if self.filter is None:
            self._new_view = self._views.add(self._map, frame, estimate.covariance, self._samples)
            return
        if estimate.relocalized or frame.map_index != self._map_index:
            self.forget()
            return
        if estimate.covariance is not None:
            T_cw, covariance = estimate.by_image or frame.T_cw, self._of_image(estimate.covariance)
            self._innovation = self.filter.distance(T_cw, covariance)
            if estimate.by_image or self._innovation < _FAR:
                self.filter.update(T_cw, covariance)
                self._n_contradictions = 0
            else:
                self._n_contradictions += 1
            self._last_covariance = covariance
        self._last_seen = frame.timestamp
        self._T_lw = frame.T_cw
        self._big_change = frame.big_change
        if self._n_contradictions >= _CONTRADICTIONS:
            _log.warning(
                "the IMU contradicts %d images in a row; it starts anew (orbslam2py check-imu "
                "tells whether it fits the camera)",
                self._n_contradictions,
            )
            self.forget()

    def _lead(self, frame: core.TrackedFrame, motion: Motion) -> PoseEstimate | None:
        """Give a frame that was not found the predicted pose; None where the IMU cannot."""
        if self.filter is None or motion.last_frame is None:
            return None
        if frame.timestamp - self._last_seen > LONGEST:
            _log.info("the IMU has led for %.0f s without an image", LONGEST)
            self.forget()
            return None
        T_cw, covariance = self.filter.pose()
        frame.clear_associations()
        frame.T_cw = T_cw
        frame.share_anchor(motion.last)
        self._n_contradictions = 0
        return PoseEstimate(method=PoseMethod.IMU, covariance=covariance)

    @property
    def _leads(self) -> bool:
        """The image before had no pose of its own."""
        samples = self._samples
        return samples is not None and bool(self._last_seen < samples[0, 0] - 1e-6)

    def record(self) -> InertialState | None:
        """Return velocity and biases at the last image; None where the IMU has not started."""
        if self.filter is None:
            return None
        bias = self.filter.bias
        variances = np.diag(self.filter.covariance)[15:17]
        return InertialState(
            velocity=self.filter.velocity,
            gyro_bias=bias[:3],
            accel_bias=bias[3:],
            gravity_tilt=float(np.hypot(*self.filter.tilt)),
            gravity_deviation=math.sqrt(float(variances.max())),
            innovation=self._innovation,
        )

    def keyframe_made(self, keyframe: int, frame: core.TrackedFrame) -> None:
        """Note velocity and biases of the last tracked frame, which became a keyframe."""
        if self.filter is not None and frame.T_cw is not None:
            velocity = frame.T_cw.rotation_matrix @ self.filter.velocity
            self.keyframes.set(keyframe, velocity, self.filter.bias)

    def _of_image(self, covariance: FloatArray) -> FloatArray:
        """Covariance of a pose by an image for the filter, which takes each as independent."""
        samples = self._samples
        seconds = _COMMON if samples is None else float(samples[-1, 0] - samples[0, 0])
        of_map = np.repeat([_OF_MAP, _OF_MAP * self._depth], 3) ** 2
        return max(1.0, _COMMON / seconds) * (covariance + np.diag(of_map))

    def forget(self) -> None:
        """Drop the state; the biases are kept as what is known before the next start."""
        if self.filter is not None:
            self._bias = self.filter.bias
            deviations = np.sqrt(np.diag(self.filter.covariance)[9:15])
            self._bias_deviations = (
                float(max(1e-3, deviations[:3].max())),
                float(max(0.02, deviations[3:].max())),
            )
        self.filter = None
        self._T_lw = None
        self._n_contradictions = 0
        self._new_view = False
        self._views.clear()

    # ---- start -----------------------------------------------------------------------------------
    def _start(self, state: State) -> State:
        views = self._views.views
        due = (
            self.may_start
            and self._new_view
            and len(views) >= _LEAST_VIEWS
            and self._views.seconds >= _LEAST_SECONDS
        )
        if not due or not self._idle():
            return state
        self._new_view = False
        turn, place = np.median([view.deviations for view in views], axis=0)
        start = core.estimate_inertial_start(
            [view.timestamp for view in views],
            [view.T_wc(self._map) for view in views],
            [view.samples for view in views[1:]],
            self._T_cb,
            self._noise,
            metric=self._metric,
            rotation_deviation=max(_LEAST_TURN, _VIEW_FACTOR * turn),
            position_deviation=max(1e-9, _VIEW_FACTOR * place),
            bias=self._bias,
            gyro_deviation=self._bias_deviations[0],
            accel_deviation=self._bias_deviations[1],
        )
        if not _is_determined(start):
            return state
        _log.info(
            "IMU started after %.1f s: gravity to %.2f degrees, scale to %.1f %%",
            self._views.seconds,
            math.degrees(start.gravity_deviation),
            100 * start.scale_deviation,
        )
        up, scale = start.up, start.scale
        state = self._move_map(state, up, scale)
        T_cw = state.motion.last.T_cw
        assert T_cw is not None
        self.filter = core.InertialFilter(
            self._T_cb,
            self._noise,
            T_cw.inverse() @ self._T_cb,
            up @ start.velocities[-1],
            start.bias,
            start.covariance,
        )
        self._aligned_at = state.motion.last.timestamp
        self._last_seen = state.motion.last.timestamp
        self._T_lw = T_cw
        self._big_change = state.motion.last.big_change
        self._last_covariance = None
        self._views.clear()
        return state

    def _move_map(self, state: State, up: core.Pose, scale: float) -> State:
        core.transform_map(self._map, self._map_index, scale, up)
        self._map.set_upright(self._map_index)
        return state.following(self._map)

    def _realign(self, state: State) -> State:
        """Turn and scale the map anew where gravity and scale turn out to be others."""
        assert self.filter is not None
        now = state.motion.last.timestamp
        if now - self._aligned_at < _ALIGN_EVERY:
            return state
        variances = np.diag(self.filter.covariance)
        tilt, scale = self.filter.tilt, self.filter.log_scale
        turned = float(np.hypot(*tilt)) > max(_WORTH, 2 * math.sqrt(variances[15:17].max()))
        grown = abs(scale) > max(_WORTH, 2 * math.sqrt(variances[17]))
        if not (turned or grown) or not self._idle():
            return state
        self._aligned_at = now
        up = core.Pose.exp(np.array([-tilt[0], -tilt[1], 0, 0, 0, 0]))
        factor = 1.0 if self._metric else math.exp(-scale)
        state = self._move_map(state, up, factor)
        self.filter.transform(factor, up)
        self._T_lw = state.motion.last.T_cw
        self._big_change = state.motion.last.big_change
        return state


def _differ(one: core.Pose, other: core.Pose) -> bool:
    """Whether two poses are others by more than rounding."""
    return max(one.difference(other)) > 1e-7


def _is_strong(estimate: PoseEstimate) -> bool:
    evidence = estimate.evidence
    return evidence is not None and evidence.verdict is Verdict.STRONG


def _is_determined(start: core.InertialStart) -> bool:
    """Whether the data determine gravity and scale, and fit."""
    return bool(
        start.solved
        and start.gravity_deviation < _GRAVITY_KNOWN
        and start.scale_deviation < _SCALE_KNOWN
        and start.cost < _MISFIT * start.freedom
        and abs(start.gravity_length - 9.81) < _GRAVITY_OFF
    )
