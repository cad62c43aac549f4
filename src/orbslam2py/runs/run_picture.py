# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of a run: trajectory.png, and maps.png if there were several."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import number_of
from orbslam2py.evaluation import Alignment
from orbslam2py.runs.frame_errors import position_errors
from orbslam2py.runs.gravity import Height
from orbslam2py.runs.plots import draw_trajectory
from orbslam2py.runs.report import RunEvaluation
from orbslam2py.runs.report_page.explained import compared_over
from orbslam2py.runs.result import RunResult
from orbslam2py.runs.several_maps import draw_maps, maps_of_run
from orbslam2py.runs.timeline import Timeline
from orbslam2py.trajectory.level import level_frame, moved

#: Least number of poses with a true one at their time to compute the scale.
_POSES_FOR_SCALE = 3


def anchored_points(result: RunResult) -> npt.NDArray[np.float64]:
    """Map points (p, 3) in the world of the trajectories."""
    snapshot = result.snapshot
    if not len(snapshot.keyframe_T_wc):
        return snapshot.point_positions
    first = int(np.argsort(snapshot.keyframe_timestamps, kind="stable")[0])
    T_0w = result.keyframes.T_wc[0] @ np.linalg.inv(snapshot.keyframe_T_wc[first])
    return moved(T_0w, snapshot.point_positions)


def _loop_positions(result: RunResult) -> npt.NDArray[np.float64]:
    """Both keyframes of every loop of the main map, (l, 2, 3), in the world of its path."""
    snapshot = result.snapshot
    rows = np.searchsorted(snapshot.keyframe_ids, snapshot.loop_edges)
    return np.asarray(result.keyframes.positions[rows])


def draw_run(
    path: Path, result: RunResult, evaluation: RunEvaluation | None, report: dict[str, Any]
) -> None:
    """Draw trajectory.png.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    last = result.tracked_trajectory()
    is_upright = result.snapshot.is_upright and len(result.keyframes) > 0
    T_dw = level_frame(result.keyframes.T_wc[0]) if is_upright else np.eye(4)
    merged_into = {merge.merged_map: merge.map_index for merge in result.merges}
    timeline = Timeline.of(result.rows, result.main_map, merged_into)
    begin = float(result.rows[0].timestamp)
    truth = None
    subtitle = (
        f"{report['tracked']} of {report['frames']} frames tracked, "
        f"{number_of(report['keyframes'], 'keyframe')}, "
        f"{number_of(report['map_points'], 'point')}"
    )
    n_maps = sum(not one.lost.all() for one in result.trajectories)
    if n_maps > 1:
        subtitle += f", map {result.main_map} (the main one of {n_maps})"
    scale, unit = metres_per_unit(result, evaluation), "m"
    if scale is None:
        scale, unit = 1.0, "units"
    errors = None
    if evaluation is not None:
        if report["ate_rmse_m"] is not None:
            errors = position_errors(last, evaluation.truth, scale)
        true_positions = scale * moved(T_dw, evaluation.truth.positions)
        truth = (evaluation.truth.timestamps - begin, true_positions)
        if report["ate_rmse_m"] is not None:
            subtitle += f", ATE {report['ate_rmse_m']:.4f} m {compared_over(report)}"
    draw_trajectory(
        path,
        title=f"{report['sequence']} ({report['sensor']})",
        subtitle=subtitle,
        positions=scale * moved(T_dw, last.positions),
        seconds=last.timestamps - begin,
        keyframes=scale * moved(T_dw, result.keyframes.positions),
        points=scale * moved(T_dw, anchored_points(result)),
        truth=truth,
        loops=scale * moved(T_dw, _loop_positions(result)),
        gaps=timeline.gaps_before(last.indices),
        errors=errors,
        timeline=timeline,
        unit=unit,
        height=_height(evaluation, is_upright=is_upright),
    )


def _height(evaluation: RunEvaluation | None, *, is_upright: bool) -> Height | None:
    if is_upright:
        return Height.of_level_axes()
    return None if evaluation is None else evaluation.height


def draw_maps_of_run(path: Path, result: RunResult, report: dict[str, Any]) -> None:
    """Draw maps.png: all maps of the run, each in one colour.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    drawn = maps_of_run(result)
    draw_maps(
        path,
        drawn,
        title=f"{report['sequence']} ({report['sensor']}): {len(drawn)} maps",
        unit="m" if result.is_metric else "units",
        main=result.main_map,
    )


def metres_per_unit(result: RunResult, evaluation: RunEvaluation | None) -> float | None:
    """Return metres per unit of the map; None if unknown.

    A single camera's map has its own unit of length unless an IMU gave it metres: only ground
    truth gives its size.
    """
    if result.is_metric:
        return 1.0
    if evaluation is None or evaluation.figures.alignment is not Alignment.SIM3:
        return None
    enough = evaluation.figures.matched_poses >= _POSES_FOR_SCALE
    return evaluation.figures.transform.scale if enough else None
