# SPDX-License-Identifier: BSD-3-Clause
"""The history of a run: errors by frame, events, largest errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.runs.frame_errors import position_errors, worst_places
from orbslam2py.runs.report_page.round_numbers import short
from orbslam2py.runs.report_page.run_folder import RunFolder
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import rotation_angles

#: Time before and after an event that counts as its place [s].
_AROUND = 1.0
#: Turning by more in a second is fast [deg]; fewer inliers than this part of the median are few.
_FAST_TURN, _FEW_INLIERS = 45.0, 0.5


@dataclass(frozen=True)
class Event:
    """An event at a frame."""

    position: int
    """Position of the frame in frames.csv."""
    kind: str
    """``loop``, ``relocalised``, ``lost``, ``map``, ``merge``."""
    text: str


@dataclass(frozen=True)
class Moment:
    """A frame of interest, and why."""

    position: int
    value: float
    """Error [m or units]."""
    happened: str


@dataclass(frozen=True, eq=False)
class Story:
    """A run, frame by frame."""

    run: RunFolder
    of_path: IntArray
    """(k,) position in frames.csv of every pose of `RunFolder.path`."""
    errors: FloatArray
    """(n,) distance of every frame to the ground truth [m], nan if unknown."""
    events: list[Event]
    """In the order of the frames."""
    worst: list[Moment]
    """The largest errors with some distance between them, the largest first."""

    @classmethod
    def of(cls, run: RunFolder) -> Story:
        """Make the history from the files."""
        of_path = positions_of(run, run.path)
        errors = np.full(len(run.frames), np.nan)
        worst: list[Moment] = []
        events = _events(run)
        if run.truth is not None and run.report.get("ate_rmse_m") is not None:
            of_poses = position_errors(run.path, run.truth, run.metres)
            errors[of_path] = of_poses
            for place in worst_places(of_poses).tolist():
                position = int(of_path[place])
                happened = _what_happened(run, events, position, place)
                worst.append(Moment(position, float(of_poses[place]), happened))
        return cls(run, of_path, errors, events, worst)

    @property
    def duration(self) -> float:
        """Return seconds from the first frame to the last; times of skipped frames may decrease."""
        return float(max(self.run.frames.seconds, default=0.0))

    @property
    def has_truth(self) -> bool:
        """Return whether any error is known."""
        return bool(np.isfinite(self.errors).any())


def positions_of(run: RunFolder, path: Trajectory) -> IntArray:
    """Find the frame of every pose by its time stamp: positions in frames.csv, (k,)."""
    times = run.frames.timestamps
    order = np.argsort(times, kind="stable")
    found = np.searchsorted(times[order], path.timestamps - 1e-9)
    positions: IntArray = order[np.clip(found, 0, max(0, len(times) - 1))].astype(np.int64)
    return positions if len(times) else np.zeros(0, np.int64)


def _events(run: RunFolder) -> list[Event]:
    frames = run.frames
    events: list[Event] = []
    for entry in run.report.get("losses", []):
        where = np.flatnonzero(frames.index == entry["frame"])
        if len(where):
            end = "" if entry["found_again"] else ", not found again"
            frames_text = number_of(entry["frames"], "frame")
            text = f"tracking lost for {frames_text} ({entry['seconds']:.1f} s{end}): "
            events.append(Event(int(where[0]), "lost", text + entry["reason"]))
    merges = _merges(run)
    events += [event for _, _, event in merges]

    def part_of(number: float, position: int) -> float:
        """Return the map that contained a map at the time of a frame."""
        for younger, older, event in merges:
            if number == younger and event.position <= position:
                number = older
        return number

    previous_map, previous_state = np.nan, ""
    seen: set[float] = set()
    for position, (number, state) in enumerate(zip(frames.map_index, frames.state, strict=True)):
        if np.isnan(number):
            continue
        before, now = (part_of(one, position) for one in (previous_map, number))
        if now != before and not np.isnan(before):
            what = "again" if number in seen else "begun"
            events.append(Event(position, "map", f"map {number:.0f} {what}"))
        elif state == "OK" and previous_state == "LOST":
            events.append(Event(position, "relocalised", _found(run, events)))
        seen.add(number)
        previous_map, previous_state = number, state
    unit = "units" if run.is_monocular else "m"
    for entry in run.report.get("loops", []):
        if len(frames):
            at = _frame_at(run, entry["timestamps"][1])
            text = f"loop closed: keyframe {entry['keyframes'][1]} at {entry['keyframes'][0]}, "
            text += f"moved by {short(entry['correction_m'])} {unit}"
            events.append(Event(at, "loop", text))
    return sorted(events, key=lambda event: event.position)


def _merges(run: RunFolder) -> list[tuple[int, int, Event]]:
    """Return merged maps, the maps that contain them, and when, in the order of the report."""
    found = []
    for entry in run.report.get("merges", []) if len(run.frames) else []:
        text = f"map {entry['merged']} became part of map {entry['map']}: keyframe "
        text += f"{entry['keyframes'][1]} shows the place of keyframe {entry['keyframes'][0]}"
        if run.is_monocular:
            text += f"; its lengths times {short(entry['scale'], 4)}"
        event = Event(_frame_at(run, entry["timestamps"][1]), "merge", text)
        found.append((entry["merged"], entry["map"], event))
    return found


def _frame_at(run: RunFolder, seconds: float) -> int:
    """Return the position of the frame with the nearest time stamp."""
    return int(np.argmin(np.abs(run.frames.timestamps - seconds)))


def _found(run: RunFolder, events: list[Event]) -> str:
    """Return a text: the camera was found for the first time, in a loaded map, or again."""
    is_first = not any(event.kind == "relocalised" for event in events)
    if is_first and run.report.get("loaded_map") is not None:
        return "camera found in the loaded map"
    return "camera found again in the map"


def _what_happened(run: RunFolder, events: list[Event], position: int, place: int) -> str:
    """Return a text: unusual events around a frame."""
    frames = run.frames
    near = np.abs(frames.timestamps - frames.timestamps[position]) <= _AROUND
    said = [event.text for event in events if near[event.position]]
    dropped = int(np.sum(frames.state[near] == "DROPPED"))
    if dropped:
        said.append(f"{number_of(dropped, 'frame')} dropped")
    tracked = frames.state == "OK"
    usual = float(np.nanmedian(frames.inliers[tracked])) if tracked.any() else 0.0
    fewest = float(np.nanmin(frames.inliers[near & tracked], initial=np.inf))
    if fewest < _FEW_INLIERS * usual:
        said.append(f"down to {fewest:.0f} inliers")
    turn = _fastest_turn(run.path, place)
    if turn > _FAST_TURN:
        said.append(f"fast turn: {turn:.0f}°/s")
    if frames.visual_odometry[near].any():
        said.append("visual odometry: outside the map")
    said.append(_circumstances(run, position, place, usual))
    return "; ".join(said)


def _circumstances(run: RunFolder, position: int, place: int, usual: float) -> str:
    """Return a text: motion of the camera, visible points, and distance of the last keyframe."""
    frames, path = run.frames, run.path
    near = np.flatnonzero(np.abs(path.timestamps - path.timestamps[place]) <= 0.5 * _AROUND)
    said = []
    if place == 0:
        said.append("the first pose")
    if place == len(path) - 1:
        said.append("the last pose")
    passed = float(path.timestamps[near[-1]] - path.timestamps[near[0]])
    if passed > 0:
        way = float(np.linalg.norm(np.diff(path.positions[near], axis=0), axis=1).sum())
        speed = short(run.metres * way / passed, 2)
        said.append(f"moving {speed} {run.unit}/s, turning {_mean_turn(path, near):.0f}°/s")
    if np.isfinite(frames.inliers[position]):
        said.append(f"{frames.inliers[position]:.0f} inliers (usual are {usual:.0f})")
    before = np.flatnonzero(frames.is_keyframe[: position + 1])
    if len(before):
        since = float(frames.timestamps[position] - frames.timestamps[before[-1]])
        said.append("a keyframe" if since == 0 else f"{short(since, 2)} s after a keyframe")
    return ", ".join(said)


def _mean_turn(path: Trajectory, rows: IntArray) -> float:
    """Return the mean angular velocity over some poses [deg/s]."""
    R = path.T_wc[rows, :3, :3]
    angles = rotation_angles(np.swapaxes(R[:-1], 1, 2) @ R[1:])
    passed = float(path.timestamps[rows[-1]] - path.timestamps[rows[0]])
    return float(np.degrees(angles.sum()) / passed) if passed > 0 else 0.0


def _fastest_turn(path: Trajectory, place: int) -> float:
    """Return the largest angular velocity around a pose [deg/s]."""
    near = np.abs(path.timestamps - path.timestamps[place]) <= _AROUND
    rows = np.flatnonzero(near)
    if len(rows) < 2:
        return 0.0
    R, times = path.T_wc[rows, :3, :3], path.timestamps[rows]
    angles = rotation_angles(np.swapaxes(R[:-1], 1, 2) @ R[1:])
    steps = np.maximum(np.diff(times), 1e-3)
    return float(np.degrees(np.max(angles / steps)))
