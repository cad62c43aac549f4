# SPDX-License-Identifier: BSD-3-Clause
"""Data for the page's script: the trajectory in three dimensions, and values for each frame."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.runs.report_page.above import colours_of
from orbslam2py.runs.report_page.markup import Markup
from orbslam2py.runs.report_page.run_folder import RunFolder
from orbslam2py.runs.report_page.story import Story, positions_of

#: Most frames, map points and keyframes that the page holds.
_FRAMES, _POINTS, _KEYFRAMES = 6000, 20000, 600


def script_data(story: Story) -> Markup:
    """Return all data of the script, as JSON in an element of the page."""
    run = story.run
    shown = frames_shown(story)
    place = np.full(len(run.frames), -1, np.int64)
    place[story.of_path] = np.arange(len(story.of_path))
    place = place[shown]
    positions = np.full((len(shown), 3), np.nan)
    positions[place >= 0] = run.metres * run.path.positions[place[place >= 0]]
    reasons = list(dict.fromkeys(run.frames.reason))
    number_of = {reason: k for k, reason in enumerate(reasons)}
    states = list(dict.fromkeys(run.frames.state.tolist()))
    data: dict[str, Any] = {
        "unit": run.unit,
        "metres": run.metres,
        "index": run.frames.index[shown].tolist(),
        "seconds": rounded(run.frames.seconds[shown], 4),
        "states": states,
        "state": [states.index(state) for state in run.frames.state[shown].tolist()],
        "reasons": reasons,
        "reason": [number_of[run.frames.reason[k]] for k in shown.tolist()],
        "inliers": rounded(run.frames.inliers[shown], 0),
        "keyframe": run.frames.is_keyframe[shown].astype(int).tolist(),
        "track": rounded(run.frames.milliseconds.get("track", _nan(run))[shown], 2),
        "error": rounded(story.errors[shown], 5),
        "colour": [int(c) for c in colours_of(story.errors)[0][shown]],
        "positions": rounded(positions.ravel(), 4),
        "images": sorted(run.images),
        **_keyframes(run),
        **_points(run),
    }
    if run.truth is not None:
        keep = _evenly(len(run.truth), _FRAMES)
        truth = run.truth.select(keep)
        data["truth"] = rounded((run.metres * truth.positions).ravel(), 4)
        data["truth_seconds"] = rounded(truth.timestamps - run.frames.timestamps[:1].sum(), 3)
    return as_script(data)


def as_script(data: dict[str, Any]) -> Markup:
    """Return JSON for an element ``script``: nothing in it can end the element."""
    text = json.dumps(data, separators=(",", ":"), allow_nan=False)
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(f'<script type="application/json" id="data">{text}</script>')


def frames_shown(story: Story) -> IntArray:
    """Return positions of frames for the page: all, or a selection with the special ones."""
    frames = story.run.frames
    n = len(frames)
    if n <= _FRAMES:
        return np.arange(n)
    changes = np.flatnonzero(frames.state[1:] != frames.state[:-1]) + 1
    special = [*(m.position for m in story.worst), *(e.position for e in story.events)]
    special += np.flatnonzero(np.isin(frames.index, list(story.run.images))).tolist()
    changes = changes[:_FRAMES]
    parts = [_evenly(n, _FRAMES), changes, changes - 1, np.array(special, np.int64)]
    return np.unique(np.concatenate(parts))


def loop_ends(run: RunFolder) -> FloatArray:
    """Return both ends of the loops of the main map, (l, 2, 3), in the unit of the page."""
    numbers = run.frames.map_index[np.isfinite(run.frames.map_index)]
    last_map = int(numbers[-1]) if len(numbers) else 0
    # Folders of earlier versions only hold the last state.
    main = run.report.get("main_map", last_map)
    of_map = [loop for loop in run.report.get("loops", []) if loop.get("map") == main]
    if not of_map or not len(run.path):
        return np.zeros((0, 2, 3))
    times = np.array([loop["timestamps"] for loop in of_map], np.float64)
    # Keyframes that were culled since are found in the path, which follows the map as well.
    nearest = np.abs(times[..., None] - run.path.timestamps).argmin(axis=-1)
    ends: FloatArray = run.metres * run.path.positions[nearest]
    return ends


def _keyframes(run: RunFolder) -> dict[str, Any]:
    keep = _evenly(len(run.keyframes), _KEYFRAMES)
    keyframes = run.keyframes.select(keep)
    positions = positions_of(run, keyframes)
    poses = keyframes.T_wc[:, :3, :4].copy()
    poses[:, :, 3] *= run.metres
    return {
        "keyframes": rounded(poses.ravel(), 4),
        "keyframe_seconds": rounded(run.frames.seconds[positions], 3),
        "loops": rounded(loop_ends(run).ravel(), 4),
    }


def _points(run: RunFolder) -> dict[str, Any]:
    """Return map points as 16-bit numbers within a box, base64, without very distant ones."""
    points = run.metres * run.points
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return {"points": "", "box": [0, 0, 0, 1]}
    low, high = np.quantile(points, [0.02, 0.98], axis=0)
    if len(run.path):
        path = run.metres * run.path.positions
        low, high = np.minimum(low, path.min(axis=0)), np.maximum(high, path.max(axis=0))
    points = points[np.all((points >= low) & (points <= high), axis=1)]
    points = points[_evenly(len(points), _POINTS)]
    size = max(float((high - low).max()), 1e-9)
    numbers = np.rint((points - low) / size * 65535).astype("<u2")
    box = [*rounded(low, 5), round(size, 5)]
    return {"points": base64.b64encode(numbers.tobytes()).decode(), "box": box}


def _evenly(n: int, most: int) -> IntArray:
    return np.unique(np.linspace(0, max(0, n - 1), min(n, most)).astype(np.int64))


def _nan(run: RunFolder) -> FloatArray:
    return np.full(len(run.frames), np.nan)


def rounded(values: FloatArray, digits: int) -> list[float | None]:
    """Return numbers with `digits` decimals; None for values that are not finite."""
    known = np.isfinite(values).tolist()
    told = np.round(values, digits).tolist()
    make = int if digits == 0 else float
    return [make(value) if there else None for value, there in zip(told, known, strict=True)]
