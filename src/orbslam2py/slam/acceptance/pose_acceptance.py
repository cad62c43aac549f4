# SPDX-License-Identifier: BSD-3-Clause
"""From a first estimate to an accepted or rejected pose.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.acceptance.multi_hypothesis_search import Hypothesis, MultiHypothesisSearch
from orbslam2py.slam.acceptance.pose_validator import PoseValidator, statistics_of
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import Evidence, PoseEstimate, Reason, Verdict
from orbslam2py.slam.state import State

_WEAK_FRAMES = 2  # uncertain ones in a row, after which a confirmed one may become a keyframe


class PoseAcceptance:
    """Refines poses in the local map, validates them, and searches other hypotheses in doubt.

    Parameters
    ----------
    search : PoseSearch
        Estimates poses.
    judge : PoseValidator
        Validates poses by their evidence.
    harder_search : MultiHypothesisSearch
        Looks again.
    """

    def __init__(
        self, search: PoseSearch, judge: PoseValidator, harder_search: MultiHypothesisSearch
    ) -> None:
        self._search = search
        self._judge = judge
        self._harder_search = harder_search

    def refine(
        self,
        frame: core.TrackedFrame,
        first: PoseEstimate,
        state: State,
        *,
        fixed_map: bool = False,
    ) -> tuple[PoseEstimate, State]:
        """Estimate the pose with the strongest evidence, and accept or reject it.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            It has the pose and the associations of the first estimate, if there is one.
        first : PoseEstimate
            The first estimate.
        state : State
            The state before the frame.
        fixed_map : bool
            Localization mode: the map does not change.
        """
        if state.is_lost or first.relocalized:
            state = state.elsewhere()
        estimate, hypothesis = first, None
        if first.found:
            refined = self._search.local_map_search.refine(frame, first, state)
            hypothesis = self._hypothesis(refined, first, state)
            estimate = refined.estimate
        doubted = first.left_map or self._is_doubted(hypothesis)
        if doubted and not state.is_lost and self._judge.limits.search_again:
            hypothesis, state = self._harder_search.search_again(frame, hypothesis, state)
        if hypothesis is None:
            if first.found:
                state = self._search.settle(refined, state, fixed_map=fixed_map)
            return estimate, state
        if fixed_map:
            hypothesis = self._rematched(hypothesis, state, in_doubt=doubted)
        if doubted:
            hypothesis = replace(hypothesis, evidence=replace(hypothesis.evidence, doubted=True))
        return self._take(frame, hypothesis, state, fixed_map=fixed_map)

    def _hypothesis(
        self, refined: RefinedPose, first: PoseEstimate, state: State
    ) -> Hypothesis | None:
        if not refined.estimate.found:
            return None
        evidence = self._judge.assess(refined, state, first.method)
        return Hypothesis(refined, first.method, evidence)

    def _rematched(self, hypothesis: Hypothesis, state: State, *, in_doubt: bool) -> Hypothesis:
        """In a fixed map, the pose of an image must not depend on the frames before it."""
        refined, evidence = hypothesis.refined, hypothesis.evidence
        rematched = self._search.local_map_search.rematch(refined, in_doubt=in_doubt)
        if rematched is refined:
            return hypothesis
        if in_doubt:
            # Much of what supported the old pose was not found again.
            evidence = self._judge.assess(rematched, state, hypothesis.method)
            if hypothesis.evidence.confirmed and self._judge.is_same(refined, rematched):
                evidence = self._judge.confirm(evidence)
            if evidence.verdict is Verdict.REFUSED:
                return hypothesis
        refined.frame.take_over(rematched.frame)
        refined = replace(rematched, frame=refined.frame)
        return replace(hypothesis, refined=refined, evidence=evidence)

    def _is_doubted(self, hypothesis: Hypothesis | None) -> bool:
        return hypothesis is None or self._judge.needs_reestimation(hypothesis.evidence)

    def _take(
        self, frame: core.TrackedFrame, hypothesis: Hypothesis, state: State, *, fixed_map: bool
    ) -> tuple[PoseEstimate, State]:
        refined, evidence = hypothesis.refined, hypothesis.evidence
        if refined.frame is not frame:
            frame.take_over(refined.frame)
            refined = replace(refined, frame=frame)
            if refined.estimate.relocalized:
                # Found independently of the last frame: the motion from there is no velocity.
                state = state.relocalized(frame.id)
                state = replace(state, motion=state.motion.jumped(None))
        state = self._search.settle(refined, state, fixed_map=fixed_map)
        covariance = self._judge.stated_covariance(refined, evidence.match_error, state.motion)
        estimate = replace(
            refined.estimate, evidence=evidence, method=hypothesis.method, covariance=covariance
        )
        if evidence.verdict is Verdict.REFUSED:
            return estimate.failed(Reason.WEAK_EVIDENCE), state
        scene = state.scene.with_error(evidence.match_error)
        if evidence.verdict is Verdict.STRONG or self._may_count(evidence, state):
            scene = scene.with_pose(statistics_of(refined))
        return estimate, replace(state, scene=scene)

    def allows_keyframe(self, evidence: Evidence | None, state: State) -> tuple[bool, State]:
        """Return whether a frame may become a keyframe; called once for each frame."""
        if evidence is None or evidence.verdict is Verdict.STRONG:
            return True, replace(state, n_uncertain=0)
        allowed = self._may_count(evidence, state)
        return allowed, replace(state, n_uncertain=state.n_uncertain + 1)

    def _may_count(self, evidence: Evidence, state: State) -> bool:
        """Return whether a weak frame is treated as strong: confirmed, not the first."""
        return evidence.confirmed and state.n_uncertain >= _WEAK_FRAMES
