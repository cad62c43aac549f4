# SPDX-License-Identifier: BSD-3-Clause
"""The figures of a run: report.json."""

from __future__ import annotations

import contextlib
import logging
import resource
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._files import describe_error, printable_name
from orbslam2py._version import __version__
from orbslam2py.errors import OrbSlamError
from orbslam2py.evaluation import Alignment, Evaluation, evaluate_trajectory
from orbslam2py.maps.map_file import MapFile
from orbslam2py.maps.saved_map import SavedMap
from orbslam2py.runs.gravity import Height, height_of
from orbslam2py.runs.losses import losses_report
from orbslam2py.runs.machine import describe_machine
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.result import RunResult
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.events import LoopClosed, MapsMerged
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord
from orbslam2py.slam.records import TrackingState, Verdict
from orbslam2py.trajectory.trajectory import Trajectory

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class RunEvaluation:
    """A run against ground truth."""

    figures: Evaluation
    """Of all tracked frames."""
    keyframes_ate_rmse: float | None
    """ATE of the keyframes [m]; None if too few of them have a true pose."""
    truth: Trajectory
    """Ground truth during the whole run, in the estimate's frame and unit."""
    height: Height
    """The up direction in the estimate's frame."""
    scaled: Evaluation | None = None
    """With the scale of the alignment: only for one camera with an IMU, to judge its metres."""


def evaluate_run(result: RunResult) -> RunEvaluation | None:
    """Compare the main map's trajectory with the sequence's ground truth.

    Returns
    -------
    RunEvaluation or None
        None if there is no ground truth, or no pose has a true one.
    """
    estimate = result.tracked_trajectory()
    alignment = Alignment.SE3 if result.is_metric else Alignment.SIM3
    try:
        truth = result.sequence.ground_truth()
        if truth is None or not len(estimate):
            return None
        figures = evaluate_trajectory(estimate, truth, alignment)
        scaled = None
        if result.is_metric and result.options.sensor is Sensor.MONOCULAR:
            scaled = evaluate_trajectory(estimate, truth, Alignment.SIM3)
    except (OrbSlamError, OSError) as error:
        _log.warning("no comparison with ground truth: %s", describe_error(error))
        return None
    keyframes_ate = _ate_of_keyframes(result.keyframes, truth, alignment)
    begin, end = float(result.rows[0].timestamp) - 0.02, float(result.rows[-1].timestamp) + 0.02
    during = truth.select((truth.timestamps >= begin) & (truth.timestamps <= end))
    T_wc = figures.transform.inverse().apply_to_poses(during.T_wc)
    height = height_of(result.sequence, estimate, truth)
    path = Trajectory(during.timestamps, T_wc)
    return RunEvaluation(figures, keyframes_ate, path, height, scaled)


def _ate_of_keyframes(
    keyframes: Trajectory, truth: Trajectory, alignment: Alignment
) -> float | None:
    try:
        ate = evaluate_trajectory(keyframes, truth, alignment).ate
    except OrbSlamError as error:
        _log.warning("the keyframes alone are not compared with ground truth: %s", error)
        return None
    return None if ate is None else ate.rmse


def make_report(result: RunResult, evaluation: RunEvaluation | None) -> dict[str, Any]:
    """Everything report.json holds."""
    options = result.options
    n_done = len(result.rows)
    n_tracked = result.n_tracked
    n_frames = n_done if result.n_frames is None else result.n_frames
    losses = losses_report(result.rows)
    each_loss = losses.pop("losses")
    report: dict[str, Any] = {
        "version": __version__,
        "sequence": printable_name(result.sequence.name),
        "layout": result.sequence.layout,
        "sensor": options.sensor.value,
        "settings": result.settings.to_yaml(),
        "deterministic": options.system.deterministic,
        "realtime": options.realtime,
        "seed": options.system.seed,
        "options": options_entry(options),
        "command": result.command,
        "command_folder": None if result.command is None else str(Path.cwd()),
        "started": result.started,
        "machine": describe_machine(),
        "frames": n_frames,
        "seen_frames": n_done,
        "tracked": n_tracked,
        "tracked_fraction": n_tracked / n_frames if n_frames else 0.0,
        "skipped_frames": result.n_skipped,
        "dropped_frames": result.n_dropped,
        "input": result.input_counts,
        "keyframes": len(result.keyframes),
        "map_points": len(result.snapshot.point_ids),
        "loaded_map": loaded_map_entry(options.load_map),
        "saved_map": None if result.saved_map is None else str(result.saved_map),
        "maps": maps_entry(result),
        "main_map": result.main_map,
        "loops_closed": len(result.loops),
        "relocalisations": result.n_relocalizations,
        "resets": result.n_resets,
        "weak_frames": weak_frames(result),
        **losses,
        "initialisation_reasons": initialization_reasons(result),
        "depth": depth_entry(result),
        "alignment": result.alignment,
        "imu": result.imu,
        "warnings": result.warnings,
        "interrupted": result.interrupted,
        "error": error_entry(result.error),
        "seconds": result.seconds,
        "frames_per_second": _rate(n_done, result.seconds),
        "slam_frames_per_second": _rate(n_done, result.slam_seconds),
        "peak_memory_mb": peak_memory_mb(),
        "milliseconds": result.stages,
        "losses": each_loss,
        "loops": [loop_entry(loop) for loop in result.loops],
        "merges": [merge_entry(merge) for merge in result.merges],
        "full_adjustments": [adjustment_entry(a) for a in result.full_adjustments],
        "final_adjustment": None
        if result.final_adjustment is None
        else adjustment_entry(result.final_adjustment),
    }
    if evaluation is not None:
        report |= evaluation.figures.as_dict()
        report["ate_keyframes_rmse_m"] = evaluation.keyframes_ate_rmse
        if evaluation.scaled is not None and evaluation.scaled.ate is not None:
            report["ate_scaled_rmse_m"] = evaluation.scaled.ate.rmse
            report["ate_scaled_scale"] = evaluation.scaled.transform.scale
    return report


def error_entry(error: Exception | None) -> str | None:
    """Entry of report.json about an early end of the run; None if there was none."""
    if error is None:
        return None
    if isinstance(error, OrbSlamError | OSError):
        return describe_error(error)
    # The text of others alone, such as the key of a KeyError, need not say what happened.
    return f"{type(error).__name__}: {error}".removesuffix(": ")


def loaded_map_entry(loaded: SavedMap | MapFile | None) -> dict[str, Any] | None:
    """Entry of report.json about the initial map of the run."""
    if loaded is None:
        return None
    return {
        "file": loaded.source,
        "keyframes": loaded.n_keyframes,
        "map_points": loaded.n_points,
        "runs": len(loaded.runs),
    }


def depth_entry(result: RunResult) -> dict[str, Any] | None:
    """Entry of report.json about the depth images; None without any."""
    if result.median_depth is None:
        return None
    return {"median_m": result.median_depth, "factor": result.settings.depth_factor}


def weak_frames(result: RunResult) -> int:
    """Return the number of frames with a pose of weak evidence."""
    records = [row.record for row in result.rows if row.record is not None]
    return sum(
        record.T_cw is not None
        and record.evidence is not None
        and record.evidence.verdict is Verdict.WEAK
        for record in records
    )


def options_entry(options: RunOptions) -> dict[str, Any]:
    """Entry of report.json about the used frames and the options of the system."""
    return {
        "start": options.start,
        "stride": options.stride,
        "max_frames": options.max_frames,
        "localize_after": options.localize_after,
        "final_adjustment": options.final_adjustment,
        "imu": options.imu,
        "loop_closing": options.system.loop_closing,
        "full_adjustment": options.system.full_adjustment,
        "several_maps": options.system.several_maps,
        "new_map_after": options.system.new_map_after,
        "effort": str(options.system.effort),
        "config": dict(options.system.config),
        "full_adjustment_time_limit": options.system.full_adjustment_time_limit,
    }


def maps_entry(result: RunResult) -> list[dict[str, Any]]:
    """Entry of report.json about all maps, also dropped and merged ones."""
    there = {summary.map_index: summary for summary in result.maps}
    merged_into = {merge.merged_map: merge.map_index for merge in result.merges}
    upright = {one.map_index for one in (result.snapshot, *result.other_maps) if one.is_upright}
    entries = []
    for number, path in enumerate(result.trajectories):
        summary = there.get(number)
        if summary is not None:
            state = "active" if summary.active else "resting"
        elif number in merged_into:
            state = "merged"
        elif len(path):
            state = "given up"
        else:
            continue
        entries.append(
            {
                "map": number,
                "state": state,
                "merged_into": merged_into.get(number),
                "keyframes": 0 if summary is None else summary.n_keyframes,
                "map_points": 0 if summary is None else summary.n_map_points,
                "tracked": int(np.count_nonzero(~path.lost)),
                "upright": number in upright,
            }
        )
    return entries


def merge_entry(merge: MapsMerged) -> dict[str, Any]:
    """Entry of report.json about the merge of two maps."""
    return {
        "map": merge.map_index,
        "merged": merge.merged_map,
        "keyframes": [merge.matched_keyframe, merge.current_keyframe],
        "timestamps": [merge.matched_timestamp, merge.current_timestamp],
        "inliers": merge.n_inliers,
        "matches": merge.n_matches,
        "fused_points": merge.n_fused,
        "moved_keyframes": merge.n_moved_keyframes,
        "moved_points": merge.n_moved_points,
        "scale": merge.scale,
        "milliseconds": _rounded(merge.milliseconds),
    }


def loop_entry(loop: LoopClosed) -> dict[str, Any]:
    """Entry of report.json about a loop."""
    return {
        "map": loop.map_index,
        "keyframes": [loop.matched_keyframe, loop.current_keyframe],
        "timestamps": [loop.matched_timestamp, loop.current_timestamp],
        "inliers": loop.n_inliers,
        "matches": loop.n_matches,
        "fused_points": loop.n_fused,
        "scale": loop.scale,
        "correction_m": loop.translation,
        "correction_deg": loop.rotation_deg,
        "milliseconds": _rounded(loop.milliseconds),
    }


def adjustment_entry(record: FullAdjustmentRecord) -> dict[str, Any]:
    """Entry of report.json about a full bundle adjustment."""
    return {
        "map": record.map_index,
        "keyframes": record.n_keyframes,
        "points": record.n_points,
        "observations": record.n_observations,
        "iterations": record.iterations,
        "initial_cost": record.initial_cost,
        "final_cost": record.final_cost,
        "used": record.used,
        "milliseconds": _rounded(record.milliseconds),
    }


def _rounded(milliseconds: dict[str, float]) -> dict[str, float]:
    return {step: round(value, 4) for step, value in milliseconds.items()}


def initialization_reasons(result: RunResult) -> dict[str, int]:
    """Return the reasons before the first map with their frames, the most frequent first."""
    return dict(
        Counter(
            row.reason
            for row in result.rows
            if row.record is not None and row.record.state is TrackingState.NOT_INITIALIZED
        ).most_common()
    )


def peak_memory_mb() -> float:
    """Return the largest resident memory of this process so far, in megabytes."""
    # A child inherits ru_maxrss of the program that started it; Linux' own figure is the process's.
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (1e6 if sys.platform == "darwin" else 1e3)


def _rate(count: int, seconds: float) -> float:
    return count / seconds if seconds > 0 else 0.0
