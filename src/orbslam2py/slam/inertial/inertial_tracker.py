# SPDX-License-Identifier: BSD-3-Clause
"""Use of the IMU in tracking: start, prediction, and poses where images give none.

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
from orbslam2py.slam.inertial.inertial_start import (
    FIRST_BIAS,
    InertialStarter,
    KnownBefore,
    with_drift,
)
from orbslam2py.slam.inertial.inertial_views import InertialViews
from orbslam2py.slam.inertial.map_moves import MapMove
from orbslam2py.slam.inertial_config import InertialConfig
from orbslam2py.slam.records import (
    InertialState,
    PoseEstimate,
    PoseMethod,
    Reason,
    TrackingState,
    Verdict,
)
from orbslam2py.slam.state import Motion, State

_log = logging.getLogger(__name__)

#: Deviations of gravity [rad] and of the scale's logarithm in an upright map from a file.
_LOADED = (0.01, 0.01)
#: Deviations of the biases of a loaded map: gyro [rad/s], accelerometer [m/s^2]. Their random walk
#: does not tell them: it is not known how long the IMU was off, nor how warm it was and is, and
#: being switched on changes them.
_LOADED_BIAS = (0.01, 0.05)
#: Errors of map points in the image [rad], which no residual shows.
_OF_MAP = 1e-3
#: Squared Mahalanobis distance (6 degrees of freedom) that one pose in a million exceeds.
_FAR = 38.0
#: Successive images that contradict the IMU, after which it starts again.
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
        Whether no other worker uses the map.
    config : InertialConfig
        Thresholds.
    """

    def __init__(
        self,
        slam_map: core.Map,
        settings: ImuSettings,
        *,
        metric: bool,
        idle: Callable[[], bool],
        config: InertialConfig,
    ) -> None:
        self._map = slam_map
        self._T_cb = core.Pose.from_matrix(settings.T_ci)
        self._noise = np.array(
            [settings.gyro_noise, settings.accel_noise, settings.gyro_walk, settings.accel_walk]
        )
        self._metric = metric
        self._idle = idle
        self._limits = config
        self._starter = InertialStarter(self._T_cb, self._noise, metric=metric, config=config)
        self._views = InertialViews()
        #: Samples, and velocities and biases at keyframes, for bundle adjustment.
        noise = config.noise_factor * self._noise
        self.keyframes = core.InertialKeyframes(
            self._T_cb, with_drift(self._noise, config) if metric else noise
        )
        #: None: the IMU has not started.
        self.filter: core.InertialFilter | None = None
        #: Of all maps, also of earlier ones.
        self.map_moves: list[MapMove] = []
        #: Seconds of the last image whose pose is its own.
        self.last_seen = -math.inf
        # Time of the first of the successive images with enough features whose poses the IMU
        # predicts.
        self._shown_since = math.inf
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
        self._bias_deviations = FIRST_BIAS
        # Seconds of the image at which the map was last turned.
        self._aligned_at = -math.inf
        # The state after the longest time without an image: another map begins at its pose.
        self._adrift: core.InertialFilter | None = None
        # Deviations of gravity [rad] and of the scale's logarithm in the maps that were turned.
        self._known: dict[int, tuple[float, float]] = {}
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
        if self._samples is None or not self.allowed:
            self._adrift = None
        if self._samples is None or not followed or not self.allowed:
            self.forget()
            if self._adrift is not None and self._samples is not None:
                self._adrift.predict(self._samples)
            return state
        state = state.following(self._map)
        motion = state.motion
        if motion.last.map_index != self._map_index:
            self.forget()
            self._map_index = motion.last.map_index
        self._adrift = None
        if self.filter is None:
            state = self._start(state)
        if self.filter is None:
            return state
        self._follow(state.motion)
        self._depth = state.motion.median_depth()
        state = self._realign(state)
        self.keyframes.add_samples(self._samples)
        walk = 0.0 if self._leads else self._limits.map_walk
        self.filter.predict(self._samples, 0.0 if self._metric else walk, walk)
        T_cw, covariance = self.filter.pose()
        T_lw = state.motion.last.T_cw
        assert T_lw is not None
        seconds = timestamp - state.motion.last.timestamp
        predicted = replace(
            state.motion,
            velocity=core.Velocity(T_cw @ T_lw.inverse(), seconds),
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
        """Reject a pose that the IMU contradicts; return the predicted pose if there is none.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame; its pose is set if the IMU predicts it.
        estimate : PoseEstimate
            Estimate from the image.
        motion : Motion
            The last frame with a pose by its image.
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
        far = self.filter.distance(frame.T_cw, self._of_image(estimate.covariance))
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
        self._take_over(frame)
        if self._n_contradictions >= _CONTRADICTIONS:
            _log.warning(
                "the IMU contradicts %d images in a row; it starts again (orbslam2py check-imu "
                "checks whether it fits the camera)",
                self._n_contradictions,
            )
            self.forget()

    def _lead(self, frame: core.TrackedFrame, motion: Motion) -> PoseEstimate | None:
        """Give a frame that was not found the predicted pose; None where the IMU cannot."""
        if self.filter is None or motion.last_frame is None:
            return None
        if frame.timestamp - self.last_seen > self._limits.longest:
            _log.info("the IMU has led for %.0f s without an image", self._limits.longest)
            self.end_of_map()
            return None
        T_cw, covariance = self.filter.pose()
        frame.clear_associations()
        frame.T_cw = T_cw
        frame.share_anchor(motion.last)
        self._n_contradictions = 0
        return PoseEstimate(method=PoseMethod.IMU, covariance=covariance)

    @property
    def is_adrift(self) -> bool:
        """Whether the IMU has led to where no image is known, and is still followed."""
        return self._adrift is not None

    def end_of_map(self) -> None:
        """Stop leading; the state is the pose at which another map begins."""
        adrift = self.filter
        self.forget()
        self._adrift = adrift

    def is_beyond_map(self, frame: core.TrackedFrame, shows_enough: bool) -> bool:
        """Return whether a frame with enough features shows a place that is not in the map.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            A frame whose pose the IMU predicts.
        shows_enough : bool
            Its features would do for the begin of a map.
        """
        self._shown_since = min(self._shown_since, frame.timestamp) if shows_enough else math.inf
        return frame.timestamp - self._shown_since >= self._limits.beyond

    def map_continued(self, frame: core.TrackedFrame) -> None:
        """Continue from a keyframe at the predicted pose.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame; its points are at places that follow from its pose.
        """
        assert self.filter is not None
        self.filter.anchor()
        self._take_over(frame)
        self._last_covariance = None

    @property
    def pose_to_begin_at(self) -> core.Pose | None:
        """``T_cw`` at which a map with depth begins after a loss; None: at the origin.

        As long as the IMU knows roll and pitch; the map is then upright from its beginning. A
        single camera's map becomes upright when the IMU starts in it.
        """
        adrift = self._adrift
        if adrift is None or not self._metric:
            return None
        R = adrift.T_wb.rotation_matrix
        covariance = R @ adrift.covariance[:3, :3] @ R.T
        if np.linalg.eigvalsh(covariance[:2, :2])[-1] > self._limits.gravity_known**2:
            return None
        return adrift.pose()[0]

    def map_begun(self, T_cw: core.Pose | None) -> None:
        """Note where a map begins.

        Parameters
        ----------
        T_cw : Pose or None
            As `pose_to_begin_at` gave it.
        """
        self._adrift = None
        if T_cw is not None:
            index = self._map.active_map
            self._map.set_upright(index)
            self._known[index] = (self._limits.gravity_known, self._limits.scale_known)

    @property
    def _leads(self) -> bool:
        """The image before gave no pose."""
        samples = self._samples
        return samples is not None and bool(self.last_seen < samples[0, 0] - 1e-6)

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
        seconds = 1.0 if samples is None else float(samples[-1, 0] - samples[0, 0])
        of_map = np.repeat([_OF_MAP, _OF_MAP * self._depth], 3) ** 2
        return max(1.0, self._limits.common / seconds) * (covariance + np.diag(of_map))

    def map_loaded(self) -> None:
        """Take the newest biases of a map from a file as what is known before the IMU starts."""
        bias = self.keyframes.newest_bias
        if bias is not None:
            self._bias, self._bias_deviations = bias, _LOADED_BIAS

    def reset(self) -> None:
        """Forget all maps; the estimates of the biases stay."""
        self.forget()
        self._adrift = None
        self._known.clear()
        self.keyframes.clear()

    def forget(self) -> None:
        """Drop the state; the biases are kept as priors of the next start."""
        if self.filter is not None:
            self._bias = self.filter.bias
            deviations = np.sqrt(np.diag(self.filter.covariance)[9:18])
            tilt = max(1e-3, float(deviations[6:8].max()))
            self._known[self._map_index] = (tilt, max(1e-3, float(deviations[8])))
            self._bias_deviations = (
                float(max(1e-3, deviations[:3].max())),
                float(max(0.02, deviations[3:6].max())),
            )
        self.filter = None
        self._T_lw = None
        self._n_contradictions = 0
        self._new_view = False
        self._views.clear()

    # ---- start -----------------------------------------------------------------------------------
    def _start(self, state: State) -> State:
        due = self.may_start and self._new_view and self._starter.is_due(self._views)
        if not due or not self._idle():
            return state
        self._new_view = False
        # In a map that was turned before, gravity and scale are known.
        upright = self._map.is_upright(self._map_index)
        gravity, scale = self._known.get(self._map_index, _LOADED) if upright else (0.0, 0.0)
        known = KnownBefore(self._bias, self._bias_deviations, gravity, scale)
        start = self._starter.estimate(self._views, self._map, known)
        if start is None:
            return state
        state = self._move_map(state, start.up, start.scale)
        T_cw = state.motion.last.T_cw
        assert T_cw is not None
        self.filter = core.InertialFilter(
            self._T_cb,
            self._noise,
            T_cw.inverse() @ self._T_cb,
            start.up @ start.velocities[-1],
            start.bias,
            self._starter.covariance(start, self._views.seconds),
        )
        self._aligned_at = state.motion.last.timestamp
        self._take_over(state.motion.last)
        self._last_covariance = None
        self._views.clear()
        return state

    def _take_over(self, last: core.TrackedFrame) -> None:
        """Store the last frame with a pose by its image, at its place in the map."""
        self.last_seen = last.timestamp
        self._shown_since = math.inf
        self._T_lw = last.T_cw
        self._big_change = last.big_change

    def _move_map(self, state: State, up: core.Pose, scale: float) -> State:
        core.transform_map(self._map, self._map_index, scale, up)
        until = state.motion.last.timestamp
        self.map_moves.append(MapMove(self._map_index, until, scale, up))
        self._map.set_upright(self._map_index)
        return state.following(self._map)

    def _realign(self, state: State) -> State:
        """Turn and scale the map again if the estimates of gravity and scale have changed."""
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
