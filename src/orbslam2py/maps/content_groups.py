# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a map as groups of arrays: keyframes, points and observations.

Ids ascend and are never reused in one map. ``T_ab`` maps coordinates of frame b into frame a. The
world of a map is the first camera frame of its root keyframe. Lengths are metres, with a single
camera the map's own unit. Pixels: the centre of the top-left pixel is (0, 0).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py import _core
from orbslam2py._arguments import shown
from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py.errors import MapFileError
from orbslam2py.maps.schema import PATCH_SIZE
from orbslam2py.settings.camera_model import CameraModel
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    poses_from,
    quaternions_from_rotations,
    rotations_from_quaternions,
)

Float32Array = NDArray[np.float32]
Int32Array = NDArray[np.int32]
BoolArray = NDArray[np.bool_]
WordArray = NDArray[np.uint32]


class ArrayGroup:
    """Arrays of one group; compared by content."""

    def arrays(self) -> Iterator[tuple[str, NDArray[Any]]]:
        """Names and arrays, in the order in which they are declared."""
        for field in dataclasses.fields(self):  # type: ignore[arg-type]
            yield field.name, getattr(self, field.name)


#: Numbers that `Cameras.mount` has of a camera.
MOUNT_SIZE = 12
#: Where `Cameras.lens` has the centre of the right camera of a fisheye pair.
RIGHT_CENTRE = slice(13, 16)


@dataclass(frozen=True, eq=False)
class Cameras(ArrayGroup):
    """The cameras of the keyframes: (c,) entries each, usually one."""

    fx: FloatArray
    """Focal length [px]."""
    fy: FloatArray
    cx: FloatArray
    """Principal point [px]."""
    cy: FloatArray
    distortion: FloatArray
    """(c, 8): k1, k2, p1, p2, k3, k4, k5, k6; zeros if the images are rectified."""
    bf: FloatArray
    """Baseline times fx [px m]; 0 with a single camera."""
    depth_ratio: FloatArray
    """Largest close depth, in baselines; 0 with a single camera."""
    width: IntArray
    """Of the images [px]."""
    height: IntArray
    scale_factor: Float32Array
    """Factor between the levels of the image pyramid."""
    n_levels: IntArray
    model: IntArray
    """For a fisheye lens the number of its camera model in the list of models, from 1; 0 for a
    pinhole. `camera_model` gives the model itself."""
    lens: FloatArray
    """(c, 16) parameters of that model, zeros after the last one. The last three are the centre of
    the right camera of a fisheye pair in the frame of the left one [m], zeros if there is none."""
    mount: FloatArray = dataclasses.field(default_factory=lambda: np.zeros((0, MOUNT_SIZE)))
    """(c, 12) of the cameras of rigs, which follow all others: the row of their rig, 1 if their
    keypoints are used, camera to body as quaternion x, y, z, w and translation [m], and the centre
    of the camera that gives them depths [m]. Of other cameras and of rigs -1 and zeros, which
    an empty array becomes."""

    def __post_init__(self) -> None:
        if not len(self.mount):
            object.__setattr__(self, "mount", no_mounts(len(self)))

    def __len__(self) -> int:
        return len(self.fx)

    def scaled(self, scale: float) -> Cameras:
        """Return the cameras with lengths in another unit: one of them is `scale` new ones."""
        lens = self.lens.copy()
        # No model of a fisheye pair has so many parameters.
        parameters = [len(one) for _, _, one in _core.camera_models()]
        pairs = [n > 0 and parameters[n - 1] <= RIGHT_CENTRE.start for n in self.model.tolist()]
        lens[pairs, RIGHT_CENTRE] *= scale
        mount = self.mount.copy()
        mount[:, 6:] *= scale
        return replace(self, bf=scale * self.bf, lens=lens, mount=mount)

    @property
    def has_rigs(self) -> bool:
        """Whether keyframes have several cameras, whose images lie side by side in one plane."""
        return bool((self.mount[:, 0] >= 0).any())

    def rig(self, row: int) -> _core.Camera | None:
        """Return the cameras of a rig as one of the core; None for a single camera."""
        rows = np.flatnonzero(self.mount[:, 0] == row).tolist()
        if not rows:
            return None
        cameras, poses = [], []
        for own in rows:
            lens: dict[str, Any] = {}
            model = self.camera_model(own)
            if model is not None:
                lens["model"] = model.core
            cameras.append(
                _core.Camera(
                    _core.CameraOptions(
                        fx=self.fx[own],
                        fy=self.fy[own],
                        cx=self.cx[own],
                        cy=self.cy[own],
                        width=int(self.width[own]),
                        height=int(self.height[own]),
                        distortion=self.distortion[own].tolist(),
                        bf=self.bf[own],
                        depth_ratio=self.depth_ratio[own],
                        **lens,
                    )
                )
            )
            poses.append(_core.Pose(self.mount[own, 2:6], self.mount[own, 6:9]))
        return _core.Camera.rig(cameras, poses, [True] * len(rows))

    def camera_model(self, row: int) -> CameraModel | None:
        """Return the model of a fisheye lens, or None for a pinhole."""
        number = int(self.model[row])
        if number == 0:
            return None
        name, _, parameters = _core.camera_models()[number - 1]
        size = (int(self.width[row]), int(self.height[row]))
        return CameraModel(name, self.lens[row, : len(parameters)], size)


def no_mounts(n: int) -> FloatArray:
    """Return `Cameras.mount` of cameras that belong to no rig."""
    mounts = np.zeros((n, MOUNT_SIZE))
    mounts[:, 0] = -1
    return mounts


#: Numbers that a map file keeps of a camera model.
LENS_SIZE = 16


def model_name_of(number: int) -> str:
    """Return the name of a camera model by its number in `Cameras.model`; empty for 0."""
    return _core.camera_models()[number - 1][0] if number else ""


def model_number_of(name: str) -> int:
    """Return the number of a camera model by its name.

    Raises
    ------
    MapFileError
        If there is no such model.
    """
    if not name:
        return 0
    names = [known for known, _, _ in _core.camera_models()]
    if name not in names:
        raise MapFileError(
            f"the map has a camera of the model {shown(name)}, which this version does not know; "
            "install the version that wrote the file, or a later one"
        )
    return names.index(name) + 1


@dataclass(frozen=True, eq=False)
class Keyframes(ArrayGroup):
    """Keyframes by ascending id: (k,) entries each, then (n,) keypoints of all of them.

    The keypoints of keyframe i are entries ``offsets[i]:offsets[i + 1]`` (`keypoints_of`).
    """

    ids: IntArray
    """(k,) ascending; keyframes without a parent are the roots of maps, usually only keyframe 0."""
    frame_ids: IntArray
    """(k,) number of the image that became the keyframe, in its run."""
    timestamps: FloatArray
    """(k,) seconds."""
    camera: IntArray
    """(k,) rows of `Cameras`."""
    rotations: FloatArray
    """(k, 4) unit quaternions x, y, z, w of `T_cw`."""
    translations: FloatArray
    """(k, 3) of `T_cw`: the world's origin in the camera."""
    scale: FloatArray
    """(k,) factor by which lengths around the keyframe have been multiplied since its creation."""
    parent: IntArray
    """(k,) ids in the spanning tree, -1 for the root of a map."""
    provisional_parent: BoolArray
    """(k,) whether the parent is the previous keyframe, because there was no neighbour."""
    processed: BoolArray
    """(k,) whether local mapping has processed it."""
    has_colours: BoolArray
    """(k,) `colours` are known."""
    offsets: IntArray
    """(k + 1,) offsets into the arrays below."""
    keypoints: Float32Array
    """(n, 2) undistorted pixels x, y."""
    raw_keypoints: Float32Array
    """(n, 2) pixels of the images as given; (0, 2) if no camera has distortion."""
    octave: ByteArray
    """(n,) level of the image pyramid."""
    angle: Float32Array
    """(n,) degrees in [0, 360), clockwise."""
    response: Float32Array
    """(n,) FAST score."""
    descriptors: ByteArray
    """(n, 32) ORB."""
    depth: Float32Array
    """(n,) depth along the optical axis, for a fisheye lens along the ray [m]; -1 if unknown."""
    right_u: Float32Array
    """(n,) column in the (virtual) right image [px]; -1 if the depth is unknown."""
    colours: ByteArray
    """(n, 3) RGB of the image at the keypoint, 0 if unknown; (0, 3) if no keyframe has colours."""
    words: WordArray = dataclasses.field(default_factory=lambda: np.zeros(0, np.uint32))
    """(n,) visual word of the descriptor, 2^32 - 1 for a stopped word; (0,) if not known.
    Descriptor and vocabulary determine it."""

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
        """Return the same keyframes with other poses.

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
        """Return the range of the keypoints of the keyframe in this row."""
        return slice(int(self.offsets[row]), int(self.offsets[row + 1]))


@dataclass(frozen=True, eq=False)
class Points(ArrayGroup):
    """Map points by ascending id: (p,) entries each."""

    ids: IntArray
    positions: FloatArray
    """(p, 3) world."""
    mean_directions: FloatArray
    """(p, 3) mean of the unit vectors from the observing cameras to the point; length <= 1."""
    min_distance: FloatArray
    """(p,) distance at which the point would appear on the coarsest level of the pyramid."""
    max_distance: FloatArray
    """(p,) distance at which it would appear on the finest level."""
    descriptors: ByteArray
    """(p, 32) the most representative descriptor of its observations."""
    n_visible: Int32Array
    """(p,) number of frames in whose view the point was."""
    n_found: Int32Array
    """(p,) number of these frames that matched it."""
    reference_keyframe: IntArray
    """(p,) id of the observing keyframe that determines the distances."""
    first_keyframe: IntArray
    """(p,) id of the keyframe that created it, which may have been removed."""
    first_frame: IntArray
    """(p,) number of the image of this keyframe, in its run."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class Observations(ArrayGroup):
    """Observations: (o,) entries each, by ascending (point, keyframe)."""

    point: IntArray
    """(o,) ids."""
    keyframe: IntArray
    """(o,) ids."""
    keypoint: Int32Array
    """(o,) number of the keypoint in its keyframe, from 0."""

    def __len__(self) -> int:
        return len(self.point)


@dataclass(frozen=True, eq=False)
class Covisibility(ArrayGroup):
    """Pairs of keyframes that share points: (e,) entries each, by ascending (a, b), a < b."""

    a: IntArray
    """(e,) ids."""
    b: IntArray
    """(e,) ids."""
    weight: Int32Array
    """(e,) number of shared points at the last count; at least 1."""

    def __len__(self) -> int:
        return len(self.a)


@dataclass(frozen=True, eq=False)
class RemovedKeyframes(ArrayGroup):
    """Poses of culled keyframes relative to others, for the frames that refer to them."""

    ids: IntArray
    """(r,) ascending."""
    parent: IntArray
    """(r,) ids of the parents: living keyframes, or ones that were removed later."""
    rotations: FloatArray
    """(r, 4) unit quaternions x, y, z, w of the parent's camera to the keyframe's."""
    translations: FloatArray
    """(r, 3) of the same transform."""
    scale: FloatArray
    """(r,) `Keyframes.scale` at the removal."""
    parent_scale: FloatArray
    """(r,) the same of the parent."""

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True, eq=False)
class ImuStates(ArrayGroup):
    """States of the IMU at keyframes: (m,) entries each, then (s,) samples between them.

    The samples from the entry before to entry i are ``offsets[i]:offsets[i + 1]``. They are raw
    ones, because what is integrated of them depends on the biases.
    """

    ids: IntArray
    """(m,) ids of keyframes, ascending."""
    velocity: FloatArray
    """(m, 3) of the IMU, in the axes of the keyframe's camera, in units of the map per second if
    `Keyframes.scale` is `scale`; else it is to be multiplied by the quotient of both."""
    scale: FloatArray
    """(m,) `Keyframes.scale` when the velocity was stored."""
    bias: FloatArray
    """(m, 6) gyro [rad/s], accelerometer [m/s^2]."""
    offsets: IntArray
    """(m + 1,) offsets into `samples`."""
    samples: FloatArray
    """(s, 7) ``[t, gyro, accelerometer]``: seconds on the clock of the images, rad/s, m/s^2, in the
    frame of the IMU. Those of an entry cover the time from the keyframe of the entry before, so
    that the last ones of one entry may be the first ones of the next. An entry has none if samples
    do not join the two keyframes."""

    def __len__(self) -> int:
        return len(self.ids)

    @classmethod
    def none(cls) -> ImuStates:
        """No states."""
        return cls(
            np.zeros(0, np.int64),
            np.zeros((0, 3)),
            np.zeros(0),
            np.zeros((0, 6)),
            np.zeros(1, np.int64),
            np.zeros((0, 7)),
        )


@dataclass(frozen=True, eq=False)
class Patches(ArrayGroup):
    """Patches of points, which sightings are aligned to: (q,) entries each, by ascending point.

    ``docs/method/alignment.md#references``.
    """

    point: IntArray
    """(q,) ids."""
    keyframe: IntArray
    """(q,) ids of the keyframes that they were cut from, living or removed."""
    camera: IntArray
    """(q,) rows of `Cameras`: of these keyframes."""
    level: ByteArray
    """(q,) level of the image pyramid."""
    pixel: Float32Array
    """(q, 2) x, y of the point in the image as given."""
    fraction: Float32Array
    """(q, 2) the point minus the patch's pixel (12, 12), in pixels of the level."""
    values: NDArray[np.uint16]
    """(q, 576) the 24 x 24 pixels row by row: 16 times the smoothed grey value."""

    def __len__(self) -> int:
        return len(self.point)

    @classmethod
    def none(cls) -> Patches:
        """No patches."""
        ids = np.zeros(0, np.int64)
        places = np.zeros((0, 2), np.float32)
        values = np.zeros((0, PATCH_SIZE), np.uint16)
        return cls(ids, ids, ids, np.zeros(0, np.uint8), places, places, values)


@dataclass(frozen=True, eq=False)
class AlignedSightings(ArrayGroup):
    """Sightings that were aligned to patches: (a,) entries each, by ascending (keyframe, keypoint).

    An entry counts as long as the keyframe observes this point with this keypoint.
    """

    keyframe: IntArray
    """(a,) ids."""
    keypoint: Int32Array
    """(a,) number of the keypoint in its keyframe, from 0."""
    point: IntArray
    """(a,) ids."""
    position: Float32Array
    """(a, 2) undistorted pixels x, y."""
    right_u: Float32Array
    """(a,) column in the (virtual) right image [px]."""
    variance: Float32Array
    """(a,) of x and of y [px^2], as the patch says; 0 if alignment failed."""
    right_variance: Float32Array
    """(a,) of the right column [px^2]; 0: it has the noise of the keypoint."""
    reference: BoolArray
    """(a,) whether the patch was cut here."""

    def __len__(self) -> int:
        return len(self.keyframe)

    @classmethod
    def none(cls) -> AlignedSightings:
        """No sightings."""
        ids, numbers = np.zeros(0, np.int64), np.zeros(0, np.float32)
        places = np.zeros((0, 2), np.float32)
        return cls(
            ids, np.zeros(0, np.int32), ids, places, numbers, numbers, numbers, np.zeros(0, bool)
        )


def _row_of(ids: IntArray, wanted: int, what: str) -> int:
    row = int(np.searchsorted(ids, wanted))
    if row == len(ids) or ids[row] != wanted:
        raise KeyError(f"the map has no {what} {wanted}")
    return row
