# SPDX-License-Identifier: BSD-3-Clause
"""Evaluation against ground truth: trajectories, laps, poses in a map, closed loops."""

from orbslam2py.evaluation.alignment import Alignment, FitByTime, differ_in_unit, fit_by_time
from orbslam2py.evaluation.conventions import OtherReading, find_other_reading
from orbslam2py.evaluation.keyframes import (
    PoseError,
    errors_through_keyframes,
    nearest_keyframes,
    pose_error,
)
from orbslam2py.evaluation.laps import LapError, lap_error, scale_drift
from orbslam2py.evaluation.loops import (
    LoopError,
    Revisit,
    closed_revisits,
    find_revisits,
    loop_error,
    metres_per_unit_at,
)
from orbslam2py.evaluation.matching import Matched, describe_match, match_poses
from orbslam2py.evaluation.metrics import (
    SEGMENT_LENGTHS,
    ErrorStatistics,
    Evaluation,
    evaluate_trajectory,
    one_second_pairs,
    relative_errors,
    segment_errors,
)
from orbslam2py.evaluation.pairing import Paired, Poses, ends_early, pair, read_estimate, read_truth
from orbslam2py.trajectory import Similarity, align

__all__ = [
    "SEGMENT_LENGTHS",
    "Alignment",
    "ErrorStatistics",
    "Evaluation",
    "FitByTime",
    "LapError",
    "LoopError",
    "Matched",
    "OtherReading",
    "Paired",
    "PoseError",
    "Poses",
    "Revisit",
    "Similarity",
    "align",
    "closed_revisits",
    "describe_match",
    "differ_in_unit",
    "ends_early",
    "errors_through_keyframes",
    "evaluate_trajectory",
    "find_other_reading",
    "find_revisits",
    "fit_by_time",
    "lap_error",
    "loop_error",
    "match_poses",
    "metres_per_unit_at",
    "nearest_keyframes",
    "one_second_pairs",
    "pair",
    "pose_error",
    "read_estimate",
    "read_truth",
    "relative_errors",
    "scale_drift",
    "segment_errors",
]
