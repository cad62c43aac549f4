# SPDX-License-Identifier: BSD-3-Clause
"""Map merging: join two maps that show the same place.

Campos et al., "ORB-SLAM3", IEEE T-RO 2021, section VI, and Elvira et al., "ORBSLAM-Atlas", IROS
2019. The checks are stricter than those of loop closing, because no drift limits the distance
between two maps. Step by step: ``docs/method/several_maps.md``.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._timing import StageTimer
from orbslam2py.slam.config import MergingConfig
from orbslam2py.slam.events import MapsMerged

_log = logging.getLogger(__name__)

_NEIGHBOURS = 6  # of a keyframe, that may confirm a place in another map
_FAR_NEIGHBOURS = 3  # of the place, that they are compared with
_REMEMBERED = 10  # keyframes whose places in another map are kept until confirmed
_PLACES = 5  # in the other map, that are compared with the first

#: Verifies by geometry that two keyframes show the same place.
Verify = Callable[[int, int], core.Loop | None]
#: Keyframes of any map that look like one.
FindAlike = Callable[[int], list[int]]
#: Whether the maps of keyframes are in metres.
FixesScale = Callable[..., bool]
#: Keeps a keyframe alive; gives False when it is dead already.
Lease = Callable[[int], AbstractContextManager[bool]]


class MapMerging:
    """Decides whether two maps show the same place, and merges them.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The maps.
    verify : callable
        ``verify(current, candidate)``: a loop or None.
    find_alike : callable
        Keyframes that look like one and share no point with it.
    lease : callable
        Protects a keyframe from culling.
    fixes_scale : callable
        ``fixes_scale(*keyframes)``: their maps have the same scale, by depth or by an IMU.
    config : MergingConfig
        Limits.
    """

    def __init__(
        self,
        slam_map: core.Map,
        verify: Verify,
        find_alike: FindAlike,
        lease: Lease,
        *,
        fixes_scale: FixesScale,
        config: MergingConfig,
    ) -> None:
        self._map = slam_map
        self._fixes_scale = fixes_scale
        self._verify = verify
        self._find_alike = find_alike
        self._lease = lease
        self._limits = config
        # What keyframes showed that alone were not enough: the far keyframe and S_cm, by keyframe.
        self._shown: dict[int, tuple[int, FloatArray]] = {}

    def reset(self) -> None:
        """Drop the stored places of keyframes: the maps have changed."""
        self._shown.clear()

    # ---- is it the same place? -------------------------------------------------------------------
    def choose(
        self, consistent: Sequence[core.Loop], others: Callable[[], Sequence[core.Loop]]
    ) -> core.Loop | None:
        """Choose the place in another map that a keyframe shows, if all checks pass.

        Parameters
        ----------
        consistent : sequence of Loop
            Verified places in other maps that the keyframes before also proposed.
        others : callable
            Gives all other verified places in any map that look like it.
        """
        if not consistent:
            return None
        best = self._best_of(consistent)
        if best is None:
            return None
        with self._lease(best.matched) as alive:
            return best if alive and self._is_sound(best, others) else None

    def _is_sound(self, best: core.Loop, others: Callable[[], Sequence[core.Loop]]) -> bool:
        if not self._is_alone(best, others()):
            _log.info("keyframe %d looks like several places; no maps joined", best.current)
            return False
        if not self._is_confirmed(best):
            _log.info("keyframe %d alone shows a place of another map", best.current)
            self._remember(best)
            return False
        if not self._is_explained(best):
            _log.info("keyframe %d shows too little of the other map's place", best.current)
            self._remember(best)
            return False
        return True

    def _is_alone(self, best: core.Loop, others: Sequence[core.Loop]) -> bool:
        """Return whether no other place looks like either end."""
        here = self._map.map_of(best.current)
        elsewhere = [loop for loop in others if self._map.map_of(loop.matched) != here]
        if self._best_of([best, *elsewhere]) is None:
            return False
        same_map = [loop for loop in others if self._map.map_of(loop.matched) == here]
        if not all(self._is_drift(loop) for loop in same_map):
            return False
        # Keyframes of its own map that look like the far end.
        there = self._map.map_of(best.matched)
        alike = [k for k in self._find_alike(best.matched) if self._map.map_of(k) == there]
        found = (self._verify(best.matched, k) for k in alike[:_PLACES])
        return all(loop is None or self._is_drift(loop) for loop in found)

    def _is_drift(self, loop: core.Loop) -> bool:
        """Return whether two places of one map may be the same place, separated by drift."""
        fix_scale = self._fixes_scale(loop.current)
        return bool(core.assess_drift(self._map, loop, fix_scale).plausible())

    def _best_of(self, loops: Sequence[core.Loop]) -> core.Loop | None:
        fix_scale = self._fixes_scale(loops[0].current, *(loop.matched for loop in loops))
        return core.choose_merge(self._map, list(loops), fix_scale)

    def _remember(self, best: core.Loop) -> None:
        self._shown[best.current] = (best.matched, best.S_cm)
        while len(self._shown) > _REMEMBERED:
            del self._shown[next(iter(self._shown))]

    def _is_confirmed(self, best: core.Loop) -> bool:
        """Return whether neighbouring keyframes see the other map from the expected poses."""
        limits = self._limits
        slam_map = self._map
        scene_depth = core.median_scene_depth(slam_map, best.matched)
        if scene_depth is None:
            return False
        T_cw = slam_map.keyframe_pose(best.current)
        around = slam_map.best_neighbours(best.matched, _FAR_NEIGHBOURS).tolist()
        candidates = [best.matched, *around]
        n_agreeing = 0
        for keyframe in slam_map.best_neighbours(best.current, _NEIGHBOURS).tolist():
            T_kc = slam_map.keyframe_pose(keyframe) @ T_cw.inverse()
            expected = T_kc.matrix @ best.S_cw
            found = self._place_of(keyframe, candidates, best.matched)
            if found is not None:
                if not self._agree(expected, found, scene_depth):
                    return False
                n_agreeing += 1
            if n_agreeing >= limits.confirmations:
                return True
        return False

    def _is_explained(self, best: core.Loop) -> bool:
        """Return whether enough of the expected points are found.

        At a repetitive wall, the view also fits some metres further on; the points behind the wall
        do not.
        """
        share = explained_share(self._map, best, self._limits.view_cosine)
        return share >= self._limits.explained

    def _place_of(self, keyframe: int, candidates: list[int], far: int) -> FloatArray | None:
        """Return S_cw (4, 4) of a keyframe in the map of `far`, by one of the candidates there.

        Otherwise use its place stored earlier: distant keyframes may show different parts of that
        map.
        """
        for candidate in candidates:
            loop = self._verify(keyframe, candidate)
            if loop is not None:
                return np.asarray(loop.S_cw)
        matched, S_cm = self._shown.get(keyframe, (-1, np.eye(4)))
        slam_map = self._map
        if matched < 0 or not slam_map.has_keyframe(matched):
            return None
        if slam_map.map_of(matched) != slam_map.map_of(far):
            return None
        return np.asarray(S_cm @ slam_map.keyframe_pose(matched).matrix)

    def _agree(self, expected: FloatArray, found: FloatArray, scene_depth: float) -> bool:
        limits = self._limits
        scale_a, R_a, centre_a = _parts(expected)
        scale_b, R_b, centre_b = _parts(found)
        cosine = (np.trace(R_a.T @ R_b) - 1) / 2
        return bool(
            np.linalg.norm(centre_a - centre_b) <= limits.position * scene_depth
            and cosine >= np.cos(limits.angle)
            and abs(np.log(scale_a / scale_b)) <= limits.log_scale
        )

    # ---- one map ---------------------------------------------------------------------------------
    def join(
        self, loop: core.Loop, timer: StageTimer, cancelled: core.StopFlag
    ) -> MapsMerged | None:
        """Merge two maps; local mapping is paused.

        Parameters
        ----------
        loop : Loop
            The result of `choose`.
        timer : StageTimer
            Measures the time of each step.
        cancelled : StopFlag
            Ends the adjustments early; once the merge has begun, the maps are still joined.
        """
        self._map.update_connections(loop.current)
        with timer("plan"):
            fix_scale = self._fixes_scale(loop.current, loop.matched)
            merge = core.plan_map_merge(self._map, loop, fix_scale)
        if merge.kept < 0 or cancelled.is_set():
            return None
        with timer("apply"):
            result = core.apply_map_merge(self._map, merge)
        if not result.applied:
            return None
        self.reset()
        self._weld(loop.current, result.kept, timer, cancelled)
        _log.info(
            "map %d becomes part of map %d: keyframe %d shows the place of %d",
            result.moved,
            result.kept,
            loop.current,
            loop.matched,
        )
        return MapsMerged(
            map_index=result.kept,
            merged_map=result.moved,
            current_keyframe=loop.current,
            matched_keyframe=loop.matched,
            current_timestamp=self._map.keyframe_timestamp(loop.current),
            matched_timestamp=self._map.keyframe_timestamp(loop.matched),
            n_inliers=loop.n_inliers,
            n_matches=loop.n_matches,
            n_fused=result.n_fused,
            n_moved_keyframes=result.n_moved_keyframes,
            n_moved_points=result.n_moved_points,
            S_km=merge.S_km,
            scale=result.scale,
            milliseconds=dict(timer.milliseconds),
        )

    def _weld(
        self, current: int, map_index: int, timer: StageTimer, cancelled: core.StopFlag
    ) -> None:
        """Adjust both neighbourhoods together, and move the rest of the map with them."""
        slam_map = self._map
        fix_scale = self._fixes_scale(current)
        before = core.poses_of_map(slam_map, map_index)
        seam = core.keyframes_of_seam(slam_map, current)
        with timer("weld"):
            core.local_bundle_adjustment(slam_map, current, cancelled, not fix_scale)
        with timer("graph"):
            core.spread_from_seam(slam_map, before, seam.tolist(), fix_scale, cancelled)


def _parts(S_cw: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Scale, rotation and the camera's centre of a similarity (4, 4)."""
    scale = float(np.cbrt(np.linalg.det(S_cw[:3, :3])))
    rotation = S_cw[:3, :3] / scale
    return scale, rotation, -rotation.T @ S_cw[:3, 3] / scale


def explained_share(slam_map: core.Map, loop: core.Loop, view_cosine: float) -> float:
    """Return the share of expected points that a keyframe sees at a place in another map.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The maps.
    loop : Loop
        The place, its surrounding points, and how many of them the keyframe sees.
    view_cosine : float
        Count only points seen from nearly the same direction as before: least cosine of the angle
        between both directions.

    Returns
    -------
    float
        Matches over points in the image of the keyframe, in the range of distances at which they
        can be matched, seen from the front; 0 if there are none.
    """
    try:
        features = slam_map.keyframe_frame(loop.current)
    except KeyError:  # local mapping has just culled it
        return 0.0
    S_cw = np.asarray(loop.S_cw)
    scale = np.cbrt(np.linalg.det(S_cw[:3, :3]))
    # The keyframe's camera in the other map's world and scale.
    T_cw = np.eye(4)
    T_cw[:3] = S_cw[:3] / scale
    camera = core.TrackedFrame(features)
    camera.T_cw = core.Pose.from_matrix(T_cw)
    points = core.gather_points(slam_map, np.unique(loop.loop_points))
    _, cosines, _, visible = core.project_into(camera, points)
    center = -T_cw[:3, :3].T @ T_cw[:3, 3]
    distances = np.linalg.norm(points.positions - center, axis=1)
    near_enough = (distances >= points.min_distances) & (distances <= points.max_distances)
    n_visible = np.count_nonzero(visible & near_enough & (cosines >= view_cosine))
    return loop.n_matches / n_visible if n_visible else 0.0
