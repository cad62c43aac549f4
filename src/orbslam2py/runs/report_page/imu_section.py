# SPDX-License-Identifier: BSD-3-Clause
"""The IMU of a run: whether it fits the camera, and its states over time."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.imu_table import IMU_COLUMNS
from orbslam2py.runs.report_page.columns import Columns
from orbslam2py.runs.report_page.markup import Markup, element, section, table
from orbslam2py.runs.report_page.plot import Line, TimePlot, figures
from orbslam2py.runs.report_page.round_numbers import NONE
from orbslam2py.runs.report_page.run_plots import loop_marks, untracked
from orbslam2py.runs.report_page.story import Story

#: Squared Mahalanobis distance that one of twenty right poses exceeds (6 degrees of freedom).
_USUAL_INNOVATION = 12.6
_MEANING = {
    "fits": "gyro and accelerometer agree with the path of the camera",
    "held back": "it does not fit the camera and was not used",
    "unknown": "the motion did not show whether it fits the camera",
}


def imu_section(story: Story) -> Markup | None:
    """Verdict, measurements, and plots; None for a run without an IMU."""
    entry = story.run.report.get("imu")
    if not entry:
        return None
    faults = [element("p", str(fault.get("text", ""))) for fault in entry.get("faults", [])]
    return section(
        "imu",
        "IMU",
        table([], _rows(entry), class_="figures"),
        element("div", *faults, class_="warning serious") if faults else None,
        figures(*_plots(story)),
    )


def imu_words(report: dict[str, Any]) -> str:
    """Say in a line whether the IMU fits."""
    entry = report["imu"]
    offset = entry.get("time_offset")
    told = f", time offset {1e3 * offset:.1f} ms" if offset is not None else ""
    return f"{entry.get('verdict')}{told}"


def _rows(entry: dict[str, Any]) -> list[list[str]]:
    verdict = str(entry.get("verdict"))
    offset, deviation = entry.get("time_offset"), entry.get("time_offset_deviation")
    gravity = entry.get("gravity")
    told = NONE
    if offset is not None and deviation is not None:
        told = f"{1e3 * offset:+.1f} ms (+/- {1e3 * deviation:.1f})"
    return [
        ["verdict", f"{verdict}: {_MEANING.get(verdict, '')}"],
        ["samples", str(entry.get("samples"))],
        ["time offset", told],
        ["rotation from IMU to camera", _matrix(entry.get("rotation"))],
        ["bias of the gyro [rad/s]", _vector(entry.get("gyro_bias"))],
        ["gravity [m/s^2]", NONE if gravity is None else f"{gravity:.2f}"],
    ]


def _vector(values: list[float] | None) -> str:
    return NONE if values is None else ", ".join(f"{value:.4f}" for value in values)


def _matrix(rows: list[list[float]] | None) -> str:
    return NONE if rows is None else "; ".join(_vector(row) for row in rows)


def _plots(story: Story) -> list[TimePlot]:
    files = (place / "imu_states.csv" for place in story.run.places)
    file = next((path for path in files if path.is_file()), None)
    if file is None:
        return []
    columns = _read(file)
    seconds = columns.numbers("timestamp") - float(story.run.frames.timestamps[0])

    def length(*names: str) -> FloatArray:
        return np.asarray(np.linalg.norm([columns.numbers(name) for name in names], axis=0))

    ends = np.array([0.0, story.duration])
    usual = Line("95 % are below", ends, np.full(2, _USUAL_INNOVATION), "s-level")
    tilt = columns.numbers("gravity_tilt_deg")
    plots = (
        ("speed", "Speed", f"{story.run.unit}/s", [("", length("vx", "vy", "vz"))]),
        ("gyro", "Bias of the gyro", "rad/s, length", [("", length(*_axes("gyro_bias")))]),
        (
            *("accel", "Bias of the accelerometer", "m/s^2, length"),
            [("", length(*_axes("accel_bias")))],
        ),
        (
            *("gravity", "Gravity beside the vertical of the map", "degrees"),
            [("angle", tilt), ("deviation", columns.numbers("gravity_std_deg"))],
        ),
        (
            *("innovation", "Image against prediction", "squared Mahalanobis distance"),
            [("", columns.numbers("innovation"))],
        ),
    )
    looks = ("s-inliers", "s-made")
    made = []
    for name, title, unit, values in plots:
        lines = [
            Line(text, seconds, y, look)
            for (text, y), look in zip(values, looks, strict=False)
            if np.isfinite(y).any()
        ]
        if name == "innovation":
            lines.append(usual)
        made.append(
            TimePlot(
                f"plot-imu-{name}", title, unit, lines, story.duration,
                spans=untracked(story), marks=loop_marks(story),
            )
        )  # fmt: skip
    return made


def _axes(name: str) -> list[str]:
    return [f"{name}_{axis}" for axis in "xyz"]


def _read(path: Path) -> Columns:
    with path.open(newline="", encoding="utf-8") as stream:
        lines = list(csv.DictReader(stream))
    names = ("timestamp", *IMU_COLUMNS)
    return Columns(
        path,
        list(range(2, len(lines) + 2)),
        {name: [line.get(name) or "" for line in lines] for name in names},
    )
