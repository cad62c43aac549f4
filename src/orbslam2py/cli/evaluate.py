# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py evaluate``: a trajectory against ground truth."""

from __future__ import annotations

import json as json_module
import logging
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py._files import atomic_write
from orbslam2py.datasets import open_sequence
from orbslam2py.datasets.euroc_calibration import read_sensor_yaml
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation import Alignment, evaluate_trajectory
from orbslam2py.trajectory import Trajectory, TrajectoryFormat, read_trajectory

_log = logging.getLogger(__name__)

_UNITS = (("_percent", "%"), ("_deg_per_100m", "deg/100 m"), ("_m", "m"), ("_deg", "deg"))


def evaluate(
    trajectory: Annotated[
        Path, typer.Argument(help="The estimate: a file in TUM or KITTI format.")
    ],
    ground_truth: Annotated[
        Path, typer.Argument(help="The truth: a trajectory file, or the folder of a sequence.")
    ],
    alignment: Annotated[
        Alignment, typer.Option(help="se3 for metric estimates, sim3 for those of one camera.")
    ] = Alignment.SE3,
    file_format: Annotated[
        TrajectoryFormat, typer.Option("--format", help="Of both files; auto looks at each.")
    ] = TrajectoryFormat.AUTO,
    json: Annotated[
        Path | None, typer.Option(help="Write the figures to this file as well.")
    ] = None,
) -> None:
    """Compare a trajectory with ground truth: ATE, RPE and KITTI's segment errors.

    **Example**

        orbslam2py evaluate runs/latest/trajectory.txt rgbd_dataset_freiburg1_xyz/groundtruth.txt
    """
    estimate, estimate_format = read_trajectory(trajectory, file_format)
    numbered = estimate_format is TrajectoryFormat.KITTI
    truth = _read_truth(ground_truth, file_format, numbered=numbered)
    result = evaluate_trajectory(estimate, truth, alignment, timed=not numbered)
    figures = result.as_dict()
    Console().print(_table(figures, trajectory, ground_truth))
    if json is not None:
        with atomic_write(json) as stream:
            stream.write(json_module.dumps(figures, indent=2) + "\n")


def _read_truth(path: Path, file_format: TrajectoryFormat, *, numbered: bool) -> Trajectory:
    """Read the truth, with frame numbers as time stamps if the estimate has only those."""
    if path.is_dir():
        truth = open_sequence(path).ground_truth()
        if truth is None:
            raise DatasetError(f"the sequence {path} comes without ground truth")
        if numbered:
            return Trajectory(truth.indices.astype(float), truth.T_wc)
        return truth
    truth, truth_format = read_trajectory(path, file_format)
    if numbered != (truth_format is TrajectoryFormat.KITTI):
        raise DatasetError(
            "a file in KITTI format has no time stamps, so both files must be in it (or give the "
            "folder of the sequence as ground truth)"
        )
    if truth_format is TrajectoryFormat.EUROC:
        return _of_camera(path, truth)
    return truth


def _of_camera(path: Path, body: Trajectory) -> Trajectory:
    """Poses of cam0 from those of the body, if the calibration lies where EuRoC puts it."""
    calibration = path.resolve().parent.parent / "cam0" / "sensor.yaml"
    if not calibration.is_file():
        _log.warning("%s holds poses of the body, not of a camera: no %s", path, calibration)
        return body
    return Trajectory(body.timestamps, body.T_wc @ read_sensor_yaml(calibration).T_BS)


def _table(figures: dict[str, Any], trajectory: Path, ground_truth: Path) -> Table:
    title = escape(f"{trajectory.name} against {ground_truth.name}")
    table = Table(title=title, show_header=False)
    table.add_column("figure")
    table.add_column("value", justify="right")
    table.add_column("unit")
    for key, value in figures.items():
        if value is None:
            continue
        text = f"{value:.6f}" if isinstance(value, float) else str(value)
        name, unit = _name_and_unit(key)
        table.add_row(name, text, unit)
    return table


def _name_and_unit(key: str) -> tuple[str, str]:
    over = ""
    if key.endswith("_1s"):
        key, over = key[: -len("_1s")], " over 1 s"
    for suffix, unit in _UNITS:
        if key.endswith(suffix):
            return key[: -len(suffix)].replace("_", " ") + over, unit
    return key.replace("_", " ") + over, ""
