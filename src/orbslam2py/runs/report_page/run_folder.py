# SPDX-License-Identifier: BSD-3-Clause
"""The files of a run, read from its folder."""

from __future__ import annotations

import csv
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import number_of
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py._files import describe_error
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.maps.ply import read_points
from orbslam2py.runs.frame_table import STAGES
from orbslam2py.runs.report_page.columns import Columns
from orbslam2py.runs.result import empty_trajectory
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.records import TrackingState
from orbslam2py.trajectory import Trajectory, read_tum
from orbslam2py.trajectory.level import level_frame, moved

#: States of a frame, the values of `FrameRow.state`.
_STATES = frozenset([*TrackingState.__members__, "SKIPPED", "DROPPED"])


@dataclass(frozen=True, eq=False)
class Frames:
    """The columns of frames.csv, (n,) each; nan for empty fields."""

    index: IntArray
    """Number in the sequence."""
    timestamps: FloatArray
    """Seconds."""
    state: npt.NDArray[np.str_]
    reason: list[str]
    map_index: FloatArray
    inliers: FloatArray
    is_keyframe: npt.NDArray[np.bool_]
    visual_odometry: npt.NDArray[np.bool_]
    is_weak: npt.NDArray[np.bool_]
    """Whether the pose has weak evidence."""
    found: FloatArray
    """Visibility ratio: share of the points that should be in view that were found."""
    has_pose: npt.NDArray[np.bool_]
    """Whether there is a pose."""
    milliseconds: dict[str, FloatArray]
    """Per stage."""

    def __len__(self) -> int:
        return len(self.index)

    @property
    def seconds(self) -> FloatArray:
        """Time since the first frame, (n,)."""
        seconds: FloatArray = self.timestamps - self.timestamps[:1].sum()
        return seconds


@dataclass(frozen=True, eq=False)
class RunFolder:
    """A run from its files, for drawing.

    Positions have the axes of the first keyframe: right, down, forward. Those of maps that an IMU
    has turned upright are turned to level axes (`level_frame`).
    """

    folder: Path
    report: dict[str, Any]
    frames: Frames
    path: Trajectory
    """Trajectory of the main map, after the last optimisation."""
    others: dict[int, Trajectory]
    """Trajectories of the other maps, by their numbers, each in its own frame."""
    keyframes: Trajectory
    truth: Trajectory | None
    """True poses in the frame and unit of `path`."""
    points: FloatArray
    """Map points (p, 3) in the frame and unit of `path`."""
    images: dict[int, bytes]
    """JPEG images of some frames by their number in the sequence."""
    places: list[Path]
    """Folders to search for the files; each file is read from the first that has it."""
    to_axes: FloatArray = field(default_factory=lambda: np.eye(4))
    """Transform (4, 4) from the world of the files of the main map."""

    @cached_property
    def online(self) -> Trajectory:
        """The trajectory at the time of tracking, without gaps."""
        return _turned(_read_path(self.places, "trajectory_online.txt"), self.to_axes)

    @cached_property
    def map(self) -> MapArrays | None:
        """The drawing of the main map; None if the file does not exist.

        Raises
        ------
        MapFileError
            If it is not whole.
        """
        file = _find(self.places, "map.npz")
        return None if file is None else MapArrays.load(file).moved(self.to_axes)

    @property
    def sensor(self) -> Sensor:
        """The sensor.

        Raises
        ------
        DatasetError
            If the report names a file that does not exist.
        """
        try:
            return Sensor(self.report["sensor"])
        except SettingsError as error:
            file = self.folder / "report.json"
            raise DatasetError(f"{file} is no report of a run; give another folder") from error

    @property
    def name(self) -> str:
        """Of the sequence."""
        return str(self.report.get("sequence", self.folder.name))

    @property
    def is_monocular(self) -> bool:
        """Whether lengths are in the map's own unit: one camera, without an IMU that scaled it."""
        metric = (self.report.get("imu") or {}).get("metric", False)
        return self.report.get("sensor") == "mono" and not metric

    @property
    def metres(self) -> float:
        """Factor from lengths to `unit`."""
        scale = self.report.get("ate_scale")
        return float(scale) if self.is_monocular and scale else 1.0

    @property
    def unit(self) -> str:
        """Unit of lengths after multiplication by `metres`."""
        return "units" if self.is_monocular and not self.report.get("ate_scale") else "m"


def read_run(folders: Path | Sequence[Path]) -> RunFolder:
    """Read the folder of a run; of several, each file from the first that has it.

    Raises
    ------
    DatasetError
        If it is no run, or a file that every run writes is missing or incomplete.
    """
    places = [folders] if isinstance(folders, Path) else list(folders)
    report = _read_report(places)
    frames_file = _find(places, "frames.csv")
    if frames_file is None:
        raise DatasetError(
            f"{places[0]} holds no whole run: frames.csv is missing; run the sequence again"
        )
    numbers = {
        int(file.stem.removeprefix("trajectory_map"))
        for place in places
        for file in place.glob("trajectory_map*.txt")
        if file.stem.removeprefix("trajectory_map").isdecimal()
    }
    upright = {entry["map"] for entry in report.get("maps", []) if entry.get("upright")}
    others = {
        number: _in_axes(read_tum(file), is_upright=number in upright)
        for number in sorted(numbers)
        if (file := _find(places, f"trajectory_map{number}.txt")) is not None
    }
    frames = read_frames(frames_file)
    _check_number(frames_file, len(frames), "frame", report.get("seen_frames"))
    path = _read_path(places, "trajectory.txt")
    path_file = _find(places, "trajectory.txt")
    if path_file is not None:
        _check_number(path_file, len(path), "pose", _poses_of_main_map(report))
    points = _find(places, "points.ply")
    truth = _find(places, "groundtruth_aligned.txt")
    keyframes = _read_path(places, "keyframes.txt")
    T = np.eye(4)
    if report.get("main_map") in upright and len(keyframes):
        T = level_frame(keyframes.T_wc[0])
    return RunFolder(
        folder=places[0],
        report=report,
        frames=frames,
        path=_turned(path, T),
        others=others,
        keyframes=_turned(keyframes, T),
        truth=None if truth is None else _turned(read_tum(truth), T),
        points=np.zeros((0, 3)) if points is None else moved(T, read_points(points)),
        images=_read_images(_find(places, "frame_images.zip")),
        places=places,
        to_axes=T,
    )


def _in_axes(path: Trajectory, *, is_upright: bool) -> Trajectory:
    return _turned(path, level_frame(path.T_wc[0])) if is_upright and len(path) else path


def _turned(path: Trajectory, T: FloatArray) -> Trajectory:
    return Trajectory(path.timestamps, T @ path.T_wc, path.lost, path.indices)


def _check_number(file: Path, found: int, noun: str, told: Any) -> None:
    """Check that a file is as long as the report says; older reports may not say it."""
    if isinstance(told, int) and told != found:
        raise DatasetError(
            f"{file} holds {number_of(found, noun)}, but report.json has {told}: it is cut, "
            "or of another run; run the sequence again"
        )


def _poses_of_main_map(report: dict[str, Any]) -> int | None:
    for entry in report.get("maps", []):
        if entry["map"] == report.get("main_map"):
            tracked: int | None = entry.get("tracked")  # older reports lack it
            return tracked
    return None


def _find(places: list[Path], name: str) -> Path | None:
    return next((place / name for place in places if (place / name).is_file()), None)


def _read_report(places: list[Path]) -> dict[str, Any]:
    folder = places[0]
    if not folder.is_dir():
        raise DatasetError(f"{folder} is no folder; give one that orbslam2py run has written")
    file = _find(places, "report.json")
    if file is None:
        raise DatasetError(
            f"{folder} holds no run: report.json is missing; give a folder that orbslam2py run has "
            "written"
        )
    try:
        report = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise DatasetError(
            f"{file} cannot be read: {describe_error(error)}; run the sequence again"
        ) from error
    if not (isinstance(report, dict) and {"sequence", "sensor", "frames"} <= report.keys()):
        raise DatasetError(f"{file} is no report of a run; give another folder")
    return report


def _read_path(places: list[Path], name: str) -> Trajectory:
    file = _find(places, name)
    return empty_trajectory() if file is None else read_tum(file)


def _read_images(file: Path | None) -> dict[int, bytes]:
    if file is None:
        return {}
    try:
        with zipfile.ZipFile(file) as archive:
            names = [name for name in archive.namelist() if Path(name).stem.isdigit()]
            return {int(Path(name).stem): archive.read(name) for name in sorted(names)}
    except (OSError, zipfile.BadZipFile) as error:
        raise DatasetError(
            f"{file} cannot be read: {describe_error(error)}; remove it, the page is made without"
        ) from error


def read_frames(path: Path) -> Frames:
    """Read frames.csv.

    Raises
    ------
    DatasetError
        The message names the file, and the line if one is invalid.
    """
    try:
        # Reasons hold names of files byte by byte; a page can only hold UTF-8.
        with path.open(newline="", encoding="utf-8", errors="replace") as stream:
            reader = csv.reader(stream)
            header = next(reader, [])
            rows = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        raise DatasetError(
            f"{path} cannot be read: {describe_error(error)}; run the sequence again"
        ) from error
    except csv.Error as error:
        raise DatasetError(
            f"{path} is no whole table of frames ({error}); run the sequence again"
        ) from error
    if not header:
        raise DatasetError(f"{path} is empty; run the sequence again")
    for line, row in rows:
        if len(row) != len(header):
            raise DatasetError(
                f"{path}:{line} has {len(row)} of {len(header)} columns, so the file is cut or was "
                "changed; run the sequence again"
            )
    columns = {name: [row[k] for _, row in rows] for k, name in enumerate(header)}
    return _frames_of(Columns(path, [line for line, _ in rows], columns))


def _frames_of(columns: Columns) -> Frames:
    nothing = [""] * len(columns)
    numbers = columns.numbers
    return Frames(
        index=columns.whole_numbers("index"),
        timestamps=numbers("timestamp", may_be_empty=False),
        state=np.array(columns.words("state", "state", _STATES), dtype=np.str_),
        reason=columns["reason"],
        map_index=numbers("map"),
        inliers=numbers("inliers"),
        is_keyframe=np.array([text == "1" for text in columns["keyframe"]], bool),
        visual_odometry=np.array([text == "1" for text in columns["visual_odometry"]], bool),
        # Folders of earlier versions do not have the next two.
        is_weak=np.array([text == "weak" for text in columns.get("evidence", nothing)], bool),
        found=numbers("found") if "found" in columns else np.full(len(columns), np.nan),
        has_pose=np.array([text != "" for text in columns["tx"]], bool),
        milliseconds={
            stage: numbers(f"ms_{stage}") for stage in STAGES if f"ms_{stage}" in columns
        },
    )
