# SPDX-License-Identifier: BSD-3-Clause
"""How far an estimate is from the truth: alignment, absolute and relative errors, laps."""

from orbslam2py.evaluation.alignment import Alignment, Similarity, align, match_poses
from orbslam2py.evaluation.laps import LapError, lap_error, scale_drift
from orbslam2py.evaluation.metrics import (
    SEGMENT_LENGTHS,
    ErrorStatistics,
    Evaluation,
    evaluate_trajectory,
    one_second_pairs,
    relative_errors,
    segment_errors,
)

__all__ = [
    "SEGMENT_LENGTHS",
    "Alignment",
    "ErrorStatistics",
    "Evaluation",
    "LapError",
    "Similarity",
    "align",
    "evaluate_trajectory",
    "lap_error",
    "match_poses",
    "one_second_pairs",
    "relative_errors",
    "scale_drift",
    "segment_errors",
]
