# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py evaluate``: a trajectory against ground truth."""

from __future__ import annotations

import json as json_module
import logging
import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.cli.messages import log_to
from orbslam2py.cli.targets import check_apart, check_figures
from orbslam2py.datasets import Layout, is_recording, open_sequence, recognise
from orbslam2py.datasets.euroc import find_root
from orbslam2py.datasets.euroc_calibration import read_sensor_yaml
from orbslam2py.datasets.extrinsics import read_extrinsics
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.evaluation import (
    Alignment,
    Evaluation,
    Paired,
    Poses,
    ends_early,
    evaluate_trajectory,
    find_other_reading,
    pair,
    read_estimate,
    read_truth,
)
from orbslam2py.settings.sensor import Sensor
from orbslam2py.trajectory import QuaternionOrder, Trajectory, TrajectoryFormat, read_times

_log = logging.getLogger(__name__)

_UNITS = (
    ("_percent", "%"),
    ("_deg_per_100m", "deg/100 m"),
    ("_m", "m"),
    ("_deg", "deg"),
    ("_s", "s"),
)
_FEW = 0.5  # of the estimate's poses

_Convention = tuple[QuaternionOrder | None, bool]  # order of quaternions, whether poses are inverse


def evaluate(
    trajectory: Annotated[
        Path, typer.Argument(help="The estimate: a file of TUM, KITTI, EuRoC or another program.")
    ],
    ground_truth: Annotated[
        Path,
        typer.Argument(help="The truth: a trajectory file, the folder of a sequence, or a bag."),
    ],
    alignment: Annotated[
        Alignment,
        typer.Option(
            help="se3 for metric estimates, sim3 for those of one camera, yaw for those with an "
            "IMU if z is up in both worlds; auto takes what fits the run's sensor, or the lengths "
            "if that is not known."
        ),
    ] = Alignment.AUTO,
    file_format: Annotated[
        TrajectoryFormat,
        typer.Option("--format", help="Format of both files; auto recognises each."),
    ] = TrajectoryFormat.AUTO,
    times: Annotated[
        Path | None,
        typer.Option(
            help="Times of the rows of a file in KITTI format, one per line [times.txt beside it]."
        ),
    ] = None,
    offset: Annotated[
        float,
        typer.Option(help="Added to the time stamps of the estimate.", metavar="SECONDS"),
    ] = 0.0,
    quaternions: Annotated[
        QuaternionOrder | None,
        typer.Option(help="Order in the file of the estimate [by its head, or by its format]."),
    ] = None,
    inverse: Annotated[
        bool,
        typer.Option("--inverse", help="The estimate holds poses of the world in the camera."),
    ] = False,
    truth_quaternions: Annotated[
        QuaternionOrder | None, typer.Option(help="As --quaternions, for the file of the truth.")
    ] = None,
    truth_inverse: Annotated[
        bool, typer.Option("--truth-inverse", help="As --inverse, for the file of the truth.")
    ] = False,
    extrinsics: Annotated[
        Path | None,
        typer.Option(
            help="Camera in the body whose poses the truth holds: a sensor.yaml with T_BS, or 12 "
            "or 16 numbers [EuRoC's by itself]."
        ),
    ] = None,
    json: Annotated[
        Path | None,
        typer.Option(help="Write the figures to this file as well; earlier ones are replaced."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace that file.")] = False,
) -> None:
    """Compare a trajectory with ground truth: ATE, RPE and KITTI's segment errors.

    **Example**

        orbslam2py evaluate runs/latest/trajectory.txt rgbd_dataset_freiburg1_xyz/groundtruth.txt

        orbslam2py evaluate estimate.txt poses.txt --times times.txt
    """
    log_to(Console(stderr=True), quiet=False)
    if not math.isfinite(offset):
        raise DatasetError(f"--offset is {offset}; give a number of seconds")
    if trajectory.is_dir():
        raise DatasetError(
            f"{trajectory} is a folder, no trajectory; the trajectory comes first: orbslam2py "
            "evaluate TRAJECTORY GROUND_TRUTH"
        )
    read = [path for path in (trajectory, ground_truth, times, extrinsics) if path is not None]
    check_apart({"--json": json}, read)
    sensor = _sensor_of_run(trajectory)
    conventions = ((quaternions, inverse), (truth_quaternions, truth_inverse))
    files = _read_both(
        *(trajectory, ground_truth, file_format, conventions, times, extrinsics, sensor)
    )
    both = pair(*files, offset=offset)
    if offset and not both.on_clocks:
        raise DatasetError(
            f"--offset has no meaning: poses are matched by {both.by}, not by two clocks; leave it "
            "out"
        )
    single_camera = None
    if sensor is not None:
        single_camera = sensor is Sensor.MONOCULAR and not _knows_metres(trajectory)
    result = evaluate_trajectory(
        both.estimate,
        both.truth,
        alignment,
        single_camera=single_camera,
        offset=offset,
        timed=both.is_timed,
    )
    figures = result.as_dict()
    check_figures(json, figures, force=force)
    Console().print(_table(figures, trajectory, ground_truth))
    _say_what_was_compared(both, result, (trajectory, ground_truth), asked=alignment)
    other = find_other_reading(
        *(both.estimate, both.truth, result.alignment),
        estimate_reading=both.readings[0],
        truth_reading=both.readings[1],
        T_body_camera=files[1].T_body_camera,
        single_camera=single_camera,
        offset=offset,
        timed=both.is_timed,
    )
    if other is not None:
        _log.warning("%s", other.message)
    if json is not None:
        with atomic_write(json) as stream:
            stream.write(json_module.dumps(figures, indent=2) + "\n")


def _say_what_was_compared(
    both: Paired, result: Evaluation, files: tuple[Path, Path], *, asked: Alignment
) -> None:
    matched = result.matched
    say = Console().print
    for path, reading in zip(files, both.readings, strict=True):
        if reading.notes:
            text = f"Read: {path.name}: {'; '.join(reading.notes)}."
            say(escape(text), highlight=False, soft_wrap=True)
    say(
        f"Compared: {matched}; poses are matched by {escape(both.by)}.",
        highlight=False,
        soft_wrap=True,
    )
    lost = int(both.estimate.lost.sum())
    if lost:
        rows = "1 row" if lost == 1 else f"{lost} rows"
        say(f"Left out: {rows} of frames without a pose.", highlight=False, soft_wrap=True)
    if asked is Alignment.AUTO:
        why = {
            True: "a single camera",
            False: "the run's sensors measure metres",
            None: "chosen from the lengths of the paths, because the sensor is not known",
        }
        reason = why[result.single_camera]
        say(f"Alignment: {result.alignment} ({reason}).", highlight=False, soft_wrap=True)
    if result.hint:
        _log.warning("%s", result.hint)
    if matched.poses < result.alignment.fewest_poses:
        _log.warning(
            "no absolute error: %d matched, and %s takes at least %d poses; compare a longer part",
            *(matched.poses, result.alignment, result.alignment.fewest_poses),
        )
    elif result.ate is None:
        _log.warning("no absolute error: positions are too large to reckon with; check the files")
    if matched.poses < _FEW * matched.estimate_poses:
        _log.warning(
            "only %d of %d poses have a true one at their time: the figures are of a part of the "
            "path; if the clocks differ, give --offset",
            *(matched.poses, matched.estimate_poses),
        )


def _read_both(
    trajectory: Path,
    ground_truth: Path,
    file_format: TrajectoryFormat,
    conventions: tuple[_Convention, _Convention],
    times_file: Path | None,
    extrinsics: Path | None,
    sensor: Sensor | None,
) -> tuple[Poses, Poses]:
    times = None if times_file is None else read_times(times_file)
    T_body_camera = None if extrinsics is None else read_extrinsics(extrinsics)
    order, inverse = conventions[0]
    estimate = read_estimate(
        trajectory, file_format, times=times, quaternions=order, inverse=inverse
    )
    order, inverse = conventions[1]
    if ground_truth.is_dir() or is_recording(ground_truth):
        if order is not None or inverse:
            raise DatasetError(
                f"{ground_truth} is a sequence, and how its poses are written is known; leave out "
                "--truth-quaternions and --truth-inverse"
            )
        truth = _truth_of_sequence(ground_truth, sensor, T_body_camera)
    else:
        truth = read_truth(
            ground_truth, file_format, times=times, quaternions=order, inverse=inverse
        )
        truth = _of_camera(ground_truth, truth, T_body_camera)
    if times is not None:
        _see_that_they_fit(times_file, times, (estimate, truth))
    n = len(truth.trajectory)
    if truth.file_format is TrajectoryFormat.KITTI and ends_early(truth, truth.frame_times):
        assert truth.frame_times is not None
        _log.warning(
            "%s has %d poses for %d times; frames after these are not compared",
            *(truth.source, n, len(truth.frame_times)),
        )
    return estimate, truth


def _see_that_they_fit(path: Path | None, times: FloatArray, files: tuple[Poses, ...]) -> None:
    rows = [poses for poses in files if poses.file_format is TrajectoryFormat.KITTI]
    if any(len(poses.trajectory) == len(times) for poses in rows) or ends_early(files[1], times):
        return
    if not rows:
        raise DatasetError(f"{path} is not needed: both files have time stamps; leave out --times")
    counts = " and ".join(f"{poses.source} {len(poses.trajectory)} rows" for poses in rows)
    raise DatasetError(
        f"{path} holds {len(times)} time stamps, but {counts}; give a file with one per row"
    )


def _truth_of_sequence(folder: Path, sensor: Sensor | None, extrinsics: FloatArray | None) -> Poses:
    is_euroc = not is_recording(folder) and recognise(folder) is Layout.EUROC
    sequence = open_sequence(folder, sensor if is_euroc else None)
    root = find_root(folder) if is_euroc else None
    if root is not None and extrinsics is not None:
        body = root / "state_groundtruth_estimate0" / "data.csv"
        return _of_camera(body, read_truth(body), extrinsics)
    truth = sequence.ground_truth()
    if truth is None:
        raise DatasetError(
            f"the sequence {folder} comes without ground truth; give a file with it instead"
        )
    if extrinsics is not None:
        truth = Trajectory(truth.timestamps, truth.T_wc @ extrinsics)
    return Poses(str(folder), truth, TrajectoryFormat.TUM, frame_times=sequence.timestamps)


def _of_camera(path: Path, body: Poses, extrinsics: FloatArray | None) -> Poses:
    """Convert poses of the body to those of the camera, with T_BS of EuRoC's cam0."""
    if extrinsics is None:
        if body.file_format is not TrajectoryFormat.EUROC:
            return body
        calibration = path.resolve().parent.parent / "cam0" / "sensor.yaml"
        if not calibration.is_file():
            _log.warning(
                "%s holds poses of the body, not of a camera: no %s; give the camera's place with "
                "--extrinsics",
                *(path, calibration),
            )
            return body
        extrinsics = read_sensor_yaml(calibration).T_BS
    poses = body.trajectory
    moved = Trajectory(poses.timestamps, poses.T_wc @ extrinsics)
    return replace(body, trajectory=moved, T_body_camera=extrinsics)


def _sensor_of_run(trajectory: Path) -> Sensor | None:
    """Return the sensor of a file's run, from its report; None if unknown."""
    try:
        report = json_module.loads((trajectory.parent / "report.json").read_text(encoding="utf-8"))
        return Sensor(report["sensor"])
    except (OSError, ValueError, KeyError, TypeError, OrbSlamError):
        return None  # it may be of another program


def _knows_metres(trajectory: Path) -> bool:
    """Return whether an IMU made the map of a file's run metric, from its report."""
    try:
        report = json_module.loads((trajectory.parent / "report.json").read_text(encoding="utf-8"))
        return report["imu"]["metric"] is True
    except (OSError, ValueError, KeyError, TypeError):
        return False


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
