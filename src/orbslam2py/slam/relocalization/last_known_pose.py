# SPDX-License-Identifier: BSD-3-Clause
"""Where tracking was lost, and where the camera may have gone from there."""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py._arrays import IntArray
from orbslam2py.slam.config import RelocalizationConfig


class LastKnownPose:
    """The last frame that was believed.

    Parameters
    ----------
    last : orbslam2py._core.TrackedFrame
        The frame, with its pose.
    velocity : Pose or None
        Its motion from one frame to the next, ``T_cl``; None if it is not known.
    reference_keyframe : int
        Shared most points with it.
    """

    def __init__(
        self, last: core.TrackedFrame, velocity: core.Pose | None, reference_keyframe: int
    ) -> None:
        self.last = last
        self.velocity = velocity
        self.reference_keyframe = reference_keyframe

    def follow_map(self, slam_map: core.Map) -> None:
        """Bring the frame and its motion up to date with the map, which goes on moving."""
        _, stretched = core.follow_map(slam_map, self.last)
        if self.velocity is not None and stretched != 1.0:
            # A single camera's loop took out a drift of scale, in which the speed was measured.
            self.velocity = core.Pose(
                self.velocity.quaternion_xyzw, stretched * self.velocity.translation
            )

    def keyframes(self, slam_map: core.Map, limits: RelocalizationConfig) -> list[int]:
        """The reference keyframe, those that see most of what it sees, and the last ones made.

        Each once, the likeliest first.
        """
        reference = slam_map.living(self.reference_keyframe)
        if reference < 0:
            return []
        covisible = slam_map.best_neighbours(reference, limits.covisible_keyframes)
        same_map = slam_map.keyframe_ids(slam_map.map_of(reference))
        youngest: IntArray = same_map[: -limits.last_keyframes - 1 : -1]
        return list(dict.fromkeys([reference, *covisible.tolist(), *youngest.tolist()]))

    def guesses(self, frame_id: int, limits: RelocalizationConfig) -> list[core.Pose]:
        """Poses ``T_cw`` of a later frame: it went on as before, or stayed.

        Parameters
        ----------
        frame_id : int
            The frame that is looked for.
        limits : RelocalizationConfig
            For how long a motion is taken to go on.
        """
        T_lw = self.last.T_cw
        assert T_lw is not None
        steps = frame_id - self.last.id
        if self.velocity is None or steps > limits.motion_frames:
            return [T_lw]
        went_on = T_lw
        for _ in range(steps):
            went_on = self.velocity @ went_on
        return [went_on, T_lw]
