# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the poses of all frames, so that trajectories follow later changes of the map."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py.maps.saved_map import RecordedFrames
from orbslam2py.slam.frame_reestimation import FrameReestimation
from orbslam2py.trajectory.trajectory import Trajectory

#: So many frames wait for the end, when the map has settled, to be estimated or matched again;
#: those before them are where the map was settled long ago.
_MOST_WAITING = 1000
#: So many frames of young maps wait for the end with all their keypoints.
_MOST_WITH_KEYPOINTS = 100

_NO_POSES = Trajectory(timestamps=np.zeros(0), T_wc=np.zeros((0, 4, 4)))


class _YoungFrame(NamedTuple):
    frame: core.TrackedFrame
    lost: bool
    fixed_map: bool


class FrameRecorder:
    """The trajectory of the camera in the present maps and in those that have ended.

    The pose of a frame is stored relative to its reference keyframe, so it moves with the map. At
    the end, or after many further frames, it is estimated again from its points, because each of
    them has moved separately. The first frames of a single camera's map are also matched with the
    map again (``docs/method/map.md``, settled frames). The methods may be called from any thread,
    also while a frame is recorded.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map that the frames were tracked in.
    reestimation : FrameReestimation
        Matches frames with the map again, after many further frames.
    every_frame : bool
        `reestimation` gets every frame, not only the first ones of a map.
    """

    def __init__(
        self,
        slam_map: core.Map,
        reestimation: FrameReestimation,
        *,
        every_frame: bool = False,
    ) -> None:
        self._map = slam_map
        self._second_look = reestimation
        self._recorder = core.TrajectoryRecorder()
        self._sightings = core.FrameSightings()
        self._ended: dict[int, Trajectory] = {}
        self._lock = threading.Lock()
        self._doubted: core.TrackedFrame | None = None
        self._waiting: core.TrackedFrame | None = None
        # Frames of a young map, whose poses are estimated again; None: those of no map.
        self._young: list[_YoungFrame] | None = None
        self._young_map = -1
        self._every_frame = every_frame
        # Frames to be matched again, by id.
        self._with_keypoints: dict[int, core.TrackedFrame] = {}
        # The youngest map that a frame was recorded in.
        self._last_map = 0

    @property
    def n_young(self) -> int:
        """Frames that wait for `reestimate_first_frames`."""
        return len(self._young or ())

    def begin(self, earlier: Sequence[core.TrackedFrame]) -> None:
        """Keep the first frames of a map, so that `reestimate_first_frames` can match them again.

        Frames recorded as lost now have poses.
        """
        with self._lock:
            self._record_waiting()
            self._young = []
            self._young_map = earlier[0].map_index
            for frame in earlier:
                self._append(frame, lost=False)

    def reestimate_first_frames(self) -> None:
        """Record the frames since `begin` again, with their poses in the present map."""
        with self._lock:
            self._record_waiting()
            young, self._young = self._young or [], None
            for frame, lost, fixed_map in young:
                again = self._second_look(frame, finished=False)
                self._write(again, lost=lost, fixed_map=fixed_map)
                if not (lost or fixed_map or frame.id in self._with_keypoints):
                    self._keep_keypoints(again)

    def _append(self, frame: core.TrackedFrame, *, lost: bool, fixed_map: bool = False) -> None:
        """Record a frame that is later than all others."""
        self._write(frame, lost=lost, fixed_map=fixed_map)
        if self._young is None:
            return
        if lost or frame.map_index == self._young_map:
            self._young.append(_YoungFrame(frame, lost, fixed_map))
        else:
            self._young = None

    def _write(self, frame: core.TrackedFrame, *, lost: bool, fixed_map: bool = False) -> None:
        """Record a frame in place of its earlier record."""
        recorded_in = self._sightings.record(
            self._map, self._recorder, frame, lost, not fixed_map, _MOST_WAITING
        )
        self._last_map = max(self._last_map, recorded_in)

    def doubt(self, frame: core.TrackedFrame) -> None:
        """Withdraw the pose of the frame that is recorded next, if the frame after it is lost."""
        self._doubted = frame

    def record(
        self,
        frame: core.TrackedFrame,
        *,
        lost: bool,
        fixed_map: bool = False,
    ) -> None:
        """Record a frame; a lost one has no pose.

        Parameters
        ----------
        frame : TrackedFrame
            The frame.
        lost : bool
            Whether it has no pose.
        fixed_map : bool
            The map is fixed, so the pose need not follow it.
        """
        with self._lock:
            self._record_waiting(believed=not lost)
            if frame is self._doubted:
                # A copy: the frame itself continues to follow the map while others may read.
                self._waiting = frame.pose_alone()
            else:
                self._append(frame, lost=lost, fixed_map=fixed_map)
            self._doubted = None
            if self._every_frame and not lost and not fixed_map:
                self._keep_keypoints(frame)

    def _keep_keypoints(self, frame: core.TrackedFrame) -> None:
        """Queue a frame to be matched again later; of a full queue the oldest frame leaves."""
        waiting = self._with_keypoints
        waiting[frame.id] = frame
        if len(waiting) > (_MOST_WAITING if self._every_frame else _MOST_WITH_KEYPOINTS):
            oldest = waiting.pop(min(waiting))
            if self._every_frame:
                self._write(self._second_look(oldest), lost=False)

    def _record_waiting(self, *, believed: bool = True) -> None:
        """Record the frame that waits for the next one; called when its pose is needed earlier."""
        frame, self._waiting = self._waiting, None
        if frame is None:
            return
        if not believed:
            frame.T_cw = None
            self._with_keypoints.pop(frame.id, None)
        self._append(frame, lost=not believed)

    def settle(self) -> None:
        """Estimate the poses of the waiting frames again: the map is finished."""
        with self._lock:
            self._settle()

    def _settle(self, only_map: int | None = None) -> None:
        """Match waiting frames again, of all maps or of one; estimate the others again."""
        self._record_waiting()
        waiting, self._with_keypoints = self._with_keypoints, {}
        for frame in waiting.values():
            if only_map is None or self._map_of(frame) == only_map:
                self._write(self._second_look(frame), lost=False)
            else:
                self._with_keypoints[frame.id] = frame
        self._sightings.settle(self._map, self._recorder)

    def _map_of(self, frame: core.TrackedFrame) -> int:
        """Return the map that contains a frame now; its own map may have been merged."""
        return int(self._map.map_of(frame.reference_keyframe))

    def end_maps(self) -> None:
        """Keep the trajectories of the maps, which will be dropped next."""
        with self._lock:
            self._settle()
            for map_index in self._living():
                self._ended[map_index] = self._present(map_index)
            self._recorder.clear()
            self._young = None

    def end_map(self, map_index: int) -> None:
        """Keep the trajectory of one map, which will be dropped next; the others remain."""
        with self._lock:
            self._settle(map_index)
            self._ended[map_index] = self._present(map_index)
            self._recorder.drop(self._map, map_index)
            self._young = None

    def trajectory(self) -> Trajectory:
        """The trajectory in the active map."""
        with self._lock:
            self._record_waiting()
            return self._present(self._map.active_map)

    def trajectories(self) -> list[Trajectory]:
        """One trajectory for each map, by its number, relative to its first keyframe.

        The trajectory of a merged map is empty.
        """
        with self._lock:
            self._record_waiting()
            found = self._ended | {index: self._present(index) for index in self._living()}
        last = max(*found, self._last_map)
        return [found.get(index, _NO_POSES) for index in range(last + 1)]

    def _living(self) -> list[int]:
        return sorted({*self._map.maps, self._map.active_map})

    def recorded(self, map_index: int, known: npt.NDArray[np.int64]) -> RecordedFrames:
        """The frames of the present map relative to their keyframes, as map files keep them.

        Parameters
        ----------
        map_index : int
            Number of the map; frames of other maps are left out.
        known : array of int64 (m,)
            Ids of the keyframes in the file. The first frame that refers to another keyframe, and
            all later ones, are left for the next save.
        """
        with self._lock:
            self._record_waiting()
            if self._map.epoch != map_index or not len(self._recorder):
                return RecordedFrames.none()
            entries = self._recorder.entries()
        unknown = ~np.isin(entries["keyframes"], known) & (entries["keyframes"] >= 0)
        n = int(np.argmax(unknown)) if unknown.any() else len(unknown)
        return RecordedFrames(
            timestamps=entries["timestamps"][:n],
            ids=entries["frames"][:n],
            keyframes=entries["keyframes"][:n],
            T_cr=entries["T_cr"][:n],
            lost=entries["lost"][:n].astype(np.uint8),
        )

    def _present(self, map_index: int) -> Trajectory:
        poses = self._recorder.rebuild(self._map, map_index)
        return Trajectory(
            timestamps=poses.timestamps, T_wc=poses.T_wc, lost=poses.lost, indices=poses.frames
        )
