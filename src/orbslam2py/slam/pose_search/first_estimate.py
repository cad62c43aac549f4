# SPDX-License-Identifier: BSD-3-Clause
"""The first estimate of a frame's pose, in a growing map and in a fixed one.

Mur-Artal, Montiel and Tardos, "ORB-SLAM: a Versatile and Accurate Monocular SLAM System", 2015,
sections V-B and V-C; Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-F.
``docs/method/tracking.md#first-estimate``.
"""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.pose_search.search import PoseSearch
from orbslam2py.slam.records import PoseEstimate, Reason
from orbslam2py.slam.state import State


def estimate_in_growing_map(
    search: PoseSearch, frame: core.TrackedFrame, state: State
) -> tuple[PoseEstimate, State]:
    """Use the motion model, then the reference keyframe; if lost, relocalization.

    Parameters
    ----------
    search : PoseSearch
        The methods.
    frame : orbslam2py._core.TrackedFrame
        The frame.
    state : State
        The state before it.

    Returns
    -------
    PoseEstimate
        Found or not.
    State
        The state after it follows the map, and after relocalization.
    """
    relocalized = PoseEstimate()
    if state.is_lost:
        relocalized, state = search.by_relocalization(frame, state)
        if relocalized.found or state.motion.last_frame is None:
            return relocalized, state
    state = state.following(search.map)
    # There is none right after a relocalization, but where a map has just begun.
    if state.motion.velocity is not None:
        estimate = search.by_motion_model(frame, state)
        if estimate.found:
            return estimate, state
    estimate = search.by_keyframes(frame, state)
    if state.motion.prediction_covariance is not None and not estimate.found:
        estimate = search.near_prediction(frame, state)
    if estimate.found:
        return estimate, state
    if state.is_lost:
        return estimate.failed(relocalized.reason), state
    if state.has_just_begun(frame.id, search.limits):
        # Relocalized at the border of the map, the frame before shows most of this one.
        standing = search.by_motion_model(frame, state)
        if standing.found:
            return standing, state
    return estimate, state


def estimate_in_fixed_map(
    search: PoseSearch, frame: core.TrackedFrame, state: State
) -> tuple[PoseEstimate, State]:
    """Use the motion model or the reference keyframe, also outside the map.

    Outside, the pose depends on the depths of the last frame (visual odometry), and every frame is
    also searched in the map. Parameters and results are those of `estimate_in_growing_map`.
    """
    if state.is_lost:
        return search.by_relocalization(frame, state)
    state = state.following(search.map)
    if state.beyond_map:
        estimate, state = _back_into_the_map(search, frame, state)
    elif state.motion.velocity is not None:
        estimate = _by_motion_model(search, frame, state)
    else:
        estimate = search.by_keyframes(frame, state)
    left_map = estimate.visual_odometry and not state.beyond_map
    return replace(estimate, left_map=left_map), state


def _by_motion_model(search: PoseSearch, frame: core.TrackedFrame, state: State) -> PoseEstimate:
    limits = search.limits
    estimate = search.by_motion_model(frame, state, beyond_the_map=search.has_depth)
    if not estimate.found or estimate.n_inliers <= limits.localization_matches:
        return estimate.failed(Reason.FEW_MATCHES_LAST_FRAME)
    beyond = core.count_map_points(frame) < limits.map_matches
    return replace(estimate, visual_odometry=beyond)


def _back_into_the_map(
    search: PoseSearch, frame: core.TrackedFrame, state: State
) -> tuple[PoseEstimate, State]:
    """Continue visual odometry, unless the frame is found in the map."""
    odometry = PoseEstimate(Reason.FEW_MATCHES_LAST_FRAME)
    if state.motion.velocity is not None:
        odometry = _by_motion_model(search, frame, state)
        if odometry.found and not odometry.visual_odometry:
            return odometry, state
    found = core.TrackedFrame(frame.features)
    relocalized, state = search.by_relocalization(found, state)
    if not relocalized.found or found.T_cw is None:
        return odometry, state
    # The drift of visual odometry ends here. It is no motion: the last frame is corrected, too.
    motion, T_lw = state.motion, None
    followed = odometry.found and found.map_index == frame.map_index
    if followed and frame.T_cw is not None and motion.last.T_cw is not None:
        T_lw = motion.last.T_cw @ frame.T_cw.inverse() @ found.T_cw
    frame.take_over(found)
    return relocalized, replace(state, motion=motion.jumped(T_lw))
