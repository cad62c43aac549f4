# SPDX-License-Identifier: BSD-3-Clause
"""KITTI odometry: ``times.txt``, ``calib.txt``, and the images of a grey or a colour pair."""

from __future__ import annotations

import logging
import re
from pathlib import Path

import numpy as np

from orbslam2py._arguments import index_of
from orbslam2py._arguments import number_of as counted
from orbslam2py._arrays import FloatArray
from orbslam2py._text_lines import content_lines, number_of
from orbslam2py.datasets.base import Images, Layout, Stamps, rate_of, require_frames
from orbslam2py.datasets.choose_settings import SettingsChoice
from orbslam2py.datasets.clock import read_clock, time_of
from orbslam2py.datasets.images import read_image
from orbslam2py.datasets.recorded import RecordedSequence
from orbslam2py.errors import DatasetError, ImageError, SettingsError
from orbslam2py.settings import (
    CameraSettings,
    DepthSettings,
    OrbSettings,
    Sensor,
    Settings,
    builtin_settings,
)
from orbslam2py.settings.fit import builtin_for_size
from orbslam2py.trajectory import Trajectory, read_kitti

_log = logging.getLogger(__name__)

#: Numbers of the left and the right camera of the grey pair, which comes first, and the colour one.
_PAIRS = ((0, 1), (2, 3))

#: Names of the built-in settings, and the last sequence whose number selects one.
_ALL_BUILT_IN = "kitti00-02, kitti03 or kitti04-12, by the number of the sequence"
_LAST_NUMBERED = 12

_CLOSE_FACTOR = 40.0
_USUAL_RATE = 10.0


class KittiSequence(RecordedSequence):
    """A sequence in the layout of KITTI odometry; see `datasets.base.Sequence`.

    The grey cameras ``image_0`` and ``image_1`` are used if they exist, else the colour cameras
    ``image_2`` and ``image_3``, with their own calibration.

    Parameters
    ----------
    folder
        The folder with ``times.txt`` and ``image_0`` or ``image_2``.
    sensor
        Monocular (left camera) or stereo; by default stereo if there are images of both cameras.
    settings
        Settings, a file, a built-in name, or None to choose by the folder.

    Raises
    ------
    DatasetError
        The message names the file, and the line if a list is malformed; also if there are images
        without a time. Times without images give a warning, because a part of the images may have
        been copied.
    SettingsError
        If the settings are invalid.
    """

    layout = Layout.KITTI
    up_in_truth = np.array([0.0, -1.0, 0.0])  # the world is the first camera, mounted level
    _missing_calibration = (
        f"calib.txt is missing; copy it there from the data set, or give --settings {_ALL_BUILT_IN}"
    )

    def __init__(
        self,
        folder: str | Path,
        sensor: Sensor | str | None = None,
        *,
        settings: SettingsChoice = None,
    ) -> None:
        folder = Path(folder)
        sensor = None if sensor is None else Sensor(sensor)
        self._left, self._right, has_right = _choose_cameras(folder, sensor)
        available = (Sensor.STEREO, Sensor.MONOCULAR) if has_right else (Sensor.MONOCULAR,)
        super().__init__(folder, available, sensor, settings)
        times = self.folder / "times.txt"
        self._list_path = times
        chosen = None if self._chosen is None else self._chosen.camera.fps
        self._stamps = _read_times(times, chosen or _USUAL_RATE)
        require_frames(times, len(self))
        folders = [self.folder / f"image_{camera}" for camera in self._cameras()]
        #: Numbers of the images, where they do not begin at 0.
        self._numbers = _numbers_of_a_piece(times, len(self), folders)
        if self._numbers is None:
            _check_number_of_times(times, len(self), folders)

    def image_path(self, index: int, /) -> Path:
        """Return the file of the left image of a frame."""
        return self._path(self._left, index)

    def load(self, index: int, /) -> Images:
        """Read the images of a frame; see `datasets.base.Sequence.load`."""
        image, *right = map(self._read, self._files(index))
        return Images(image, right=right[0]) if right else Images(image)

    def ground_truth(self) -> Trajectory | None:
        """Read ``poses.txt``, ``NN.txt`` or ``../../poses/NN.txt``.

        See `datasets.base.Sequence.ground_truth`. Poses belong to frames by their number; a
        shortened sequence may have fewer frames than poses. They are those of the left grey camera;
        ``calib.txt`` contains the distance to the colour camera.
        """
        path = self._ground_truth_path()
        if path is None:
            return None
        poses = read_kitti(path, np.arange(sum(1 for _ in content_lines(path)), dtype=np.float64))
        n = min(len(poses), len(self))
        if len(poses) != len(self):
            _log.warning("%s holds %d poses for %d frames", path, len(poses), len(self))
        return Trajectory(self.timestamps[:n], poses.T_wc[:n] @ self._T_grey_camera())

    def _files(self, index: int) -> tuple[Path, ...]:
        return tuple(self._path(camera, index) for camera in self._cameras())

    def _cameras(self) -> tuple[int, ...]:
        return (self._left, self._right)[: 1 + (self.sensor is Sensor.STEREO)]

    def _path(self, camera: int, index: int) -> Path:
        index = index_of(index, len(self))
        folder = self.folder / f"image_{camera}"
        number = index if self._numbers is None else self._numbers[index]
        path = folder / f"{number:06d}.png"
        if not path.is_file() and path.with_suffix(".jpg").is_file():
            path = path.with_suffix(".jpg")
        return path

    def _T_grey_camera(self) -> FloatArray:
        """Return the transform (4, 4) from the left camera to the left grey one [m]."""
        T = np.eye(4)
        path = self.folder / "calib.txt"
        name = f"P{self._left}"
        if self._left and path.is_file() and name in (projections := _read_calibration(path)):
            # P = K [I | t] takes points of the left grey camera, to which all are rectified.
            P = projections[name]
            T[:3, 3] = -np.linalg.solve(P[:, :3], P[:, 3])
        return T

    def _ground_truth_path(self) -> Path | None:
        candidates = [self.folder / "poses.txt"]
        if re.fullmatch(r"\d\d", self.name):
            candidates.append(self.folder / f"{self.name}.txt")
            candidates.append(self.folder.resolve().parent.parent / "poses" / f"{self.name}.txt")
        candidates += sorted(
            path for path in self.folder.glob("*.txt") if re.fullmatch(r"\d\d", path.stem)
        )
        return next((path for path in candidates if path.is_file()), None)

    def _from_calibration(self) -> Settings | None:
        path = self.folder / "calib.txt"
        if not path.is_file():
            return None
        projections = _read_calibration(path)
        stereo = self.sensor is Sensor.STEREO
        if not stereo and f"P{self._left}" not in projections and "P0" in projections:
            _log.info(
                "%s has no line 'P%d:'; taking P0, whose focal length and centre all rectified "
                "cameras of KITTI share",
                *(path, self._left),
            )
            projections[f"P{self._left}"] = projections["P0"]
        for number, side in ((self._left, "left"), (self._right, "right"))[: 1 + stereo]:
            if f"P{number}" not in projections:
                colour = "grey" if number in _PAIRS[0] else "colour"
                needed = ", needed for stereo" if side == "right" else ""
                raise DatasetError(
                    f"{path} has no line 'P{number}:' ({side} {colour} camera){needed}; copy the "
                    f"sequence's own calib.txt there, or give --settings {self._built_in()}"
                )
        P = projections[f"P{self._left}"]
        try:
            camera = CameraSettings(
                fx=P[0, 0],
                fy=P[1, 1],
                cx=P[0, 2],
                cy=P[1, 2],
                fps=rate_of(self.timestamps, _USUAL_RATE),
                # Minus the left one's: colour cameras are not at the origin, as P0's is.
                bf=P[0, 3] - projections[f"P{self._right}"][0, 3] if stereo else 0.0,
                rgb=True,
            )
            return Settings(
                sensor=self.sensor,
                camera=camera,
                orb=OrbSettings(n_features=2000),
                depth=DepthSettings(_CLOSE_FACTOR) if stereo else None,
                viewer=builtin_settings("kitti00-02", self.sensor).viewer,
            )
        except SettingsError as error:
            raise DatasetError(f"{path}: {error}") from error

    def _built_in(self) -> str:
        """Return the built-in settings that fit the first image or the number; all if none does."""
        try:
            height, width = read_image(self.image_path(0), rgb=True).shape[:2]
        except (DatasetError, ImageError):
            height, width = 0, 0
        for name in builtin_for_size((width, height)):
            if name.startswith("kitti"):
                return f"{name} (images of {width} x {height})"
        if re.fullmatch(r"\d\d", self.name) and int(self.name) <= _LAST_NUMBERED:
            number = int(self.name)
            name = "kitti00-02" if number < 3 else "kitti03" if number == 3 else "kitti04-12"
            return f"{name} (sequence {self.name})"
        return _ALL_BUILT_IN


def find_cameras(folder: Path) -> tuple[int, ...]:
    """Return the numbers of the left cameras that have images: 0 (grey), 2 (colour)."""
    return tuple(left for left, _ in _PAIRS if (folder / f"image_{left}").is_dir())


def _choose_cameras(folder: Path, sensor: Sensor | None) -> tuple[int, int, bool]:
    """Choose the left and the right camera; return whether the right one has images."""
    there = [pair for pair in _PAIRS if pair[0] in find_cameras(folder)] or list(_PAIRS[:1])
    whole = [pair for pair in there if (folder / f"image_{pair[1]}").is_dir()]
    left, right = there[0] if sensor is Sensor.MONOCULAR or not whole else whole[0]
    return left, right, bool(whole)


def _read_times(path: Path, fps: float | None) -> Stamps:
    lines = content_lines(path)
    for line in lines:
        time_of(path, line, " ".join(line.fields))
    clock = read_clock(path, [" ".join(line.fields) for line in lines], fps)
    if list(clock.order) != sorted(clock.order):
        raise DatasetError(
            f"{path}: time must grow from line to line, since the lines belong to the images in "
            "order; correct the list"
        )
    return clock.stamps([line.number for line in lines])


def _numbers_of_a_piece(times: Path, n: int, folders: list[Path]) -> list[int] | None:
    """Return the numbers of the images if a sequence does not begin at 0; None if it does."""
    found = [_numbers_of_images(folder) for folder in folders]
    numbers = found[0]
    if len(numbers) != n or not numbers or numbers[0] == 0 or any(f != numbers for f in found):
        return None
    _log.warning(
        "%s: the images have the numbers %06d to %06d; line by line they belong to its %d times",
        *(times, numbers[0], numbers[-1], n),
    )
    return numbers


def _check_number_of_times(times: Path, n: int, folders: list[Path]) -> None:
    """Refuse images without a time, and warn of times without images.

    Images belong to times by their number. Images beyond the last time would be left out, and a
    short list may belong to another sequence. Times without images are harmless, for example if
    only the first images were copied. They are skipped like any missing image, with one warning for
    all.
    """
    found = [(numbers, folder) for folder in folders if (numbers := _numbers_of_images(folder))]
    for numbers, folder in found:
        if numbers[-1] >= n:
            raise DatasetError(
                f"{times} holds {counted(n, 'time stamp')}, but there are {len(numbers)} images in "
                f"{folder}, up to {numbers[-1]:06d}; copy the sequence's own times.txt there, or "
                f"take the images from {n:06d} on away"
            )
    # Of a pair, the camera whose images end first. No images at all: see `require_images`.
    numbers, folder = min(found, key=lambda one: one[0][-1], default=([], times))
    if numbers and numbers[-1] + 1 < n:
        _log.warning(
            "%s holds %d time stamps, but there are %d images in %s, up to %06d; the frames after "
            "it are skipped: put their images there, or take --max-frames %d",
            *(times, n, len(numbers), folder, numbers[-1], numbers[-1] + 1),
        )


def _numbers_of_images(folder: Path) -> list[int]:
    """Return the numbers of the frames with an image in a folder, ascending."""
    if not folder.is_dir():
        return []
    stems = {path.stem for path in folder.iterdir() if path.suffix in (".png", ".jpg")}
    return sorted(int(stem) for stem in stems if re.fullmatch(r"[1-9]?\d{6}", stem, re.ASCII))


def _read_calibration(path: Path) -> dict[str, FloatArray]:
    """Projection matrices (3, 4) by name; lines with other names (Tr) are left out."""
    projections = {}
    for line in content_lines(path):
        name = line.fields[0].rstrip(":")
        if not re.fullmatch(r"P\d", name):
            continue
        numbers = [number_of(path, line, field) for field in line.fields[1:]]
        if len(numbers) != 12:
            raise DatasetError(
                f"{path}:{line.number}: {name} has {len(numbers)} numbers instead of 12"
            )
        projections[name] = np.array(numbers).reshape(3, 4)
    return projections
