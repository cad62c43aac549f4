# SPDX-License-Identifier: BSD-3-Clause
"""What ``orbslam2py calibrate`` prints and writes of its results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from orbslam2py._files import atomic_write
from orbslam2py.calibration import (
    Calibration,
    FamilyScore,
    RigCalibration,
    camchain_text,
    pair_settings_text,
)
from orbslam2py.calibration.rig_files import left_first
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor, Settings
from orbslam2py.settings.defaults import ASSUMED_DEPTH_FACTOR


def print_results(
    console: Console,
    cameras: Sequence[Calibration],
    sources: Sequence[Path],
    lines: Sequence[str],
    warnings: Sequence[str],
) -> None:
    """Print the tables of the lens models and of each camera, then lines and warnings."""
    if cameras[0].scores:
        console.print(table_of_scores(cameras[0].scores))
    for one, source in zip(cameras, sources, strict=True):
        console.print(table_of_camera(one, source))
    for line in lines:
        console.print(escape(line), highlight=False)
    for warning in warnings:
        console.print(f"[bold yellow]Warning:[/] {escape(warning)}", highlight=False)


def table_of_scores(scores: Sequence[FamilyScore]) -> Table:
    """Errors of the lens models that were compared."""
    table = Table(title=escape("Lens models: reprojection error (RMS) [pixels]"))
    for name in ("model", "parameters", "all views", "views left out", ""):
        table.add_column(name, justify="left" if name in ("model", "") else "right")
    for score in sorted(scores, key=lambda one: (one.validated, one.rms)):
        validated = f"{score.validated:.4f}" if np.isfinite(score.validated) else "-"
        rms = f"{score.rms:.4f}"
        chosen = "chosen" if score.chosen else ""
        table.add_row(score.family, str(score.n_parameters), rms, validated, chosen)
    return table


def table_of_camera(result: Calibration, source: Path) -> Table:
    """The numbers of a camera."""
    table = Table(title=escape(f"{source.name}, board {result.board}"), show_header=False)
    table.add_column(justify="left")
    table.add_column(justify="right")
    nearest, farthest = result.distances
    width, height = result.size
    table.add_row("images searched, with board", f"{result.n_searched}, {result.n_found}")
    table.add_row("views used, left out", f"{len(result.views)}, {len(result.left_out)}")
    table.add_row("image size", f"{width} x {height}")
    table.add_row("image covered", f"{result.coverage:.0%}")
    table.add_row(
        escape("largest angle of a corner from the axis [degrees]"),
        f"{np.degrees(result.angle_seen):.0f}",
    )
    table.add_row(escape("distance of the board [m]"), f"{nearest:.2f} to {farthest:.2f}")
    table.add_row(escape("reprojection error (RMS) [pixels]"), f"{result.rms:.3f}")
    table.add_section()
    table.add_row("lens model", result.family)
    names = result.camera.parameter_names
    # Coefficients that the model does not have are zeros after its own.
    for i, (name, value) in enumerate(zip(names, result.camera.parameters, strict=True)):
        digits = 2 if i < 4 else 5
        table.add_row(name, f"{value:.{digits}f} +- {result.deviations[i]:.{digits}f}")
    return table


def lines_of_depth(sensor: Sensor, depth_factor: float | None) -> list[str]:
    """Say in which units depth images are taken."""
    if sensor is not Sensor.RGBD:
        return []
    if depth_factor is None:
        return [ASSUMED_DEPTH_FACTOR]
    return [f"depth images: {depth_factor:g} units per metre"]


def write_rig(
    rig: RigCalibration,
    sources: Sequence[Path],
    output: Path,
    camchain: Path | None,
    *,
    fps: float,
    n_features: int | None,
) -> tuple[list[str], list[str]]:
    """Write the files of several cameras.

    Settings of a pair, or the camchain of a rig; a pair gets a camchain as well if it is wanted.

    Returns
    -------
    lines, warnings
        What to print.
    """
    warnings = rig.warnings()
    lines = [
        f"{rig.n_moments} sets of images, {rig.n_shared} with the board in two cameras or more; "
        f"reprojection error {rig.rms:.3f} pixels (RMS)"
    ]
    for number in range(1, len(rig.cameras)):
        lines.append(_line_of_pose(rig, number, sources))
    if camchain is not None:
        _write(camchain, camchain_text(rig))
        lines.append(f"Kalibr's camchain is in {camchain}")
    if len(rig.cameras) > 2:
        _write(output, camchain_text(rig))
        return lines, warnings
    ordered, exchanged = left_first(rig)
    if exchanged:
        warnings.append(
            f"{sources[1]} is the left camera: the settings are for left {sources[1]}, right "
            f"{sources[0]}"
        )
    text = pair_settings_text(ordered, fps=fps, n_features=n_features)
    _write(output, text)
    try:
        Settings.from_yaml(text, Sensor.STEREO, source=str(output))
    except SettingsError as error:
        warnings.append(f"the settings are written, but run cannot use them yet: {error}")
    return lines, warnings


def _line_of_pose(rig: RigCalibration, number: int, sources: Sequence[Path]) -> str:
    """Say where a camera is, seen from camera 0."""
    position = 1000 * rig.positions[number]
    # The position is turned; its deviation is that of the translation within their precision.
    deviation = 1000 * float(np.linalg.norm(rig.deviations[number][:3]))
    R = rig.T_c0[number][:3, :3]
    angle = np.degrees(np.arccos(np.clip((np.trace(R) - 1) / 2, -1, 1)))
    x, y, z = position
    return (
        f"camera {number} ({sources[number].name}) is {np.linalg.norm(position):.2f} +- "
        f"{deviation:.2f} mm from camera 0: x {x:.2f}, y {y:.2f}, z {z:.2f} mm, turned by "
        f"{angle:.2f} degrees"
    )


def _write(path: Path, text: str) -> None:
    with atomic_write(path) as stream:
        stream.write(text)
