# SPDX-License-Identifier: BSD-3-Clause
"""From a first estimate to a pose that is believed, or not.

``docs/method/tracking.md#evidence``.
"""

from __future__ import annotations

from dataclasses import replace

from orbslam2py import _core as core
from orbslam2py.slam.acceptance.multi_hypothesis_search import Hypothesis, MultiHypothesisSearch
from orbslam2py.slam.acceptance.pose_validator import PoseValidator
from orbslam2py.slam.pose_search import PoseSearch, RefinedPose
from orbslam2py.slam.records import Evidence, PoseEstimate, Reason, Verdict


class PoseAcceptance:
    """Refines poses in the local map, weighs them, and has them searched again when in doubt.

    Parameters
    ----------
    search : PoseSearch
        The ways to a pose.
    judge : PoseValidator
        Says how much speaks for one.
    harder_search : MultiHypothesisSearch
        Looks again.
    """

    def __init__(
        self, search: PoseSearch, judge: PoseValidator, harder_search: MultiHypothesisSearch
    ) -> None:
        self._search = search
        self._judge = judge
        self._harder_search = harder_search
        self.reset()

    def reset(self) -> None:
        """Forget the frames before."""
        self._judge.reset()
        self._n_weak = 0

    def go_elsewhere(self) -> None:
        """What follows is in another place, or in another map."""
        self._judge.go_elsewhere()
        self._n_weak = 0

    def refine(self, frame: core.TrackedFrame, first: PoseEstimate, *, lost: bool) -> PoseEstimate:
        """Give a frame the pose for which most speaks, if enough does.

        Parameters
        ----------
        frame : orbslam2py._core.TrackedFrame
            With the pose and the associations of the first estimate, if that was found.
        first : PoseEstimate
            What was found so far.
        lost : bool
            The frame before has no pose.
        """
        if lost or first.relocalized:
            self.go_elsewhere()
        estimate, hypothesis = first, None
        if first.found:
            refined = self._refined(frame, first)
            hypothesis = self._hypothesis(refined, first)
            estimate = refined.estimate
        doubted = first.left_map or self._is_doubted(hypothesis)
        if doubted and not lost and self._judge.limits.search_again:
            hypothesis = self._harder_search.search_again(frame, hypothesis)
        if hypothesis is None:
            if first.found:
                self._search.settle(refined)
            return estimate
        if self._search.map_is_fixed:
            hypothesis = self._looked_at_afresh(hypothesis, in_doubt=doubted)
        if doubted:
            hypothesis = replace(hypothesis, evidence=replace(hypothesis.evidence, doubted=True))
        return self._take(frame, hypothesis)

    def _hypothesis(self, refined: RefinedPose, first: PoseEstimate) -> Hypothesis | None:
        if not refined.estimate.found:
            return None
        evidence = self._judge.assess(refined, self._search.motion, first.method)
        return Hypothesis(refined, first.method, evidence)

    def _looked_at_afresh(self, hypothesis: Hypothesis, *, in_doubt: bool) -> Hypothesis:
        """The same frame in the same map is to be in the same place, whatever came before it."""
        refined, evidence = hypothesis.refined, hypothesis.evidence
        afresh = self._search.local_map_search.rematch(refined, in_doubt=in_doubt)
        if afresh is refined:
            return hypothesis
        if in_doubt:
            # Much of what held the old pose was not found again.
            evidence = self._judge.assess(afresh, self._search.motion, hypothesis.method)
            if hypothesis.evidence.confirmed and self._judge.is_same(refined, afresh):
                evidence = self._judge.confirm(evidence)
            if evidence.verdict is Verdict.REFUSED:
                return hypothesis
        refined.frame.take_over(afresh.frame)
        return replace(hypothesis, refined=replace(afresh, frame=refined.frame), evidence=evidence)

    def _is_doubted(self, hypothesis: Hypothesis | None) -> bool:
        return hypothesis is None or self._judge.needs_reestimation(hypothesis.evidence)

    def _refined(self, frame: core.TrackedFrame, first: PoseEstimate) -> RefinedPose:
        if first.visual_odometry:
            return self._search.beyond_the_map(frame, first)
        return self._search.in_local_map(frame, first)

    def _take(self, frame: core.TrackedFrame, hypothesis: Hypothesis) -> PoseEstimate:
        refined, evidence = hypothesis.refined, hypothesis.evidence
        if refined.frame is not frame:
            frame.take_over(refined.frame)
            refined = replace(refined, frame=frame)
            if refined.estimate.relocalized:
                # Found without regard to where the camera was: the way from there is no speed.
                expected = refined.estimate.where_expected
                self._search.proving.found_again(frame, where_expected=expected)
                self._search.motion.jump(None)
        self._search.settle(refined)
        motion = self._search.motion
        change = motion.change(frame)
        covariance = self._judge.inflated_covariance(refined, evidence, motion, change)
        estimate = replace(
            refined.estimate, evidence=evidence, method=hypothesis.method, covariance=covariance
        )
        if evidence.verdict is Verdict.REFUSED:
            return estimate.failed(Reason.WEAK_EVIDENCE)
        self._judge.get_used_to_frame(refined, evidence, change)
        if evidence.verdict is Verdict.STRONG or self._may_count(evidence):
            self._judge.get_used_to(refined)
        return estimate

    def allows_keyframe(self, evidence: Evidence | None) -> bool:
        """Whether a frame that is believed may become a keyframe; asked once for each frame."""
        if evidence is None or evidence.verdict is Verdict.STRONG:
            self._n_weak = 0
            return True
        allowed = self._may_count(evidence)
        self._n_weak += 1
        return allowed

    def _may_count(self, evidence: Evidence) -> bool:
        """Whether a weak frame is the usual from now on: not the first, and confirmed."""
        return evidence.confirmed and self._n_weak >= self._judge.limits.weak_frames
