# SPDX-License-Identifier: BSD-3-Clause
"""Everything that a map is, as arrays: what map files, exports and edits of a map work on.

Ids ascend and are never reused in one map. ``T_ab`` maps coordinates of frame b into frame a; the
world is the camera frame of keyframe 0 when it was made. Lengths are metres, with a single camera
the map's own unit. Pixels: the centre of the top-left pixel is (0, 0).
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    poses_from,
    quaternions_from_rotations,
    rotations_from_quaternions,
)

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
BoolArray = NDArray[np.bool_]

_Group = TypeVar("_Group", bound="_ArrayGroup")


class _ArrayGroup:
    """Arrays that belong together; compared by content."""

    def arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """Names and arrays, in the order in which they are declared."""
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            yield field.name, getattr(self, field.name)


@dataclass(frozen=True, eq=False)
class Cameras(_ArrayGroup):
    """The cameras that keyframes were seen with: (c,) entries each, one as a rule."""

    fx: FloatArray
    """Focal length [px]."""
    fy: FloatArray
    cx: FloatArray
    """Principal point [px]."""
    cy: FloatArray
    distortion: FloatArray
    """(c, 5): k1, k2, p1, p2, k3; zeros when the images are rectified."""
    bf: FloatArray
    """Baseline times fx [px m]; 0 with a single camera."""
    depth_ratio: FloatArray
    """Depths up to so many baselines are close; 0 with a single camera."""
    width: IntArray
    """Of the images [px]."""
    height: IntArray
    scale_factor: Float32Array
    """Between the levels of the image pyramid."""
    n_levels: IntArray

    def __len__(self) -> int:
        return len(self.fx)


@dataclass(frozen=True, eq=False)
class Keyframes(_ArrayGroup):
    """Keyframes by ascending id: (k,) entries each, then (n,) keypoints of all of them.

    The keypoints of keyframe i are entries ``offsets[i]:offsets[i + 1]`` (`keypoints_of`).
    """

    ids: IntArray
    """(k,) ascending; keyframe 0 is always there and is the root of the spanning tree."""
    frame_ids: IntArray
    """(k,) number of the image that became the keyframe, in the run that made it."""
    timestamps: FloatArray
    """(k,) seconds."""
    camera: IntArray
    """(k,) rows of `Cameras`."""
    rotations: FloatArray
    """(k, 4) unit quaternions x, y, z, w of `T_cw`."""
    translations: FloatArray
    """(k, 3) of `T_cw`: the world's origin in the camera."""
    scale: FloatArray
    """(k,) by how much lengths around the keyframe have been multiplied since it was made."""
    parent: IntArray
    """(k,) ids in the spanning tree, -1 for keyframe 0."""
    provisional_parent: BoolArray
    """(k,) the parent is the keyframe before, for want of a neighbour."""
    processed: BoolArray
    """(k,) local mapping has taken it in."""
    has_colours: BoolArray
    """(k,) `colours` are known."""
    offsets: IntArray
    """(k + 1,) into the arrays below."""
    keypoints: Float32Array
    """(n, 2) undistorted pixels x, y."""
    raw_keypoints: Float32Array
    """(n, 2) pixels of the images as given; (0, 2) when no camera's lens distorts."""
    octave: ByteArray
    """(n,) level of the image pyramid."""
    angle: Float32Array
    """(n,) degrees in [0, 360), clockwise."""
    response: Float32Array
    """(n,) FAST score."""
    descriptors: ByteArray
    """(n, 32) ORB."""
    depth: Float32Array
    """(n,) along the optical axis [m]; -1 unknown."""
    right_u: Float32Array
    """(n,) column in the (virtual) right image [px]; -1 where the depth is unknown."""
    colours: ByteArray
    """(n, 3) RGB of the image there, 0 where unknown; (0, 3) when no keyframe has any."""

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def T_cw(self) -> FloatArray:
        """(k, 4, 4) world to camera."""
        return poses_from(rotations_from_quaternions(self.rotations), self.translations)

    @cached_property
    def T_wc(self) -> FloatArray:
        """(k, 4, 4) camera to world."""
        return inverse_poses(self.T_cw)

    def with_poses(self, T_cw: FloatArray) -> Keyframes:
        """Return the same keyframes at other poses.

        Parameters
        ----------
        T_cw
            (k, 4, 4) world to camera.
        """
        return dataclasses.replace(
            self,
            rotations=quaternions_from_rotations(T_cw[:, :3, :3]),
            translations=T_cw[:, :3, 3].copy(),
        )

    def row_of(self, keyframe_id: int) -> int:
        """Return the row of a keyframe in the arrays.

        Raises
        ------
        KeyError
            If the map has no such keyframe.
        """
        return _row_of(self.ids, keyframe_id, "keyframe")

    def keypoints_of(self, row: int) -> slice:
        """Return where the keypoints of the keyframe in this row are."""
        return slice(int(self.offsets[row]), int(self.offsets[row + 1]))


@dataclass(frozen=True, eq=False)
class Points(_ArrayGroup):
    """Map points by ascending id: (p,) entries each."""

    ids: IntArray
    positions: FloatArray
    """(p, 3) world."""
    mean_directions: FloatArray
    """(p, 3) mean of the unit vectors from the observing cameras to the point; length <= 1."""
    min_distance: FloatArray
    """(p,) from which the point would appear on the coarsest level of the pyramid."""
    max_distance: FloatArray
    """(p,) from which it would appear on the finest."""
    descriptors: ByteArray
    """(p, 32) the representative one of those observed."""
    n_visible: Int32Array
    """(p,) frames in whose view the point lay."""
    n_found: Int32Array
    """(p,) of these, frames that matched it."""
    reference_keyframe: IntArray
    """(p,) id of the observer that gives the distances."""
    first_keyframe: IntArray
    """(p,) id of the keyframe that made it, which may have been removed since."""
    first_frame: IntArray
    """(p,) number of that image in the run that made it."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class Observations(_ArrayGroup):
    """Who sees what: (o,) entries each, by ascending (point, keyframe)."""

    point: IntArray
    """(o,) ids."""
    keyframe: IntArray
    """(o,) ids."""
    keypoint: Int32Array
    """(o,) number of the keypoint in its keyframe, from 0."""

    def __len__(self) -> int:
        return len(self.point)


@dataclass(frozen=True, eq=False)
class Covisibility(_ArrayGroup):
    """Pairs of keyframes that share points: (e,) entries each, by ascending (a, b), a < b."""

    a: IntArray
    """(e,) ids."""
    b: IntArray
    """(e,) ids."""
    weight: Int32Array
    """(e,) shared points, as last counted; at least 1."""

    def __len__(self) -> int:
        return len(self.a)


@dataclass(frozen=True, eq=False)
class RemovedKeyframes(_ArrayGroup):
    """Where culled keyframes were, relative to others: frames tracked in them hang on that."""

    ids: IntArray
    """(r,) ascending."""
    parent: IntArray
    """(r,) ids of keyframes that live or were removed later."""
    rotations: FloatArray
    """(r, 4) unit quaternions x, y, z, w of the parent's camera to the keyframe's."""
    translations: FloatArray
    """(r, 3) of the same transform."""
    scale: FloatArray
    """(r,) `Keyframes.scale` at that time."""
    parent_scale: FloatArray
    """(r,) the same of the parent."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class MapContents:
    """Everything that a map is, of one moment; arrays are not to be changed.

    Examples
    --------
    >>> contents = slam.map_contents()  # doctest: +SKIP
    >>> contents.keyframes.T_wc[:, :3, 3]  # where the keyframes' cameras are
    """

    map_index: int
    """Which map of the system it is, from 0."""
    next_keyframe: int
    """Id of the next keyframe; those before it that are not in `keyframes` have been removed."""
    next_point: int
    """Id of the next point."""
    cameras: Cameras
    keyframes: Keyframes
    removed_keyframes: RemovedKeyframes
    points: Points
    observations: Observations
    covisibility: Covisibility
    loop_edges: IntArray
    """(l, 2) ids of keyframes that a closed loop connects, ascending, the lower one first."""

    def observations_of_point(self, point_id: int) -> tuple[IntArray, Int32Array]:
        """Return who sees a point.

        Returns
        -------
        keyframes, keypoints
            Ids (m,), and numbers of the keypoints there (m,); empty for an unknown point.
        """
        first, last = np.searchsorted(self.observations.point, [point_id, point_id + 1])
        return self.observations.keyframe[first:last], self.observations.keypoint[first:last]

    def observations_in_keyframe(self, keyframe_id: int) -> tuple[IntArray, Int32Array]:
        """Return what a keyframe sees.

        Returns
        -------
        points, keypoints
            Ids (m,) ascending, and numbers of the keypoints (m,); empty for an unknown keyframe.
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
        """Return the points' colours, each the mean of what its keyframes see.

        Returns
        -------
        array of uint8 (p, 3) or None
            RGB; mid grey for a point of which no keyframe knows a colour. None when no keyframe
            has colours.
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

    def arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """All arrays with their names (``"points.positions"``), in a fixed order."""
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, _ArrayGroup):
                for name, array in value.arrays():
                    yield f"{field.name}.{name}", array
            elif isinstance(value, np.ndarray):
                yield field.name, value

    def as_dict(self) -> dict[str, Any]:
        """All arrays and numbers by name, as the C++ core takes them."""
        numbers = {
            "map_index": self.map_index,
            "next_keyframe": self.next_keyframe,
            "next_point": self.next_point,
        }
        return {**numbers, **dict(self.arrays())}

    def first_difference(self, other: MapContents) -> str | None:
        """Name the first array in which two maps differ, bit by bit; None if they are equal.

        `map_index` says which map of a run it was, not what is in it, and is not compared.
        """
        for name in ("next_keyframe", "next_point"):
            if getattr(self, name) != getattr(other, name):
                return name
        for (name, mine), (_, theirs) in zip(self.arrays(), other.arrays(), strict=True):
            if mine.dtype != theirs.dtype or mine.shape != theirs.shape:
                return name
            if mine.tobytes() != theirs.tobytes():
                return name
        return None

    def content_hash(self) -> str:
        """SHA-256 over everything but `map_index`: equal for equal maps, bit by bit."""
        digest = hashlib.sha256(f"{self.next_keyframe} {self.next_point}".encode())
        for name, array in self.arrays():
            digest.update(f"\n{name} {array.dtype.str} {array.shape}\n".encode())
            digest.update(np.ascontiguousarray(array).data)
        return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class ChangedContents:
    """What may have changed in a map since an earlier copy of it, for who keeps a file of it."""

    contents: MapContents
    """All but the keypoints that were known, and the points on pages without a change."""
    keyframe_stamp: int
    """Of the last change of a keyframe ..."""
    point_stamp: int
    """... and of a point."""
    changed_keyframes: BoolArray
    """(k,) pose, parent, weights or something else has changed."""
    pages: IntArray
    """(m,) of `IDS_PER_PAGE` ids each: points on other pages have not changed."""
    incomplete_pages: IntArray
    """(i,) of these, those with points whose keyframes mapping has not taken in yet."""


def take_contents(slam_map: core.Map) -> MapContents:
    """Copy everything of a map, as of one moment, while the system may be running.

    Keyframes that local mapping has not taken in yet, and what only they see, are not part of it.

    Parameters
    ----------
    slam_map
        The map.
    """
    return take_changes(slam_map, np.zeros(0, np.int64), None).contents


def take_changes(
    slam_map: core.Map, known_keyframes: IntArray, before: ChangedContents | None
) -> ChangedContents:
    """Copy what may have changed in a map since an earlier copy, but for the tracker's counters.

    Parameters
    ----------
    slam_map
        The map.
    known_keyframes
        Ids (m,), ascending, of keyframes whose keypoints, which never change, are left out.
    before
        The earlier copy, of the same map (`MapContents.map_index`); None: there is none.
    """
    since: dict[str, Any] = {}
    if before is not None:
        since = {
            "keyframe_stamp": before.keyframe_stamp,
            "point_stamp": before.point_stamp,
            "incomplete_pages": before.incomplete_pages,
        }
    arrays = core.map_contents(slam_map, known_keyframes, **since)
    groups: dict[str, dict[str, Any]] = {}
    for name, array in arrays.items():
        group, _, field = name.rpartition(".")
        groups.setdefault(group, {})[field] = array
    contents = MapContents(
        **groups[""],
        cameras=Cameras(**groups["cameras"]),
        keyframes=Keyframes(**groups["keyframes"]),
        removed_keyframes=RemovedKeyframes(**groups["removed_keyframes"]),
        points=Points(**groups["points"]),
        observations=Observations(**groups["observations"]),
        covisibility=Covisibility(**groups["covisibility"]),
    )
    return ChangedContents(contents, **groups["known"])


def restore_contents(
    contents: MapContents,
    slam_map: core.Map | None = None,
    vocabulary: core.Vocabulary | None = None,
    index: core.KeyFrameIndex | None = None,
) -> core.Map:
    """Make a map of its contents.

    Parameters
    ----------
    contents
        Everything that the map is.
    slam_map
        An empty map to fill; a new one by default.
    vocabulary
        Describes the keyframes by words, which recognising places needs.
    index
        Gets the keyframes, once they are described.

    Raises
    ------
    MapFileError
        If the contents are impossible; names the thing. Nothing was changed then.
    """
    if slam_map is None:
        slam_map = core.Map()
    core.restore_map(slam_map, contents.as_dict(), vocabulary, index)
    return slam_map


def _row_of(ids: IntArray, wanted: int, what: str) -> int:
    row = int(np.searchsorted(ids, wanted))
    if row == len(ids) or ids[row] != wanted:
        raise KeyError(f"the map has no {what} {wanted}")
    return row
