# SPDX-License-Identifier: BSD-3-Clause
"""The contents of a map file: the map, and all that is needed to use it."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import instance_of, is_whole, shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.map_copies import restore_contents
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    poses_from,
    rotations_from_quaternions,
)
from orbslam2py.trajectory.trajectory import Trajectory

#: It takes a tenth of a second for a vocabulary of a million words.
_known_sha256: weakref.WeakKeyDictionary[core.Vocabulary, str] = weakref.WeakKeyDictionary()


def _sha256_of(vocabulary: core.Vocabulary) -> str:
    if vocabulary not in _known_sha256:
        _known_sha256[vocabulary] = vocabulary.sha256()
    return _known_sha256[vocabulary]


@dataclass(frozen=True)
class VocabularyIdentity:
    """Identity of a vocabulary."""

    name: str
    """Name of the file; empty if it was made in memory."""
    hash: str
    """SHA-256 of the content, 64 hexadecimal digits, as ``orbslam2py vocabulary info`` shows it.
    Map files of version 1 have a shorter hash of 16 digits."""
    comment: str = ""
    """Origin and licence."""

    @classmethod
    def of(cls, vocabulary: core.Vocabulary, name: str = "") -> VocabularyIdentity:
        """Identify a vocabulary by its content."""
        return cls(name, _sha256_of(vocabulary), vocabulary.comment)

    def is_of(self, vocabulary: core.Vocabulary) -> bool:
        """Return whether a vocabulary has this identity."""
        short = f"{vocabulary.hash:016x}"
        return self.hash == (short if len(self.hash) == len(short) else _sha256_of(vocabulary))


@dataclass(frozen=True, eq=False)
class RecordedFrames:
    """Poses of the images of a run relative to keyframes: (n,) entries each."""

    timestamps: FloatArray
    """Seconds."""
    ids: IntArray
    """Numbers of the images in their run."""
    keyframes: IntArray
    """Ids of living or removed keyframes; -1 before the first pose."""
    T_cr: FloatArray
    """(n, 7) camera of the keyframe to that of the image at the keyframe's first scale: unit
    quaternion x, y, z, w, then the translation."""
    lost: ByteArray
    """1 if tracking was lost; the pose is then the last known one."""

    def __len__(self) -> int:
        return len(self.timestamps)

    @classmethod
    def none(cls) -> RecordedFrames:
        """No frames."""
        return cls(
            np.zeros(0),
            np.zeros(0, np.int64),
            np.zeros(0, np.int64),
            np.zeros((0, 7)),
            np.zeros(0, np.uint8),
        )


@dataclass(frozen=True)
class Run:
    """A run that made or extended the map."""

    program: str
    """Name and version, such as ``orbslam2py 0.1.0``."""
    started: str
    """Time, as ISO 8601 in UTC."""
    seed: int = 0
    options: Mapping[str, Any] = field(default_factory=dict)
    """Options of the system, by name."""
    frames: RecordedFrames = field(default_factory=RecordedFrames.none)


@dataclass(frozen=True, eq=False)
class SavedMap:
    """A map with its camera, its vocabulary and its runs: the contents of one map file.

    Examples
    --------
    >>> saved = load_map("office.orbmap")  # doctest: +SKIP
    >>> len(saved.contents.points), saved.sensor
    """

    contents: MapContents
    settings: Settings
    vocabulary: VocabularyIdentity
    runs: tuple[Run, ...] = ()
    images: Mapping[int, bytes] = field(default_factory=dict)
    """JPEG images of some keyframes, by their ids."""
    source: str = ""
    """The file that it was read from."""

    @property
    def sensor(self) -> Sensor:
        """Camera, vocabulary and runs of the map."""
        return self.settings.sensor

    @property
    def n_keyframes(self) -> int:
        """Of the map."""
        return len(self.contents.keyframes)

    @property
    def n_points(self) -> int:
        """Of the map."""
        return len(self.contents.points)

    def restore(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary | None = None,
        index: core.KeyFrameIndex | None = None,
        inertial: core.InertialKeyframes | None = None,
    ) -> None:
        """Make the map.

        Parameters
        ----------
        slam_map
            An empty map to fill.
        vocabulary
            Vocabulary for the words of the keyframes; known words are used if they are of this
            vocabulary.
        index
            Gets the keyframes with their words.
        inertial
            Gets the states of the IMU.
        """
        fits = vocabulary is not None and self.vocabulary.is_of(vocabulary)
        restore_contents(
            self.contents, slam_map, vocabulary, index, words_fit=fits, inertial=inertial
        )

    def trajectory(
        self, run: int = -1, map_number: int | None = None, *, in_world: bool = False
    ) -> Trajectory:
        """Return the poses of the images of a run in the present map.

        Parameters
        ----------
        run
            Number in `runs`; the last one by default.
        map_number
            Number of the map, from 0 for the oldest; by default the one with most images of the
            run.
        in_world
            In the world of the map, independent of its first keyframe.

        Returns
        -------
        Trajectory
            Trajectory of the images in that map, relative to its first keyframe, or in the world of
            a map that an IMU has turned upright; empty if the map has no runs.

        Raises
        ------
        MapFileError
            If there is no such run, or no such map.
        """
        if not self.runs:
            return Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
        n = len(self.runs)
        frames = self.runs[_number_of(run, "run", -n, n)].frames
        roots = np.flatnonzero(self.contents.keyframes.parent < 0)
        if map_number is not None:
            map_number = _number_of(map_number, "map_number", 0, len(roots))
        numbers = self._maps_of(frames.keyframes)
        if map_number is None:
            map_number = int(np.bincount(numbers[numbers >= 0], minlength=1).argmax())
        # Before the first pose a frame is in no map; it is listed with the first one.
        chosen = (numbers == map_number) | ((numbers < 0) & (map_number == 0))
        frames = RecordedFrames(
            **{field.name: getattr(frames, field.name)[chosen] for field in fields(frames)}
        )
        root = int(roots[map_number])
        T_rw, scale = self._keyframe_poses(frames.keyframes)
        T_cr = poses_from(
            rotations_from_quaternions(frames.T_cr[:, :4]), scale[:, None] * frames.T_cr[:, 4:]
        )
        T_wc = inverse_poses(T_cr @ T_rw)
        if len(frames) and not in_world:
            T_wc = self.contents.anchor(root) @ T_wc
        T_wc[frames.keyframes < 0] = np.eye(4)
        return Trajectory(frames.timestamps, T_wc, frames.lost != 0, frames.ids)

    def _maps_of(self, wanted: IntArray) -> IntArray:
        """Return the numbers of the maps of keyframes (n,), with removed ones; -1 for none."""
        keyframes, removed = self.contents.keyframes, self.contents.removed_keyframes
        ids = np.concatenate([keyframes.ids, removed.ids])
        order = np.argsort(ids)
        above = np.concatenate([keyframes.parent, removed.parent])
        rows = order[np.searchsorted(ids[order], np.maximum(above, ids.min()))]
        rows = np.where(above < 0, np.arange(len(ids)), rows)
        while not np.array_equal(rows[rows], rows):
            rows = rows[rows]
        roots = np.flatnonzero(keyframes.parent < 0)
        known = np.minimum(np.searchsorted(ids[order], np.maximum(wanted, ids.min())), len(ids) - 1)
        return np.where(wanted < 0, -1, np.searchsorted(roots, rows[order[known]]))

    def _keyframe_poses(self, wanted: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return `T_cw` (n, 4, 4) and scale (n,) of keyframes, also of removed ones."""
        keyframes, removed = self.contents.keyframes, self.contents.removed_keyframes
        row = {int(i): k for k, i in enumerate(keyframes.ids)}
        hangs = {int(i): k for k, i in enumerate(removed.ids)}
        T_kp = poses_from(rotations_from_quaternions(removed.rotations), removed.translations)
        known: dict[int, tuple[FloatArray, float]] = {-1: (np.eye(4), 1.0)}

        def pose_of(keyframe: int) -> tuple[FloatArray, float]:
            chain = []
            while keyframe not in known and keyframe not in row:
                chain.append(keyframe)
                keyframe = int(removed.parent[hangs[keyframe]])
            if keyframe not in known:
                k = row[keyframe]
                known[keyframe] = (keyframes.T_cw[k], float(keyframes.scale[k]))
            for dead in reversed(chain):
                k = hangs[dead]
                T_pw, scale = known[keyframe]
                stretched = scale / float(removed.parent_scale[k])
                T = T_kp[k].copy()
                T[:3, 3] *= stretched
                known[dead] = (T @ T_pw, float(removed.scale[k]) * stretched)
                keyframe = dead
            return known[keyframe]

        distinct, places = np.unique(wanted, return_inverse=True)
        poses = [pose_of(int(keyframe)) for keyframe in distinct]
        T = np.array([pose for pose, _ in poses]).reshape(-1, 4, 4)
        scales = np.array([scale for _, scale in poses])
        return T[places], scales[places]


def _number_of(value: Any, what: str, first: int, end: int) -> int:
    """Check that a number is at least `first` and below `end`."""
    if not is_whole(value) or not first <= value < end:
        raise MapFileError(
            f"{what} is {shown(value)}; give a whole number from {first} to {end - 1}"
        )
    return int(value)


def saved_of(value: Any, what: str = "the map") -> SavedMap:
    """Take a saved map.

    Raises
    ------
    MapFileError
        For any other object, also for a path or for `MapContents`.
    """
    remedy = "a SavedMap, as from load_map(path) or System.saved_map()"
    return instance_of(value, SavedMap, what, remedy, MapFileError)
