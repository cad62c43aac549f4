# SPDX-License-Identifier: BSD-3-Clause
"""Validation of a pose: compare its evidence with that of the frames before.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

import math

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._values import replace
from orbslam2py.slam.config import AcceptanceConfig
from orbslam2py.slam.pose_search import RefinedPose
from orbslam2py.slam.records import Evidence, PoseMethod, Verdict
from orbslam2py.slam.state import Motion, PoseStatistics, State

_SAME_WINDOWS = 0.5  # search windows in the image that two versions of one pose may differ by
_SAME_DEVIATIONS = 3.0  # standard deviations of the position that they may differ by


class PoseValidator:
    """Compares a pose with the running means of the scene.

    Parameters
    ----------
    window : float
        Half width of the motion model's search window, pixels at level 0.
    focal_length : float
        Pixels.
    config : AcceptanceConfig
        Limits.
    """

    def __init__(self, window: float, focal_length: float, config: AcceptanceConfig) -> None:
        self.limits = config
        self._window = window
        self._focal_length = focal_length

    def assess(self, refined: RefinedPose, state: State, method: PoseMethod) -> Evidence:
        """Weigh a refined pose.

        Parameters
        ----------
        refined : RefinedPose
            The pose, found in the local map.
        state : State
            The state before the frame.
        method : PoseMethod
            The method that found the pose.
        """
        frame, estimate = refined.frame, refined.estimate
        figures, scene = statistics_of(refined), state.scene
        usual = scene.usual or figures
        turn, move = _changes(frame, state.motion)
        cells, octaves, match_error, _ = refined.evidence
        found_to_usual = _ratio(figures.found, usual.found)
        inliers_to_usual = _ratio(estimate.n_inliers, usual.n_inliers)
        deviation_to_usual = _ratio(figures.deviation, usual.deviation)
        usual_error = match_error if scene.error is None else scene.error
        error_to_usual = _ratio(match_error, usual_error)
        limits = self.limits
        verdict = Verdict.STRONG
        if inliers_to_usual < limits.refused_share and estimate.n_inliers < limits.refused_inliers:
            verdict = Verdict.REFUSED
        elif max(inliers_to_usual, found_to_usual) < limits.weak_share:
            verdict = Verdict.WEAK
        return Evidence(
            verdict=verdict,
            method=method,
            doubted=False,
            confirmed=False,
            n_predicted=refined.n_predicted,
            found=figures.found,
            found_to_usual=found_to_usual,
            inliers_to_usual=inliers_to_usual,
            n_cells=cells,
            n_octaves=octaves,
            deviation_to_usual=deviation_to_usual,
            match_error=match_error,
            error_to_usual=error_to_usual,
            turn_change=turn,
            move_change=move,
        )

    def needs_reestimation(self, evidence: Evidence) -> bool:
        """Return whether other methods must search the pose before it is accepted."""
        least = min(evidence.inliers_to_usual, evidence.found_to_usual)
        return evidence.verdict is not Verdict.STRONG or least < self.limits.sudden_share

    def is_same(self, first: RefinedPose, second: RefinedPose) -> bool:
        """Return whether two poses of a frame are equal within their uncertainty."""
        T_first, T_second = first.frame.T_cw, second.frame.T_cw
        if T_first is None or T_second is None:
            return False
        turn, move = T_first.difference(T_second)
        deviations = first.position_deviation + second.position_deviation
        return (
            self._windows(math.degrees(turn)) < _SAME_WINDOWS
            and move <= _SAME_DEVIATIONS * deviations
        )

    def confirm(self, evidence: Evidence) -> Evidence:
        """A second method found the same pose: accept it, but weak evidence stays weak."""
        refused = evidence.verdict is Verdict.REFUSED
        verdict = Verdict.WEAK if refused else evidence.verdict
        return replace(evidence, confirmed=True, verdict=verdict)

    def stated_covariance(
        self,
        refined: RefinedPose,
        match_error: float,
        motion: Motion,
    ) -> FloatArray | None:
        """Return the stated covariance (6, 6) of a pose; None if it is not known.

        It is cluster-robust: residuals of neighbouring keypoints may have errors in common. It
        grows with the median error of all matches, because the inliers of a wide distribution look
        narrow. Two things that residuals cannot show are added. The map was wrong by as much as
        local bundle adjustment has moved it since the last frame. And with a small probability the
        prediction is right and the pose is wrong by the whole innovation. This term is left out
        where an IMU predicts: the IMU has its own test of the pose.

        Parameters
        ----------
        refined : RefinedPose
            The pose.
        match_error : float
            Median error of its matches, with outliers, in standard deviations.
        motion : Motion
            The last frame and the velocity.
        """
        covariance, limits = refined.estimate.covariance, self.limits
        if covariance is None or not limits.robust_covariance:
            return covariance
        robust = refined.evidence[3]
        scale = max(1.0, match_error / limits.expected_error)
        if motion.last_frame is None:
            return scale**2 * robust
        by_imu = motion.prediction_covariance is not None
        return core.stated_covariance(
            robust,
            scale**2,
            refined.frame,
            motion.last_frame,
            None if by_imu else motion.velocity,
            motion.map_motion,
            limits.wrong_share,
        )

    def _windows(self, degrees: float) -> float:
        """Return how far a rotation moves the image, in search windows of the motion model."""
        return self._focal_length * math.radians(degrees) / self._window


def statistics_of(refined: RefinedPose) -> PoseStatistics:
    """Return the numbers of a pose for the running means of the scene."""
    estimate = refined.estimate
    n_inliers = estimate.n_inliers
    return PoseStatistics(
        float(n_inliers),
        min(1.0, n_inliers / max(1, refined.n_predicted)),
        refined.position_deviation,
    )


def _ratio(value: float, usual: float) -> float:
    return value / usual if usual > 0 else 1.0


def _changes(frame: core.TrackedFrame, motion: Motion) -> tuple[float, float]:
    """Return the degrees and metres by which a frame differs from the predicted motion."""
    if motion.last_frame is None:
        return 0.0, 0.0
    turn, move = core.change_from_prediction(frame, motion.last_frame, motion.velocity)
    return math.degrees(turn), move
