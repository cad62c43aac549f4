# SPDX-License-Identifier: BSD-3-Clause
"""Frames that are tracked by the patches of known points, without features.

``docs/method/alignment.md#frames-without-features``; C. Forster et al., "SVO: Semidirect Visual
Odometry for Monocular and Multicamera Systems", IEEE T-RO 2017, sections IV and V.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.records import PoseEstimate, PoseMethod
from orbslam2py.slam.state import State

#: Share of the points that must stay in view, as of a single camera's keyframes; share of these
#: that must be found; and the fewest points, as of a relocalization.
_IN_VIEW, _FOUND, _FEWEST = 0.9, 0.6, 50


class FollowedFrames:
    """Finds the points of the last frame with features by their patches.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    front_end : FrontEnd
        Builds the frames.
    fewest_keyframes : int
        In smaller maps frames need features.
    """

    def __init__(self, slam_map: core.Map, front_end: FrontEnd, fewest_keyframes: int) -> None:
        self._map = slam_map
        self._front_end = front_end
        self._fewest_keyframes = fewest_keyframes
        self._earlier: core.TrackedFrame | None = None

    def note(self, frame: core.TrackedFrame | None) -> None:
        """Take a frame with features, whose points the next ones show; None: they need features."""
        self._earlier = frame

    def follow(
        self,
        image: ByteArray,
        depth: ByteArray | None,
        frame_id: int,
        timestamp: float,
        state: State,
    ) -> tuple[core.TrackedFrame, PoseEstimate, State] | None:
        """Find the pose of a frame without features.

        Parameters
        ----------
        image, depth
            Of the frame; no depth with a single camera.
        frame_id, timestamp
            Number and time [s] of the frame.
        state : State
            The state before the frame.

        Returns
        -------
        tuple or None
            The frame with its pose, the estimate, and the state, which follows the map; None where
            features are needed.
        """
        earlier = self._earlier
        if earlier is None or state.is_lost or state.is_scarce or state.motion.velocity is None:
            return None
        if self._map.n_keyframes_of(self._map.active_map) < self._fewest_keyframes:
            return None
        state = state.following(self._map)
        last, velocity = state.motion.last, state.motion.velocity
        if last.T_cw is None or velocity is None or earlier.big_change != last.big_change:
            return None
        predicted = velocity.over(timestamp - last.timestamp) @ last.T_cw

        def found_in(context: core.FrameContext, grey: ByteArray) -> core.FollowedPoints | None:
            points = core.follow_points(self._map, context, earlier, predicted, grey)
            in_view = points.n_in_view
            enough = in_view >= max(_FEWEST, _IN_VIEW * points.n_patches)
            found = len(points) >= _FOUND * in_view
            return points if enough and found and points.T_cw is not None else None

        found = self._front_end.without_features(image, depth, frame_id, timestamp, found_in)
        if found is None:
            return None
        points, features = found
        frame = core.TrackedFrame(features)
        core.associate_followed(self._map, frame, points)
        frame.share_anchor(last)
        optimized = core.optimize_pose(frame)
        if optimized.n_inliers < _FOUND * points.n_in_view:
            return None
        frame.discard_outliers()
        estimate = PoseEstimate(
            n_matches=len(points),
            n_inliers=optimized.n_inliers,
            covariance=optimized.covariance,
            method=PoseMethod.PATCHES,
        )
        return frame, estimate, state
