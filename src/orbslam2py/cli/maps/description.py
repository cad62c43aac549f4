# SPDX-License-Identifier: BSD-3-Clause
"""Text about a map for people."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray
from orbslam2py.maps import MapContents, SavedMap, reprojection_errors
from orbslam2py.maps.content_groups import BoolArray
from orbslam2py.maps.edits.parts import map_numbers
from orbslam2py.maps.keyframe_runs import runs_of_keyframes, way_along
from orbslam2py.maps.units import unit_of

#: Time stamps above are seconds since 1970, as a date is easier to read (1990).
_CLOCK_TIME = 631152000.0


def describe_map(saved: SavedMap, file: Path) -> Iterator[tuple[str, str]]:
    """Names and values, line by line."""
    contents, settings = saved.contents, saved.settings
    keyframes, camera, unit = contents.keyframes, settings.camera, unit_of(contents)
    words = saved.vocabulary
    yield "file", f"{file} ({file.stat().st_size / 1e6:.2f} MB)"
    size = f", {contents.cameras.width[0]} x {contents.cameras.height[0]}"
    if settings.rig is not None:
        sizes = ", ".join("{} x {}".format(*member.size) for member in settings.rig)
        yield "cameras", f"rig of {len(settings.rig)}: {sizes}"
    else:
        yield "camera", f"{saved.sensor}{size}, fx {camera.fx:g}"
    yield "vocabulary", f"{words.hash}{f' ({words.name})' if words.name else ''}"
    numbers = map_numbers(keyframes)
    if numbers.max() > 0:
        yield "maps", f"{numbers.max() + 1}, each in its own world frame"
        for number in range(int(numbers.max()) + 1):
            yield f"map {number}", _one_map(saved, numbers == number)
    yield "keyframes", f"{len(keyframes)} ({len(contents.removed_keyframes)} were culled)"
    yield "points", str(len(contents.points))
    yield "observations", f"{len(contents.observations)}{_per_point(contents)}"
    errors = reprojection_errors(contents)
    if len(errors):
        yield "reprojection error", f"median {np.median(errors):.2f} px"
    n_loops = len(contents.loop_edges)
    yield "loops", f"{n_loops}{' (closed, or where two maps became one)' if n_loops else ''}"
    yield "times", _times(keyframes.timestamps)
    if numbers.max() == 0:
        yield "path", f"{_way(saved, numbers == 0, unit)} from keyframe to keyframe"
        yield "cameras stood in", _box(keyframes.T_wc[:, :3, 3], unit)
    if len(contents.imu_states):
        yield "IMU states", number_of(len(contents.imu_states), "keyframe")
    if len(contents.patches):
        aligned = int((contents.aligned.variance > 0).sum())
        yield "patches", f"of {len(contents.patches)} points, {aligned} aligned sightings"
    yield "colours", f"of {int(keyframes.has_colours.sum())} keyframes"
    yield "images", f"of {len(saved.images)} keyframes"
    for number, run in enumerate(saved.runs):
        frames = f"{len(run.frames)} frames, {int((run.frames.lost != 0).sum())} of them lost"
        yield f"run {number}", f"{run.started}, {run.program}, {frames}"


def _one_map(saved: SavedMap, chosen: BoolArray) -> str:
    contents, keyframes = saved.contents, saved.contents.keyframes
    reference = np.searchsorted(keyframes.ids, contents.points.reference_keyframe)
    unit = unit_of(contents, int(keyframes.ids[chosen][0]))
    return (
        f"{number_of(int(chosen.sum()), 'keyframe')}, "
        f"{number_of(int(chosen[reference].sum()), 'point')}, "
        f"path {_way(saved, chosen, unit)}, {_times(keyframes.timestamps[chosen])}"
    )


def _way(saved: SavedMap, chosen: BoolArray, unit: str) -> str:
    n = len(np.unique(runs_of_keyframes(saved)[chosen]))
    return f"{way_along(saved, chosen):.2f} {unit}{f' in {n} runs' if n > 1 else ''}"


def _per_point(contents: MapContents) -> str:
    if not len(contents.points):
        return ""
    return f", {len(contents.observations) / len(contents.points):.1f} per point"


def _times(timestamps: FloatArray) -> str:
    first, last = float(timestamps.min()), float(timestamps.max())
    text = f"{first:.3f} to {last:.3f} s ({last - first:.1f} s)"
    if first < _CLOCK_TIME:
        return text
    day = datetime.fromtimestamp(first, timezone.utc)
    return f"{text}, from {day:%Y-%m-%d %H:%M:%S} UTC"


def _box(positions: FloatArray, unit: str) -> str:
    low, high = positions.min(axis=0), positions.max(axis=0)
    # Adding 0.0 turns a negative zero, which says nothing, into a plain one.
    least, most = (",".join(f"{round(x, 3) + 0.0:g}" for x in corner) for corner in (low, high))
    return f"{least} to {most} {unit}"
