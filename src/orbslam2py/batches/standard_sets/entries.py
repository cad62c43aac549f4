# SPDX-License-Identifier: BSD-3-Clause
"""Runs of one sequence with one sensor: each seed, the median, and published figures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from orbslam2py.batches.standard_sets.find import StandardSet
from orbslam2py.batches.standard_sets.published import Published, published_figures
from orbslam2py.batches.summary import Spread

#: A run whose path has poses for less than this part of the frames is lost.
LEAST_PART = 0.8


def is_lost(row: dict[str, Any]) -> bool:
    """Return whether a run failed, or has poses in its trajectory for less than 80 % of the frames.

    Parameters
    ----------
    row
        Row of the table of a batch.
    """
    return row["state"] != "done" or part_in_path(row) < LEAST_PART


def part_in_path(row: dict[str, Any]) -> float:
    """Share of the frames with a pose in the evaluated trajectory, that of the main map."""
    frames = row.get("frames") or 0
    poses = row.get("matched_of_poses")
    poses = row.get("tracked") or 0 if poses is None else poses
    return poses / frames if frames else 0.0


@dataclass(frozen=True)
class Entry:
    """Runs of one sequence with one sensor.

    Attributes
    ----------
    sequence, sensor
        Sequence and sensor.
    rows
        Rows of the table, one for each seed, in their order.
    published
        Published figures for it.
    """

    sequence: str
    sensor: str
    rows: list[dict[str, Any]]
    published: list[Published]

    @property
    def n_lost(self) -> int:
        """How many runs were lost."""
        return sum(is_lost(row) for row in self.rows)

    def spread(self, figure: str) -> Spread | None:
        """Median and range of a figure over the runs that were not lost; None without any."""
        return Spread.of([row for row in self.rows if not is_lost(row)], figure)

    def of(self, system: str) -> Published | None:
        """Return the published figures of a system."""
        return next((one for one in self.published if one.system == system), None)


def _uses_imu(rows: list[dict[str, Any]]) -> bool:
    """Whether runs had an IMU that fits the camera."""
    return any(row.get("imu.verdict") == "fits" for row in rows)


def entries_of(kind: StandardSet, rows: list[dict[str, Any]]) -> list[Entry]:
    """Group runs that differ only in their seeds, by sensor."""
    groups: dict[tuple[str, str], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault((str(row["sensor"] or ""), str(row["sequence"])), []).append(row)
    return [
        Entry(
            sequence,
            sensor,
            sorted(members, key=lambda row: int(row["seed"])),
            published_figures(kind, sequence, sensor, imu=_uses_imu(members)),
        )
        for (sensor, sequence), members in sorted(groups.items())
    ]
