# SPDX-License-Identifier: BSD-3-Clause
"""Rows of runs that never were: states and reasons as a test wants them."""

from __future__ import annotations

import numpy as np

from orbslam2py import Evidence, PoseMethod, Reason, TrackingRecord, TrackingState, Verdict
from orbslam2py.runs import FrameRow
from orbslam2py.runs.result import DROPPED

#: Frames per second of the rows.
FPS = 10

_STATES = {
    "k": (TrackingState.OK, Reason.NONE),
    "w": (TrackingState.OK, Reason.NONE),
    "n": (TrackingState.NOT_INITIALIZED, Reason.TOO_FEW_KEYPOINTS),
    "f": (TrackingState.NOT_INITIALIZED, Reason.FIRST_VIEW),
    "m": (TrackingState.NOT_INITIALIZED, Reason.FEW_MATCHES_FIRST_VIEW),
    "r": (TrackingState.LOST, Reason.FEW_MATCHES_REFERENCE),
    "i": (TrackingState.LOST, Reason.FEW_INLIERS_LOCAL_MAP),
    "l": (TrackingState.LOST, Reason.NOT_FOUND_IN_MAP),
}


def rows_of(letters: str) -> list[FrameRow]:
    """One row for every letter.

    k: tracked; w: tracked with weak evidence; r, i: just lost; l: lost; n, f, m: no map yet;
    d: dropped; s: skipped.
    """
    return [_row(index, letter) for index, letter in enumerate(letters)]


def _row(index: int, letter: str) -> FrameRow:
    text = f"{index / FPS:.3f}"
    if letter in "ds":
        return FrameRow(index, text, None, DROPPED if letter == "d" else f"image {index} is empty")
    state, reason = _STATES[letter]
    record = TrackingRecord(
        frame_id=index,
        timestamp=float(text),
        map_index=0,
        state=state,
        reason=reason,
        T_cw=np.eye(4) if state is TrackingState.OK else None,
        covariance=None,
        n_matches=0,
        n_inliers=0,
        is_keyframe=False,
        reference_keyframe=-1,
        evidence=evidence(Verdict.WEAK, 0.125) if letter == "w" else None,
    )
    return FrameRow(index, text, record, str(reason))


def evidence(verdict: Verdict, found: float) -> Evidence:
    """What speaks for a pose that was looked at twice."""
    return Evidence(
        verdict=verdict,
        method=PoseMethod.ALIGNED_IMAGES,
        doubted=True,
        confirmed=False,
        n_predicted=800,
        found=found,
        found_to_usual=found / 0.5,
        inliers_to_usual=0.25,
        n_cells=20,
        n_octaves=3,
        deviation_to_usual=2.0,
        match_error=0.6,
        error_to_usual=1.2,
        turn_change=4.0,
        move_change=0.1,
    )
