# SPDX-License-Identifier: BSD-3-Clause
"""Loop closing: recognises known places and corrects the drift.

Mur-Artal, Montiel and Tardos, 2015, section VII; for stereo and RGB-D the scale is known, Mur-Artal
and Tardos, 2017, section III-D. It rejects candidates that drift cannot explain, or that contradict
each other, because places that look alike give perfect matches. Step by step:
``docs/method/loops.md``.
"""

from __future__ import annotations

import contextlib
import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from orbslam2py import _core as core
from orbslam2py._timing import StageStatistics, StageTimer
from orbslam2py._worker import Worker
from orbslam2py.errors import StateError
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.config import Config
from orbslam2py.slam.events import LoopClosed, MapsMerged
from orbslam2py.slam.full_bundle_adjustment import FullBundleAdjustment
from orbslam2py.slam.merging import MapMerging
from orbslam2py.slam.options import SystemOptions
from orbslam2py.slam.pending_loop import PendingLoop

_log = logging.getLogger(__name__)

_NO_KEYFRAME = -1


@dataclass(frozen=True)
class _Proposals:
    """Keyframes that look like the present one."""

    consistent: list[int]
    """The keyframes before also proposed this part of the map."""
    others: list[int]


class LoopClosing:
    """Third stage of the pipeline: processes every keyframe after local mapping.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    keyframe_index : orbslam2py._core.KeyFrameIndex
        Index from words to keyframes.
    sensor : Sensor
        Whether scale drifts, as with a single camera.
    mapping : Worker
        Pauses while a loop is closed.
    adjustment : FullBundleAdjustment
        Stopped while a loop is closed.
    options : SystemOptions
        Whether loops are closed (otherwise keyframes only enter the index, for relocalization),
        whether full bundle adjustment follows, the seed, and whether there is a thread.
    on_loop : callable
        ``on_loop(event)``, after each loop.
    on_merge : callable
        ``on_merge(event)``, after two maps have become one.
    config : Config
        Thresholds of loops and of merging.
    """

    def __init__(
        self,
        slam_map: core.Map,
        keyframe_index: core.KeyFrameIndex,
        sensor: Sensor,
        mapping: Worker[int],
        adjustment: FullBundleAdjustment,
        options: SystemOptions,
        *,
        on_loop: Callable[[LoopClosed], None],
        on_merge: Callable[[MapsMerged], None],
        config: Config,
    ) -> None:
        self._map = slam_map
        self._keyframe_index = keyframe_index
        self._has_depth = sensor.has_depth
        self._mapping = mapping
        self._adjustment = adjustment
        self._enabled = options.loop_closing
        self._adjust = options.full_adjustment
        self._limits = config.loops
        self._verifications = {
            fix: core.LoopVerificationOptions(fix_scale=fix, seed=options.seed % 2**64)
            for fix in (False, True)
        }
        self._on_loop = on_loop
        self._on_merge = on_merge
        self._merging = MapMerging(
            slam_map,
            self._confirm,
            self._find_alike,
            self._lease,
            fixes_scale=self._fixes_scale,
            config=config.merging,
        )
        self._waiting = PendingLoop(slam_map, self._confirm, self._release, self._limits)
        self._consistency = core.LoopConsistency()
        self._next_search = 1
        # A map with a fresh seam, and the keyframe from which on it is adjusted once more.
        self._seam: tuple[int, int] | None = None
        #: Loops closed so far, over all maps.
        self.loops: list[LoopClosed] = []
        #: Maps that have become part of older ones.
        self.merges: list[MapsMerged] = []
        #: The last keyframe that arrived, -1 before the first.
        self.last_keyframe = -1
        #: Milliseconds per step.
        self.statistics = StageStatistics()
        self.worker: Worker[int] = Worker(
            "loop closing", self.process, threaded=not options.deterministic
        )

    def insert_keyframe(self, keyframe: int) -> None:
        """Queue a keyframe, unless the loop closing has been shut down before mapping."""
        self.worker.offer(keyframe)

    @property
    def has_loop_waiting(self) -> bool:
        """Whether a loop waits for a better one."""
        return self._waiting.has_loop

    def end(self) -> None:
        """Close the pending loop, if there is one: no further keyframe follows."""
        if self.worker.threaded or self.has_loop_waiting:
            self.worker.offer(_NO_KEYFRAME)

    def reset(self) -> None:
        """Drop waiting keyframes and the proposals of the last ones."""
        self.worker.reset()
        self._waiting.drop()
        self._consistency.clear()
        self._merging.reset()
        self._next_search = 1
        self._seam = None
        self.last_keyframe = -1

    def process(self, keyframe: int) -> None:
        """Do all work for one keyframe."""
        timer = StageTimer()
        if keyframe == _NO_KEYFRAME:
            self._close_last(timer)
        else:
            with self._lease(keyframe) as alive:
                if alive:
                    self._search(keyframe, timer)
            self.last_keyframe = keyframe
        self.statistics.add({f"loop.{step}": ms for step, ms in timer.milliseconds.items()})

    def _search(self, keyframe: int, timer: StageTimer) -> None:
        found = self._find_loop(keyframe, timer)
        if found is not None and self._joins_maps(found):
            self._join(found, timer)
            return
        with self._waiting.ripe(found) as loop:
            if loop is not None:
                self._close(loop, timer)
            else:
                self._adjust_seam(keyframe)

    def _close_last(self, timer: StageTimer) -> None:
        with self._waiting.last() as loop:
            if loop is not None:
                self._close(loop, timer)

    @contextlib.contextmanager
    def _lease(self, keyframe: int) -> Iterator[bool]:
        """Protect a keyframe from culling; yield False if it is already culled."""
        try:
            self._map.begin_lease(keyframe)
        except StateError:
            yield False
            return
        try:
            yield True
        finally:
            self._release(keyframe)

    def _release(self, keyframe: int) -> None:
        if self._map.end_lease(keyframe):
            self._keyframe_index.erase(keyframe)

    # ---- is this a place seen before? ------------------------------------------------------------
    def _find_loop(self, keyframe: int, timer: StageTimer) -> core.Loop | None:
        with timer("detect"):
            proposals = self._detect(keyframe)
            core.index_keyframe(self._keyframe_index, self._map, keyframe)
        if not proposals.consistent:
            return None
        with timer("verify"):
            return self._verify(keyframe, proposals)

    def _detect(self, keyframe: int) -> _Proposals:
        if not self._enabled or keyframe < self._next_search:
            self._consistency.clear()
            return _Proposals([], [])
        candidates = self._find_alike(keyframe)
        consistent = list(self._consistency.update(self._map, candidates))
        return _Proposals(consistent, [c for c in candidates if c not in consistent])

    def _find_alike(self, keyframe: int) -> list[int]:
        """Keyframes that look like this one and share no point with it, of all maps."""
        least_score = core.lowest_neighbour_score(self._map, keyframe)
        found = core.find_loop_candidates(self._keyframe_index, self._map, keyframe, least_score)
        return [place.keyframe for place in found]

    def _confirm(self, keyframe: int, candidate: int) -> core.Loop | None:
        options = self._verifications[self._fixes_scale(keyframe, candidate)]
        return core.verify_loop_candidate(self._map, keyframe, candidate, options)

    def _fixes_scale(self, *keyframes: int) -> bool:
        """Return whether the maps of keyframes are in metres: with depth, or by an IMU."""
        slam_map = self._map
        return self._has_depth or all(slam_map.is_upright(slam_map.map_of(k)) for k in keyframes)

    def _joins_maps(self, loop: core.Loop) -> bool:
        return self._map.map_of(loop.current) != self._map.map_of(loop.matched)

    def _verify(self, keyframe: int, proposals: _Proposals) -> core.Loop | None:
        """Choose the verified loop, unless another place fits as well.

        It may be in another map only if there is none in this map.
        """

        def confirmed(candidates: list[int]) -> list[core.Loop]:
            loops = (self._confirm(keyframe, candidate) for candidate in candidates)
            return [loop for loop in loops if loop is not None]

        found = confirmed(proposals.consistent)
        loops = [loop for loop in found if not self._joins_maps(loop)]
        elsewhere = [loop for loop in found if self._joins_maps(loop)]
        fix_scale = self._fixes_scale(keyframe)
        best = core.choose_loop(self._map, loops, fix_scale)
        if best is None:
            return self._merging.choose(elsewhere, lambda: [*loops, *confirmed(proposals.others)])
        loops += [loop for loop in confirmed(proposals.others) if not self._joins_maps(loop)]
        if core.choose_loop(self._map, loops, fix_scale) is None:
            _log.info("keyframe %d looks like several places; no loop closed", keyframe)
            return None
        return best

    # ---- two maps --------------------------------------------------------------------------------
    def _join(self, loop: core.Loop, timer: StageTimer) -> None:
        with self._adjustment.kept_away(), self._mapping.pause(brief=True) as ticket:
            with timer("wait"):
                ticket.wait()
            merged = self._merging.join(loop, timer, self.worker.cancel_flag)
        if merged is None:
            return
        self._consistency.clear()
        self._next_search = loop.current + self._limits.gap
        self.merges.append(merged)
        self._on_merge(merged)
        if self._adjust:
            self._adjustment.start(merged.map_index)
            self._seam = merged.map_index, self._next_search

    def _adjust_seam(self, keyframe: int) -> None:
        """Adjust a merged map again when both parts share more observations."""
        if self._seam is None or keyframe < self._seam[1]:
            return
        (map_index, _), self._seam = self._seam, None
        if self._map.n_keyframes_of(map_index):
            self._adjustment.start(map_index)

    # ---- correction ------------------------------------------------------------------------------
    def _close(self, loop: core.Loop, timer: StageTimer) -> None:
        # The map that an adjustment refines will move.
        with self._adjustment.kept_away(), self._mapping.pause(brief=True) as ticket:
            with timer("wait"):
                ticket.wait()
            self._map.update_connections(loop.current)
            with timer("plan"):
                fix_scale = self._fixes_scale(loop.current)
                correction = core.plan_loop_correction(self._map, loop, fix_scale)
            with timer("graph"):
                graph = core.optimize_essential_graph(correction, self.worker.cancel_flag)
            if graph.aborted:
                return
            with timer("apply"):
                result = core.apply_loop_correction(self._map, correction)
            if not result.applied:
                return
            # While mapping stands still: it may cull the place that was seen again.
            closed = self._record(loop, result, timer)
        self._consistency.clear()
        self._next_search = loop.current + self._limits.gap
        self.loops.append(closed)
        _log.info(
            "loop closed: keyframe %d shows the place of %d; moved by %.3f m",
            loop.current,
            loop.matched,
            result.translation,
        )
        self._on_loop(closed)
        if self._adjust:
            self._adjustment.start(closed.map_index)
            self._seam = None

    def _record(
        self, loop: core.Loop, result: core.LoopCorrectionResult, timer: StageTimer
    ) -> LoopClosed:
        return LoopClosed(
            map_index=self._map.map_of(loop.current),
            current_keyframe=loop.current,
            matched_keyframe=loop.matched,
            current_timestamp=self._map.keyframe_timestamp(loop.current),
            matched_timestamp=self._map.keyframe_timestamp(loop.matched),
            n_inliers=loop.n_inliers,
            n_matches=loop.n_matches,
            n_fused=result.n_fused,
            scale=result.scale,
            S_cm=loop.S_cm,
            translation=result.translation,
            rotation_deg=math.degrees(result.rotation),
            milliseconds=dict(timer.milliseconds),
        )
