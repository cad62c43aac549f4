# SPDX-License-Identifier: BSD-3-Clause
"""Limits of tracking, and what tracking one frame gives."""

from __future__ import annotations

from dataclasses import dataclass

from orbslam2py.slam.records import FloatArray, Reason, TrackingState


@dataclass(frozen=True)
class TrackingThresholds:
    """The limits of tracking; the defaults are the published system's."""

    motion_model_matches: int = 20
    """Fewest matches with the last frame; the search window is doubled once."""
    reference_matches: int = 15
    """Fewest matches with the reference keyframe."""
    map_matches: int = 10
    """Fewest inliers of the first pose estimate."""
    local_map_inliers: int = 30
    """Fewest inliers in the local map."""
    local_map_inliers_after_relocalization: int = 50
    """The same for the first second after a relocalization."""
    few_close_points: int = 100
    """With fewer close points tracked than this ..."""
    many_untracked_close_points: int = 70
    """... and more close points than this not in the map, a keyframe is needed."""
    localization_matches: int = 20
    """In localization mode the motion model needs more matches than this."""
    keyframe_queue: int = 3
    """A busy mapper is given a keyframe only if fewer than this wait."""


@dataclass
class TrackingOutcome:
    """What tracking one frame gave."""

    state: TrackingState
    reason: Reason = Reason.NONE
    n_matches: int = 0
    n_inliers: int = 0
    is_keyframe: bool = False
    visual_odometry: bool = False
    covariance: FloatArray | None = None
    reset_needed: bool = False
