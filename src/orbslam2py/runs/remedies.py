# SPDX-License-Identifier: BSD-3-Clause
"""Remedies for frames without a pose, by reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from orbslam2py._arguments import number_of
from orbslam2py.runs.result import DROPPED, FrameRow
from orbslam2py.slam.records import Reason

#: In the words of `docs/reference/reasons.md`.
_WHAT_HELPS = {
    Reason.TOO_FEW_KEYPOINTS: "light, texture, a sharp image; ORBextractor.minThFAST down, "
    "ORBextractor.nFeatures up",
    Reason.TOO_FEW_DEPTHS: "stereo: rectified pair, left and right not swapped; RGB-D: registered "
    "depth, right DepthMapFactor, things within range",
    Reason.FIRST_VIEW: "move the camera sideways; give it more images",
    Reason.FEW_MATCHES_FIRST_VIEW: "slower motion, higher frame rate, more features "
    "(ORBextractor.nFeatures)",
    Reason.LOW_PARALLAX: "move further sideways, or closer to things",
    Reason.AMBIGUOUS_MOTION: "move further sideways; include things at several distances, "
    "not one wall or flat ground",
    Reason.DEGENERATE_VIEWS: "translate: a plane alone can start a map, a pure rotation cannot",
    Reason.NO_THIRD_VIEW: "keep moving; a mask for moving objects (--mask)",
    Reason.INITIAL_MAP_FAILED: "keep moving sideways; more features (ORBextractor.nFeatures), "
    "things at several distances",
    Reason.FEW_MATCHES_LAST_FRAME: "slower motion, higher frame rate; come back to the map",
    Reason.FEW_MATCHES_REFERENCE: "slower motion, higher frame rate, more features "
    "(ORBextractor.nFeatures), more light, a wider lens",
    Reason.FEW_INLIERS_REFERENCE: "a mask for what moves (--mask); the right calibration",
    Reason.FEW_INLIERS_LOCAL_MAP: "more features (ORBextractor.nFeatures), texture and light, a "
    "wider lens; more time at one place before moving on",
    Reason.WEAK_EVIDENCE: "slower turns, higher frame rate, less blur; more features "
    "(ORBextractor.nFeatures), a wider lens",
    Reason.MAP_CONTRADICTED: "begin a map with slow motion sideways, not with turns; the right "
    "calibration",
    Reason.NOT_FOUND_IN_MAP: "come back to a place seen before, from a similar direction",
    Reason.SEVERAL_PLACES: "turn to something that is there only once, or stay until several "
    "images have been searched",
    Reason.NOT_CONFIRMED: "stay at a place seen before for a moment, from a similar direction",
    Reason.SEARCHING_LOADED_MAP: "begin at a place that is in the map, from a similar direction, "
    "or say where the camera is (--initial-pose); without --load a new map is made",
}


def what_helps(reason: Reason | str) -> str:
    """Return the remedy for frames with this reason; empty if there is none."""
    if reason == DROPPED:
        return "leave out --realtime; fewer features (ORBextractor.nFeatures), smaller images"
    return next((text for known, text in _WHAT_HELPS.items() if known.value == str(reason)), "")


def why_nothing_was_tracked(
    rows: Sequence[FrameRow], *, calibration_is_doubted: bool = False
) -> str:
    """Return the most frequent reason of a run without a pose, its share, and the remedy.

    `FIRST_VIEW` is given only if there is no other reason. All unreadable frames count as one
    reason, that of the first one. If there is a warning about the calibration, it comes before the
    other remedies.
    """
    reasons = Counter(row.reason for row in rows if row.state != "SKIPPED" and row.reason)
    skipped = [row.reason for row in rows if row.state == "SKIPPED"]
    waiting = reasons.pop(Reason.FIRST_VIEW.value, 0)
    if not reasons and waiting:
        reasons[Reason.FIRST_VIEW.value] = waiting
    reason, count = next(iter(reasons.most_common(1)), ("", 0))
    if len(skipped) > count:
        others = number_of(len(skipped) - 1, "more frame")
        more = f" (and {others} skipped)" if len(skipped) > 1 else ""
        return skipped[0] + more
    if not reason:
        return "no frames"
    told = f"{reason} ({count} of {number_of(len(rows), 'frame')})"
    remedy = what_helps(reason)
    if calibration_is_doubted:
        told = f"most likely because of the calibration, see the warning above; seen: {told}"
        return f"{told}; if the calibration is right, what helps: {remedy}" if remedy else told
    return f"{told}; what helps: {remedy}" if remedy else told
