# SPDX-License-Identifier: BSD-3-Clause
"""Weighs a pose by what should have been seen, against the frames before.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.acceptance.motion_innovation import MotionInnovation
from orbslam2py.slam.config import AcceptanceConfig
from orbslam2py.slam.pose_search import MotionModel, RefinedPose
from orbslam2py.slam.records import Evidence, PoseMethod, Verdict


@dataclass(frozen=True)
class RunningMeans:
    """Running means over frames with strong evidence."""

    n_inliers: float
    found: float
    deviation: float

    def moved_to(self, other: RunningMeans, gain: float) -> RunningMeans:
        """A step towards the figures of a newer frame."""
        return RunningMeans(
            self.n_inliers + gain * (other.n_inliers - self.n_inliers),
            self.found + gain * (other.found - self.found),
            self.deviation + gain * (other.deviation - self.deviation),
        )


class PoseValidator:
    """Knows what is usual, and says how far a pose is from it.

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
        self.reset()

    def reset(self) -> None:
        """Nothing is usual yet."""
        self._usual: RunningMeans | None = None
        self._usual_error: float | None = None
        self._error_spread = 0.0
        self._change = MotionInnovation(self.limits)

    def go_elsewhere(self) -> None:
        """What is seen is not usual any more: the place is another one.

        How well it fits is: that goes by the camera and its images.
        """
        self._usual = None
        # Another map of a single camera has another scale.
        self._change = MotionInnovation(self.limits)

    def assess(self, refined: RefinedPose, motion: MotionModel, method: PoseMethod) -> Evidence:
        """Weigh a refined pose.

        Parameters
        ----------
        refined : RefinedPose
            The pose, found in the local map.
        motion : MotionModel
            What the camera did before.
        method : PoseMethod
            What found the pose.
        """
        frame, estimate = refined.frame, refined.estimate
        spread = refined.spread
        figures = _figures(refined)
        usual = self._usual or figures
        turn, move = _changes(frame, motion)
        found_to_usual = _ratio(figures.found, usual.found)
        inliers_to_usual = _ratio(estimate.n_inliers, usual.n_inliers)
        deviation_to_usual = _ratio(figures.deviation, usual.deviation)
        match_error = core.median_match_error(frame)
        usual_error = match_error if self._usual_error is None else self._usual_error
        error_to_usual = _ratio(match_error, usual_error)
        limits = self.limits
        verdict = Verdict.STRONG
        if inliers_to_usual < limits.refused_share and estimate.n_inliers < limits.refused_inliers:
            verdict = Verdict.REFUSED
        elif (
            max(inliers_to_usual, found_to_usual) < limits.weak_share
            or spread.cells <= limits.weak_cells
            or deviation_to_usual > limits.weak_deviation
            or self._errs_suddenly(match_error)
        ):
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
            n_cells=spread.cells,
            n_octaves=spread.octaves,
            deviation_to_usual=deviation_to_usual,
            match_error=match_error,
            error_to_usual=error_to_usual,
            turn_change=turn,
            move_change=move,
        )

    def needs_reestimation(self, evidence: Evidence) -> bool:
        """Whether the pose has to be searched by other ways before it is believed."""
        limits = self.limits
        return (
            evidence.verdict is not Verdict.STRONG
            or min(evidence.inliers_to_usual, evidence.found_to_usual) < limits.sudden_share
            or evidence.deviation_to_usual > limits.sudden_deviation
            or self._windows(evidence.turn_change) > limits.surprise_windows
        )

    def is_same(self, first: RefinedPose, second: RefinedPose) -> bool:
        """Whether two poses of a frame are one, as far as can be told."""
        T_first, T_second = first.frame.T_cw, second.frame.T_cw
        if T_first is None or T_second is None:
            return False
        turn, move = difference(T_first, T_second)
        deviations = first.position_deviation + second.position_deviation
        return (
            self._windows(turn) < self.limits.same_windows
            and move <= self.limits.same_deviations * deviations
        )

    def confirm(self, evidence: Evidence) -> Evidence:
        """A second method came to the same pose: it is believed, though weak evidence stays so."""
        refused = evidence.verdict is Verdict.REFUSED
        verdict = Verdict.WEAK if refused else evidence.verdict
        return replace(evidence, confirmed=True, verdict=verdict)

    def get_used_to(self, refined: RefinedPose) -> None:
        """Let a frame that is believed move what is usual."""
        figures = _figures(refined)
        usual = self._usual
        self._usual = figures if usual is None else usual.moved_to(figures, self.limits.gain)

    def get_used_to_frame(
        self, refined: RefinedPose, evidence: Evidence, change: FloatArray | None
    ) -> None:
        """Let a frame that is believed, strong or weak, move what is usual of image and motion."""
        if change is not None:
            self._change.see(change)
        error = evidence.match_error
        if not math.isfinite(error):
            return
        gain = self.limits.slow_gain if self._errs_suddenly(error) else self.limits.gain
        usual = error if self._usual_error is None else self._usual_error
        self._usual_error = usual + gain * (error - usual)
        self._error_spread += gain * (abs(error - usual) - self._error_spread)

    def inflated_covariance(
        self,
        refined: RefinedPose,
        evidence: Evidence,
        motion: MotionModel,
        change: FloatArray | None,
    ) -> FloatArray | None:
        """The covariance that a pose is told with.

        Keypoints that are off by more than they are taken for make a pose that is less certain, and
        so do few of them, and images of which it is not known what is usual, most where few of the
        points in view were found. Keypoints near each other are wrong together: by a map point in
        the wrong place, or a lens that is not as stated. As far as that shows they count as fewer.
        Errors far beyond the usual ones are
        those of whole regions that move: then each cell with inliers counts as one observation, and
        errors as large as they are. A camera that suddenly turns otherwise smears and bends its
        images while they are taken, and matches that hold a pose less firmly than usual let it be
        pulled further by what is wrong in all of them. Where the map moved since the frame before,
        it was off by as much. And a pose far from where the motion led may be a mistake, however
        well it fits.
        """
        covariance = refined.estimate.covariance
        if covariance is None:
            return None
        limits = self.limits
        if not limits.inflate_covariance:
            return covariance
        surprise = self._pixels(evidence.turn_change) / limits.surprise_pixels
        surprise = min(surprise, limits.largest_surprise)
        looseness = max(1.0, evidence.deviation_to_usual / limits.usual_deviation)
        n_inliers = max(refined.estimate.n_inliers, limits.fewest_inliers)
        factor = (
            self._error_factor(refined, evidence)
            * (1.0 + (limits.few_inliers / n_inliers) ** 4)
            * (1.0 if self._change.is_known else self._unknown_factor(evidence))
            * (1.0 + surprise**2)
            * looseness
        )
        errors = (
            motion.move_of_map(refined.frame),
            self._mistake(change),
        )
        known = [error for error in errors if error is not None]
        # One call: NumPy's take longer than what they do here, and in each frame.
        return core.widened_covariance(covariance, factor, known)

    def _unknown_factor(self, evidence: Evidence) -> float:
        """How many times the variance is while it is not known what is usual.

        As in a map's first frames and in a camera that was just found. Of that one, few of the
        points in view may be those of another place.
        """
        limits = self.limits
        found = max(evidence.found, limits.fewest_found)
        return limits.unknown_change * (1.0 + (limits.few_found / found) ** 4)

    def _error_factor(self, refined: RefinedPose, evidence: Evidence) -> float:
        """How many times the variance is by how the matches fit, and how many are independent."""
        limits = self.limits
        per_cell = refined.estimate.n_inliers / max(1, evidence.n_cells)
        spread = refined.spread
        together = max(1.0, spread.correlation)
        larger = max(1.0, evidence.match_error / limits.expected_error)
        larger *= max(1.0, evidence.match_error / limits.doubtful_error)
        factor = min(larger, limits.largest_error) ** 2 * together
        if self._errs_suddenly(evidence.match_error):
            larger = min(evidence.error_to_usual, limits.largest_error)
            factor = max(factor, larger**2 * max(together, per_cell))
        return factor

    def _mistake(self, change: FloatArray | None) -> FloatArray | None:
        """How far (6,) the pose may be a mistake, by a change of motion that is not usual."""
        beyond = None if change is None else self._change.beyond(change)
        return None if beyond is None else math.sqrt(self.limits.mistaken_share) * beyond

    def _errs_suddenly(self, error: float) -> bool:
        """Whether a median error is larger than that of images before, and than it varies."""
        usual = self._usual_error
        if usual is None or usual <= 0:
            return False
        limits = self.limits
        return error > max(
            limits.weak_error * usual, usual + limits.weak_error_spreads * self._error_spread
        )

    def _windows(self, degrees: float) -> float:
        """How far a turn moves the image, in search windows of the motion model."""
        return self._pixels(degrees) / self._window

    def _pixels(self, degrees: float) -> float:
        """How far a turn moves the image, in pixels."""
        return self._focal_length * math.radians(degrees)


def _figures(refined: RefinedPose) -> RunningMeans:
    estimate = refined.estimate
    n_inliers = estimate.n_inliers
    return RunningMeans(
        float(n_inliers),
        min(1.0, n_inliers / max(1, refined.n_predicted)),
        refined.position_deviation,
    )


def _ratio(value: float, usual: float) -> float:
    return value / usual if usual > 0 else 1.0


def _changes(frame: core.TrackedFrame, motion: MotionModel) -> tuple[float, float]:
    """Degrees and metres by which a frame moved otherwise than the frame before it."""
    if motion.velocity is None or not motion.has_last:
        return 0.0, 0.0
    T_lw, T_cw = motion.last.T_cw, frame.T_cw
    if T_lw is None or T_cw is None:
        return 0.0, 0.0
    return difference(T_cw, motion.velocity @ T_lw)


def difference(T_aw: core.Pose, T_bw: core.Pose) -> tuple[float, float]:
    """Degrees and metres between two poses of one camera."""
    turn, move = T_aw.difference(T_bw)
    return math.degrees(turn), move
