# SPDX-License-Identifier: BSD-3-Clause
"""All data of a map as arrays, for map files, exports and edits."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import instance_of
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.content_groups import (
    AlignedSightings,
    ArrayGroup,
    Cameras,
    Covisibility,
    ImuStates,
    Int32Array,
    Keyframes,
    Observations,
    Patches,
    Points,
    RemovedKeyframes,
)

#: They follow from the descriptors and the vocabulary.
_WORDS = "keyframes.words"
#: Left out of the hash of a map without them, which is that of before there were any.
_LATER = ("imu_states", "patches", "aligned", "alignment_noise")


@dataclass(frozen=True, eq=False)
class MapContents:
    """All data of a map at one moment; the arrays must not be changed.

    Exports and edits take it. They refuse a `SavedMap`: pass its ``contents``.

    Examples
    --------
    >>> contents = slam.map_contents()  # doctest: +SKIP
    >>> contents.keyframes.T_wc[:, :3, 3]  # where the keyframes' cameras are
    """

    map_index: int
    """Number of the map in the system, from 0."""
    next_keyframe: int
    """Id of the next keyframe; lower ids that are not in `keyframes` have been removed."""
    next_point: int
    """Id of the next point."""
    cameras: Cameras
    keyframes: Keyframes
    removed_keyframes: RemovedKeyframes
    points: Points
    observations: Observations
    covisibility: Covisibility
    loop_edges: IntArray
    """(l, 2) ids of keyframes that a closed loop connects, ascending, the lower id first."""
    metric_roots: tuple[int, ...] = ()
    """First keyframes of single-camera maps whose unit was set to metres, ascending
    (`transform_map`, ``map align``, an IMU); maps of stereo and RGB-D cameras are not listed."""
    upright_roots: tuple[int, ...] = ()
    """First keyframes of maps whose third axis is up and whose unit is the metre, by an IMU,
    ascending."""
    imu_states: ImuStates = field(default_factory=ImuStates.none)
    """What an IMU measured at and between keyframes; none without an IMU."""
    patches: Patches = field(default_factory=Patches.none)
    """What sightings of the points are aligned to."""
    aligned: AlignedSightings = field(default_factory=AlignedSightings.none)
    """Sightings that were aligned to these patches."""
    alignment_noise: FloatArray = field(default_factory=lambda: np.zeros((0, 2)))
    """(2, 2): of positions and of right columns the standard deviation of aligned sightings over
    that of corners, and how often it was measured; (0, 2) if nothing was."""

    def observations_of_point(self, point_id: int) -> tuple[IntArray, Int32Array]:
        """Return the observations of a point.

        Returns
        -------
        keyframes, keypoints
            Ids of keyframes (m,), and numbers of the keypoints in them (m,); empty for an unknown
            point.
        """
        first, last = np.searchsorted(self.observations.point, [point_id, point_id + 1])
        return self.observations.keyframe[first:last], self.observations.keypoint[first:last]

    def observations_in_keyframe(self, keyframe_id: int) -> tuple[IntArray, Int32Array]:
        """Return the observations of a keyframe.

        Returns
        -------
        points, keypoints
            Ids of points (m,) ascending, and numbers of the keypoints (m,); empty for an unknown
            keyframe.
        """
        order, keyframes = self._by_keyframe
        first, last = np.searchsorted(keyframes, [keyframe_id, keyframe_id + 1])
        rows = order[first:last]
        return self.observations.point[rows], self.observations.keypoint[rows]

    @cached_property
    def _by_keyframe(self) -> tuple[IntArray, IntArray]:
        order = np.argsort(self.observations.keyframe, kind="stable")
        return order, self.observations.keyframe[order]

    @cached_property
    def observed_keypoints(self) -> IntArray:
        """(o,) rows in the keypoints' arrays of `keyframes`, one per observation."""
        rows = np.searchsorted(self.keyframes.ids, self.observations.keyframe)
        return self.keyframes.offsets[rows] + self.observations.keypoint

    def point_colours(self) -> ByteArray | None:
        """Return the colours of the points, each the mean over its observations.

        Returns
        -------
        array of uint8 (p, 3) or None
            RGB; mid grey for a point without any colour. None if no keyframe has colours.
        """
        if not len(self.keyframes.colours):
            return None
        rows = np.searchsorted(self.keyframes.ids, self.observations.keyframe)
        known = self.keyframes.has_colours[rows]
        point = np.searchsorted(self.points.ids, self.observations.point[known])
        seen = self.keyframes.colours[self.observed_keypoints[known]]
        n = np.bincount(point, minlength=len(self.points))
        colours = np.full((len(self.points), 3), 128, np.uint8)
        for channel in range(3):
            sums = np.bincount(point, seen[:, channel], len(self.points))
            colours[n > 0, channel] = np.rint(sums[n > 0] / n[n > 0]).astype(np.uint8)
        return colours

    def anchor(self, row: int = 0) -> FloatArray:
        """Return the transform (4, 4) from the world of a map to that of its paths.

        Paths are relative to the first keyframe of their map; an upright map keeps its own world.

        Parameters
        ----------
        row
            Index in `keyframes` of the map's first keyframe.
        """
        is_upright = int(self.keyframes.ids[row]) in self.upright_roots
        return np.eye(4) if is_upright else np.asarray(self.keyframes.T_cw[row])

    def arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """All arrays with their names (``"points.positions"``), in a fixed order."""
        for one in dataclasses.fields(self):
            value = getattr(self, one.name)
            if isinstance(value, ArrayGroup):
                for name, array in value.arrays():
                    yield f"{one.name}.{name}", array
            elif isinstance(value, np.ndarray):
                yield one.name, value

    def as_dict(self) -> dict[str, Any]:
        """All arrays and numbers by name, for the C++ core."""
        numbers = {
            "map_index": self.map_index,
            "next_keyframe": self.next_keyframe,
            "next_point": self.next_point,
        }
        return {**numbers, **dict(self.arrays())}

    def first_difference(self, other: MapContents) -> str | None:
        """Name the first array in which two maps differ, bit by bit; None if they are equal.

        `map_index` is the number of the map in a run, not content, and is not compared. Words are
        compared if both maps have them.
        """
        for name in ("next_keyframe", "next_point", "metric_roots", "upright_roots"):
            if getattr(self, name) != getattr(other, name):
                return name
        for (name, mine), (_, theirs) in zip(self.arrays(), other.arrays(), strict=True):
            if name == _WORDS and not (len(mine) and len(theirs)):
                continue
            if mine.dtype != theirs.dtype or mine.shape != theirs.shape:
                return name
            if mine.tobytes() != theirs.tobytes():
                return name
        return None

    def content_hash(self) -> str:
        """SHA-256 over all but `map_index` and words: equal for maps that are equal bit by bit."""
        digest = hashlib.sha256(f"{self.next_keyframe} {self.next_point}".encode())
        for name, array in self.arrays():
            if name == _WORDS or self._is_missing(name.split(".")[0]):
                continue
            digest.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
            digest.update(np.ascontiguousarray(array).data)
        if self.metric_roots:
            digest.update(f"\nmetric_roots {self.metric_roots}".encode())
        if self.upright_roots:
            digest.update(f"\nupright_roots {self.upright_roots}".encode())
        return digest.hexdigest()

    def _is_missing(self, group: str) -> bool:
        return group in _LATER and not len(getattr(self, group))

    def without_patches(self) -> MapContents:
        """Return the map without patches, and without the sightings that were aligned to them."""
        return dataclasses.replace(
            self,
            patches=Patches.none(),
            aligned=AlignedSightings.none(),
            alignment_noise=np.zeros((0, 2)),
        )


def contents_of(value: Any) -> MapContents:
    """Check that an object is the contents of a map.

    Raises
    ------
    MapFileError
        For any other object, also for a `SavedMap`, which has contents.
    """
    remedy = "its MapContents: saved.contents of saved = load_map(path)"
    return instance_of(value, MapContents, "the map", remedy, MapFileError)
