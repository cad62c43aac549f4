# SPDX-License-Identifier: BSD-3-Clause
"""The table of all frames: frames.csv."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from orbslam2py._files import atomic_write
from orbslam2py.runs.result import FrameRow
from orbslam2py.slam.records import Evidence, TrackingRecord
from orbslam2py.trajectory.frame_times import FRAME_COLUMNS, is_frame_table
from orbslam2py.trajectory.rotations import quaternions_from_rotations

STAGES = ("wait", "extract", "stereo", "predict", "local_map", "keyframe", "track")

_TRACKED = [
    *("inliers", "matches", "keyframe", "reference_keyframe"),
    *("tx", "ty", "tz", "qx", "qy", "qz", "qw", "std_position", "std_angle"),
    *("visual_odometry", "evidence", "method", "found", "unconfirmed"),
    *(f"ms_{stage}" for stage in STAGES),
]


def begin_frames(path: Path) -> None:
    """Write the table of a run that has no frames yet.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_frames(path, ())


def has_no_frames(path: Path) -> bool:
    """Whether a file is the table of a run that has not ended."""
    return is_frame_table(path) and path.read_bytes().count(b"\n") == 1


def write_frames(path: Path, rows: Iterable[FrameRow]) -> None:
    """Write one line for every frame, tracked or not.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([*FRAME_COLUMNS, *_TRACKED])
    for row in rows:
        writer.writerow(_fields(row))
    with atomic_write(path) as file:
        file.write(stream.getvalue())


def pose_deviation(record: TrackingRecord) -> tuple[float, float] | None:
    """Compute the standard deviations of a pose from its covariance.

    The camera's centre moves by the translation of a left perturbation, rotated into the world, so
    both figures are roots of the trace of a block of the covariance.

    Returns
    -------
    position, angle
        Standard deviations of the camera's centre [m] (one camera: the map's unit) and of its
        orientation [deg], over all directions; None if they are not known.
    """
    if record.covariance is None:
        return None
    variances = np.diag(record.covariance)
    angle, position = float(variances[:3].sum()), float(variances[3:].sum())
    if not (math.isfinite(angle) and math.isfinite(position) and min(angle, position) >= 0):
        return None
    return math.sqrt(position), math.degrees(math.sqrt(angle))


def _fields(row: FrameRow) -> list[object]:
    record = row.record
    if record is None:
        return [row.index, row.timestamp, "", row.state, row.reason] + [""] * len(_TRACKED)
    pose: list[object] = [""] * 7
    if record.T_wc is not None:
        quaternion = quaternions_from_rotations(record.T_wc[None, :3, :3])[0]
        pose = [f"{value:.9f}" for value in (*record.T_wc[:3, 3], *quaternion)]
    deviation = pose_deviation(record)
    return [
        row.index,
        row.timestamp,
        record.map_index,
        row.state,
        row.reason,
        record.n_inliers,
        record.n_matches,
        int(record.is_keyframe),
        record.reference_keyframe if record.reference_keyframe >= 0 else "",
        *pose,
        *([""] * 2 if deviation is None else [f"{value:.9f}" for value in deviation]),
        int(record.visual_odometry) if record.T_wc is not None else "",
        *_evidence_fields(record.evidence),
        int(record.unconfirmed) if record.T_wc is not None else "",
        *(f"{record.milliseconds.get(stage, 0.0):.3f}" for stage in STAGES),
    ]


def _evidence_fields(evidence: Evidence | None) -> list[object]:
    if evidence is None:
        return [""] * 3
    return [str(evidence.verdict), str(evidence.method), f"{evidence.found:.3f}"]
