# SPDX-License-Identifier: BSD-3-Clause
"""What tracking says about each image."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arrays import EqualByValue, FloatArray, IntArray


class TrackingState(enum.IntEnum):
    """State of the tracker after an image."""

    NO_IMAGES_YET = 0
    NOT_INITIALIZED = 1
    OK = 2
    LOST = 3


class Reason(str, enum.Enum):
    """Why there is no pose."""

    NONE = ""
    TOO_FEW_KEYPOINTS = "too few keypoints"
    TOO_FEW_DEPTHS = "too few keypoints with depth"
    FIRST_VIEW = "first of two views taken; waiting for the camera to move"
    FEW_MATCHES_FIRST_VIEW = "too few matches with the first view"
    LOW_PARALLAX = "low parallax between the two views"
    AMBIGUOUS_MOTION = "ambiguous motion between the two views"
    DEGENERATE_VIEWS = "degenerate views: planar scene, pure rotation or wrong matches"
    NO_THIRD_VIEW = "no third view agrees with the two that were chosen"
    INITIAL_MAP_FAILED = "the first map was too small or had no depth"
    NOT_FOUND_IN_MAP = "not found in the map"
    SEVERAL_PLACES = "looks like several places of the map"
    NOT_CONFIRMED = "found again, but not confirmed by the next image"
    SEARCHING_LOADED_MAP = "searching the loaded map"
    FEW_MATCHES_LAST_FRAME = "too few matches with the last frame"
    FEW_MATCHES_REFERENCE = "too few matches with the reference keyframe"
    FEW_INLIERS_REFERENCE = "too few inliers from the reference keyframe"
    FEW_INLIERS_LOCAL_MAP = "too few inliers in the local map"
    WEAK_EVIDENCE = "the pose found explains too little of what should be seen"
    #: Only in results of earlier versions.
    MAP_CONTRADICTED = "the images since the map began contradict it"

    def __str__(self) -> str:
        return self.value


class Verdict(str, enum.Enum):
    """Whether a pose is believed, by its evidence."""

    STRONG = "strong"
    """As much of what should be seen was found as in the frames before."""
    WEAK = "weak"
    """Believed, but much less was found: such a frame brings nothing into the map."""
    REFUSED = "refused"
    """Not believed: the frame is lost."""

    def __str__(self) -> str:
        return self.value


class PoseMethod(str, enum.Enum):
    """What found a pose."""

    MOTION_MODEL = "motion model"
    REFERENCE_KEYFRAME = "reference keyframe"
    RELOCALIZATION = "relocalization"
    ALIGNED_IMAGES = "aligned images"
    KEYFRAMES_AROUND = "keyframes around"
    WIDE_WINDOW = "wide window"
    ALL_KEYPOINTS = "all keypoints"
    NEAR_PREDICTION = "near prediction"
    #: Predicted by the IMU; no image supports it.
    IMU = "imu"

    def __str__(self) -> str:
        return self.value


@dataclass(frozen=True)
class Evidence:
    """What speaks for a pose.

    "Usual" is a running mean over the frames before whose evidence was strong; ratios to it are 1
    where there were none.
    """

    verdict: Verdict
    method: PoseMethod
    """What found the pose."""
    doubted: bool
    """The evidence of the pose that was found first fell so suddenly that it was searched by other
    ways as well."""
    confirmed: bool
    """Then a second method, which does not begin where this one did, came to the same pose."""
    n_predicted: int
    """Map points that should be in view; in visual odometry, points that the frame before saw."""
    found: float
    """Share of these that were found and accepted, 0 to 1."""
    found_to_usual: float
    """That share by the usual one."""
    inliers_to_usual: float
    """Inliers by their usual number."""
    n_cells: int
    """Cells of the image, of 8 x 6, that hold an inlier."""
    n_octaves: int
    """Octaves of depth (1 to 2, 2 to 4, 4 to 8... of the map's units) that hold an inlier."""
    deviation_to_usual: float
    """Standard deviation of the position by the usual one."""
    match_error: float
    """Median reprojection error of all that was matched, outliers too, in standard deviations of
    the keypoints' positions."""
    error_to_usual: float
    """That error by the usual one."""
    turn_change: float
    """Degrees by which the camera turned otherwise than from the frame before the last to the
    last; 0 where the motion is not known."""
    move_change: float
    """The same for its way, metres (one camera: the map's units)."""


@dataclass(frozen=True, eq=False)
class FrameFeatures(EqualByValue):
    """The keypoints of a frame and what they were matched to (on request)."""

    keypoints: npt.NDArray[np.float32]
    """(n, 2) undistorted pixel coordinates."""
    levels: npt.NDArray[np.int32]
    """(n,) pyramid levels."""
    depths: npt.NDArray[np.float32]
    """(n,) metres, -1 where unknown."""
    map_point_ids: npt.NDArray[np.int64]
    """(n,) id of the matched map point, -1 for none; in a keyframe also of points made from it."""
    inliers: npt.NDArray[np.bool_]
    """(n,) matched and accepted by the pose optimisation: as many as `TrackingRecord.n_inliers`."""
    colours: npt.NDArray[np.uint8]
    """(n, 3) red, green, blue of the image at the keypoints; (0, 3) for a grey image."""


@dataclass(frozen=True, eq=False)
class InertialState(EqualByValue):
    """Velocity and biases at an image, by camera and IMU together."""

    velocity: FloatArray
    """(3,) of the IMU in the world, m/s (one camera: the map's units)."""
    gyro_bias: FloatArray
    """(3,) rad/s."""
    accel_bias: FloatArray
    """(3,) m/s^2."""
    gravity_tilt: float
    """Angle between gravity and the vertical of the map, rad."""
    gravity_deviation: float
    """Standard deviation of that angle, rad."""
    innovation: float | None
    """Squared Mahalanobis distance of the image's pose from the predicted one (6 degrees of
    freedom); None where the image gave no pose."""


@dataclass(frozen=True, eq=False)
class TrackingRecord(EqualByValue):
    """Result of one track call; two are equal if all fields are, arrays number by number."""

    frame_id: int
    """Number of the image since the last reset, from 0. When a single camera's young map comes to
    nothing, the count goes on: its images serve the next map."""
    timestamp: float
    """Seconds, as given by the caller."""
    map_index: int
    """The map that the pose is in: 0 for the first one; every map that begins has the next number,
    also after a reset and after a start of a single camera that failed. Without a pose: the map in
    which tracking was lost."""
    state: TrackingState
    reason: Reason
    """Why there is no pose (`Reason.NONE` if there is one)."""
    T_cw: FloatArray | None
    """(4, 4) world to camera, None unless the state is OK."""
    covariance: FloatArray | None
    """(6, 6) covariance of the pose: rotation [rad], then translation [m] (one camera: the map's
    own units), left perturbation in the camera frame, scaled by the residual variance."""
    n_matches: int
    """Keypoints matched to map points before the last pose optimisation."""
    n_inliers: int
    """Of these, accepted by it."""
    is_keyframe: bool
    reference_keyframe: int
    """Keyframe that shares most points with the frame, -1 for none."""
    visual_odometry: bool = False
    """In localization mode: outside the map, the pose hangs on the depths of the frame before."""
    unconfirmed: bool = False
    """Found again in this image: the next one has to confirm it before the map grows."""
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Time per stage: wait, extract, stereo, predict, local_map, keyframe, track (all of it)."""
    features: FrameFeatures | None = None
    evidence: Evidence | None = None
    """What speaks for the pose, or, if the reason is `Reason.WEAK_EVIDENCE`, spoke against it; None
    where no pose was found, and in the frame that begins a map."""
    method: PoseMethod | None = None
    """What found the pose; `PoseMethod.IMU`: the IMU alone, for the image shows too little. None
    without a pose, and in the frame that begins a map."""
    inertial: InertialState | None = None
    """Velocity and biases; None where the IMU is not used."""

    @property
    def T_wc(self) -> FloatArray | None:
        """(4, 4) camera to world: position and orientation of the camera, or None."""
        if self.T_cw is None:
            return None
        T_wc = np.eye(4)
        T_wc[:3, :3] = self.T_cw[:3, :3].T
        T_wc[:3, 3] = -self.T_cw[:3, :3].T @ self.T_cw[:3, 3]
        return T_wc


@dataclass(frozen=True)
class MapSummary:
    """One of the maps that a system holds."""

    map_index: int
    """As in `TrackingRecord.map_index`: older maps have lower numbers."""
    active: bool
    """New keyframes belong to it; the others rest."""
    n_keyframes: int
    n_map_points: int


# ---- inside the pipeline ---------------------------------------------------------------------
def _nothing() -> IntArray:
    return np.zeros(0, np.int64)


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """What one step of tracking found out about a frame's pose.

    If it was found, the frame holds pose and associations. A step that fails leaves them
    undefined: the next one begins anew.
    """

    reason: Reason = Reason.NONE
    """Why there is no pose."""
    n_matches: int = 0
    """Keypoints matched to map points before the pose was optimised."""
    n_inliers: int = 0
    """Of these, accepted by the optimisation."""
    covariance: FloatArray | None = None
    """(6, 6), see `TrackingRecord.covariance`."""
    discarded: IntArray = field(default_factory=_nothing)
    """Ids of the points that were matched and thrown out as outliers, ascending."""
    visual_odometry: bool = False
    """The pose hangs on the depths of the frame before more than on the map."""
    left_map: bool = False
    """The frame before was in the map, and this one is not."""
    relocalized: bool = False
    """Found without a guess from the frame before."""
    method: PoseMethod = PoseMethod.MOTION_MODEL
    """What found it."""
    evidence: Evidence | None = None
    """See `TrackingRecord.evidence`."""
    by_image: core.Pose | None = None
    """``T_cw`` by the image alone, where the pose is that of image and IMU together."""
    unconfirmed: bool = False
    """Found again, and not yet confirmed by the next frame."""

    @property
    def found(self) -> bool:
        """Whether there is a pose."""
        return self.reason is Reason.NONE

    def failed(self, reason: Reason) -> PoseEstimate:
        """The same, but not believed."""
        return replace(self, reason=reason)


@dataclass(frozen=True, eq=False)
class TrackingResult:
    """What tracking one frame gave."""

    state: TrackingState
    estimate: PoseEstimate
    is_keyframe: bool = False
    given_up: int | None = None
    """Number of a map that was lost so soon, or is so wrong, that it is better to begin another."""
    earlier: tuple[core.TrackedFrame, ...] = ()
    """Frames before this one that have found their poses now that there is a map, in order."""
    inliers: npt.NDArray[np.bool_] | None = None
    """(n,) keypoints that the pose was accepted with; None unless details were asked for."""
    begins_map: bool = False
    """The frame is the first one of a map."""
