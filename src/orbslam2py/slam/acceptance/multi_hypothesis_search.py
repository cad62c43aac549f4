# SPDX-License-Identifier: BSD-3-Clause
"""Search of other hypotheses when the evidence of a pose falls; the best supported one wins.

``docs/method/tracking.md#harder-search``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.acceptance.pose_validator import PoseValidator
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import Evidence, PoseEstimate, PoseMethod, Reason, Verdict
from orbslam2py.slam.state import State

_BETTER = 1.1  # factor on the inliers with which another hypothesis wins
_ENOUGH = 0.75  # share of the mean inliers with which no further hypothesis is searched
_KEYFRAMES_AROUND = 3  # neighbours of the reference keyframe: each costs a matching by words
_ALIGNED_WINDOW = 15.0  # half width of the search window after a rotation of the image, pixels
#: Only without any strong hypothesis: these take longest.
_LAST = (PoseMethod.ALL_KEYPOINTS, PoseMethod.RELOCALIZATION)
_WIDE_WINDOW = 40.0  # the same around a prediction in doubt, pixels at level 0

Way = Callable[[core.TrackedFrame, State], tuple[PoseEstimate, State]]


@dataclass(frozen=True)
class Hypothesis:
    """A pose, the method that found it, and its evidence."""

    refined: RefinedPose
    method: PoseMethod
    evidence: Evidence

    @property
    def n_inliers(self) -> int:
        """The evidence of the pose in the local map."""
        return self.refined.estimate.n_inliers


class MultiHypothesisSearch:
    """Tries methods that do not depend on the velocity.

    Parameters
    ----------
    search : PoseSearch
        Estimates poses.
    judge : PoseValidator
        Judges the hypotheses.
    """

    def __init__(self, search: PoseSearch, judge: PoseValidator) -> None:
        self._search = search
        self._judge = judge

    def search_again(
        self, frame: core.TrackedFrame, first: Hypothesis | None, state: State
    ) -> tuple[Hypothesis | None, State]:
        """Find the pose with the strongest evidence, and whether two methods agree on it.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            The frame; it is not changed.
        first : Hypothesis or None
            The pose in doubt; None if nothing was found.
        state : State
            The state before the frame.

        Returns
        -------
        Hypothesis or None
            The hypothesis with the strongest evidence: `first`, unless another hypothesis is
            clearly better; None if nothing was found.
        State
            The state after relocalization.
        """
        found = [] if first is None else [first]
        for method, way in self._ways(state):
            if method in _LAST and any(h.evidence.verdict is Verdict.STRONG for h in found):
                break
            version = core.TrackedFrame(frame.features)
            estimate, state = way(version, state)
            if self._add(found, version, estimate, method, state):
                break
        return self._best(found) if found else None, state

    def _add(
        self,
        found: list[Hypothesis],
        version: core.TrackedFrame,
        estimate: PoseEstimate,
        method: PoseMethod,
        state: State,
    ) -> bool:
        """Add an estimate that found a pose; return whether the search may end."""
        if not estimate.found:
            return False
        refined = self._search.local_map_search.refine(version, estimate, state)
        if not refined.estimate.found:
            return False
        hypothesis = Hypothesis(refined, method, self._judge.assess(refined, state, method))
        enough = self._has_enough(hypothesis, found)
        found.append(hypothesis)
        return enough

    def _ways(self, state: State) -> Iterator[tuple[PoseMethod, Way]]:
        """The methods in the order of their cost."""
        search = self._search
        yield PoseMethod.ALIGNED_IMAGES, lambda v, s: (self._by_aligned_images(v, s), s)
        yield (
            PoseMethod.KEYFRAMES_AROUND,
            lambda v, s: (search.by_keyframes(v, s, _KEYFRAMES_AROUND), s),
        )
        if state.motion.velocity is not None:
            yield PoseMethod.WIDE_WINDOW, lambda v, s: (self._by_wide_window(v, s), s)
        yield PoseMethod.ALL_KEYPOINTS, lambda v, s: (search.by_all_keypoints(v, s), s)
        yield PoseMethod.RELOCALIZATION, search.by_relocalization

    def _by_aligned_images(self, frame: core.TrackedFrame, state: State) -> PoseEstimate:
        limits, motion = self._judge.limits, state.motion
        aligned = core.align_rotation(motion.last.features, frame.features)
        if aligned is None or aligned.correlation < limits.aligned_correlation:
            return PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME)
        motion.predict_turned(frame, aligned.quaternion_xyzw)
        return self._search.around_prediction(frame, motion, _ALIGNED_WINDOW)

    def _by_wide_window(self, frame: core.TrackedFrame, state: State) -> PoseEstimate:
        state.motion.predict(frame)
        return self._search.around_prediction(frame, state.motion, _WIDE_WINDOW)

    def _has_enough(self, hypothesis: Hypothesis, others: list[Hypothesis]) -> bool:
        """Whether further methods cannot improve the result."""
        if hypothesis.evidence.inliers_to_usual >= _ENOUGH:
            return True
        return any(self._confirms(hypothesis, other) for other in others)

    def _confirms(self, one: Hypothesis, other: Hypothesis) -> bool:
        by_words = (PoseMethod.REFERENCE_KEYFRAME, PoseMethod.KEYFRAMES_AROUND)
        alike = one.method in by_words and other.method in by_words
        return not alike and self._judge.is_same(one.refined, other.refined)

    def _best(self, found: list[Hypothesis]) -> Hypothesis:
        best = found[0]
        for hypothesis in found[1:]:
            # The first hypothesis stays unless another one is clearly better.
            if hypothesis.n_inliers > _BETTER * best.n_inliers:
                best = hypothesis
        if any(self._confirms(best, other) for other in found if other is not best):
            best = replace(best, evidence=self._judge.confirm(best.evidence))
        return best
