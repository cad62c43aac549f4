# SPDX-License-Identifier: BSD-3-Clause
"""All that tracking carries from one image to the next; ``docs/method/tracking.md#state``."""

from __future__ import annotations

from dataclasses import dataclass, field

from orbslam2py import _core as core
from orbslam2py._values import replace
from orbslam2py.slam.config import TrackingConfig
from orbslam2py.slam.records import TrackingState
from orbslam2py.slam.state.loss import LostSearch, LostTime, Unconfirmed
from orbslam2py.slam.state.motion import Motion
from orbslam2py.slam.state.scene import SceneStatistics


@dataclass(frozen=True)
class SinceKeyframe:
    """Tracking since the last keyframe."""

    frame_id: int = 0
    """The frame that became the last keyframe."""
    keyframe: int = -1
    """Id of the last keyframe; -1 if there was none."""
    most_inliers: int = 0
    """Most inliers of one frame since then, or since a relocalization."""

    def saw(self, n_inliers: int) -> SinceKeyframe:
        """Count a tracked frame."""
        return replace(self, most_inliers=max(self.most_inliers, n_inliers))


@dataclass(frozen=True, eq=False)
class State:
    """The state of tracking: a value, which `next_state` replaces."""

    phase: TrackingState = TrackingState.NO_IMAGES_YET
    """Not initialized, tracked, or lost."""
    motion: Motion = field(default_factory=Motion)
    """The last frame with a pose, and the velocity."""
    tracked_since: int = 0
    """Frame of the last relocalization, or the first frame of the last map that began beside
    others."""
    found_again: bool = False
    """It was a relocalization."""
    scene: SceneStatistics = field(default_factory=SceneStatistics)
    """Usual values in the frames before."""
    reference_keyframe: int = -1
    """The keyframe that shares most points with the last frame with a pose; -1 before the first."""
    local_map: core.LocalMap | None = None
    """The local map of the last refined frame; None before the first."""
    since_keyframe: SinceKeyframe = field(default_factory=SinceKeyframe)
    """Tracking since the last keyframe."""
    n_uncertain: int = 0
    """Number of frames in a row with weak evidence."""
    is_scarce: bool = False
    """The last pose has few inliers."""
    beyond_map: bool = False
    """In localization mode: the last pose depends on the depths of the frame before it."""

    lost: LostSearch = field(default_factory=LostSearch)
    """State of relocalization between two lost frames."""
    lost_time: LostTime = field(default_factory=LostTime)
    """Since when tracking is lost."""
    n_lost: int = 0
    """Images in a row without a pose."""
    unconfirmed: Unconfirmed | None = None
    """The last frame was relocalized; the present one must confirm it."""
    keyframe_candidate: core.TrackedFrame | None = None
    """This relocalized frame becomes a keyframe after its confirmation."""
    seeks_map: bool = False
    """Tracking has been lost so long that the initializer gets the frames, too."""

    kept_maps: frozenset[int] = frozenset()
    """Maps that are never dropped: loaded ones, and those used in localization mode."""
    in_loaded_map: bool = False
    """The camera has not been found yet in the loaded map."""
    initial_pose: core.Pose | None = None
    """``T_cw`` in a loaded map, given by the user; used until a frame is relocalized."""
    n_relocalizations: int = 0
    """Relocalized frames, over all maps."""

    @property
    def initializing(self) -> bool:
        """There is no map yet."""
        return self.phase in (TrackingState.NO_IMAGES_YET, TrackingState.NOT_INITIALIZED)

    @property
    def is_lost(self) -> bool:
        """The frame before has no pose."""
        return self.phase is TrackingState.LOST

    def following(self, slam_map: core.Map) -> State:
        """Move the last frame with the map, and replace a culled reference keyframe."""
        return replace(
            self,
            motion=self.motion.following(slam_map),
            reference_keyframe=slam_map.living(self.reference_keyframe),
        )

    def has_just_begun(self, frame_id: int, limits: TrackingConfig) -> bool:
        """Return whether this frame or the one before was relocalized, or began a map."""
        return frame_id < self.tracked_since + limits.frames_after_relocalization

    def relocalized(self, frame_id: int) -> State:
        """Return the state after a frame was found without a prediction."""
        return replace(self, tracked_since=frame_id, found_again=True)

    def map_begun(self, frame_id: int) -> State:
        """Return the state after the start of a map that is not the first."""
        return replace(self, tracked_since=frame_id, found_again=False)

    def elsewhere(self) -> State:
        """Return the state with the camera at another place, or in another map."""
        return replace(self, scene=self.scene.elsewhere(), n_uncertain=0)

    def in_another_map(self) -> State:
        """Forget the frames before: the next ones are in another map."""
        return replace(
            self,
            tracked_since=0,
            found_again=False,
            motion=Motion(),
            scene=self.scene.elsewhere(),
            reference_keyframe=-1,
            local_map=None,
            n_uncertain=0,
            beyond_map=False,
            lost=LostSearch(),
            unconfirmed=None,
            keyframe_candidate=None,
            in_loaded_map=False,
            initial_pose=None,
        )
