# SPDX-License-Identifier: BSD-3-Clause
"""Full bundle adjustment of all keyframes and points, while the system continues to run.

Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-D;
``docs/method/adjustment.md#full-bundle-adjustment``.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

from orbslam2py import _core as core
from orbslam2py._arguments import number_above_zero
from orbslam2py._cores import n_cores, n_threads
from orbslam2py._timing import StageStatistics, StageTimer
from orbslam2py._worker import Worker, WorkerState
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.map_copies import restore_contents, take_contents
from orbslam2py.maps.units import sees_metres

_log = logging.getLogger(__name__)


#: Accepted steps at most.
_ITERATIONS = 10


@dataclass(frozen=True)
class FullAdjustmentRecord:
    """One full bundle adjustment."""

    map_index: int
    """Number of the map, as in `TrackingRecord.map_index`."""
    n_keyframes: int = 0
    """Keyframes that took part."""
    n_points: int = 0
    n_observations: int = 0
    """Keypoints of these keyframes that show these points."""
    iterations: int = 0
    """Accepted steps."""
    initial_cost: float = 0.0
    """Sum of squared residuals over their variances, with robust kernel."""
    final_cost: float = 0.0
    """The same sum at the end."""
    used: bool = False
    """False: stopped by another loop, a reset or the shutdown, or the cost did not fall."""
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Time per step: gather, solve, wait, commit, local (if there were new keyframes)."""


class FullBundleAdjustment:
    """Refines the whole map on demand; the fourth worker.

    It solves a copy of the map, so no other worker waits. Mapping pauses for a moment while the
    result is written. Keyframes and points that were added in between move with their parent or
    reference keyframe.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    mapping : Worker
        Pauses while the result is written.
    time_limit : float, optional
        Time limit in seconds; the result up to then is used.
    monocular : bool
        The scale of the map is not known.
    threaded : bool
        Whether to use a separate thread; otherwise inline.
    on_done : callable
        ``on_done(record)``, after each one.
    """

    def __init__(
        self,
        slam_map: core.Map,
        mapping: Worker[int],
        *,
        time_limit: float | None,
        monocular: bool,
        threaded: bool,
        on_done: Callable[[FullAdjustmentRecord], None],
    ) -> None:
        self._map = slam_map
        self._mapping = mapping
        self._monocular = monocular
        self._options = core.FullBundleOptions(
            iterations=_ITERATIONS, max_seconds=time_limit or 0.0
        )
        self._on_done = on_done
        #: One core is left for tracking; a single thread gives the same bytes in every run.
        self._n_threads = n_threads(min(4, max(1, n_cores() // 2))) if threaded else 1
        #: All that were begun, also those given up.
        self.records: list[FullAdjustmentRecord] = []
        #: Milliseconds per step.
        self.statistics = StageStatistics()
        self._numbers = itertools.count()
        self._latest: tuple[int, FullAdjustmentRecord] | None = None
        # Which map the last one begun is of.
        self._wanted: tuple[int, int] = -1, -1
        #: Its jobs are consecutive numbers of adjustments.
        self.worker: Worker[int] = Worker(
            "full bundle adjustment", self._process, threaded=threaded
        )

    def start(self, map_index: int | None = None) -> int:
        """Start an adjustment, by default of the active map; a running one is stopped.

        None is started during the shutdown. Returns its number.
        """
        self.cancel()
        number = next(self._numbers)
        self._wanted = number, self._map.active_map if map_index is None else map_index
        self.worker.offer(number)
        return number

    def start_and_wait(
        self, stop: threading.Event | None = None, map_index: int | None = None
    ) -> FullAdjustmentRecord:
        """Start an adjustment and wait for its end.

        It is stopped if the worker is paused for longer (localization mode), or if another
        adjustment, a reset or the shutdown replaces it. If it had not begun, its record counts
        nothing. It is also stopped if `stop` is set.
        """
        number = self.start(map_index)
        worker = self.worker
        stop = stop or threading.Event()

        def done() -> bool:
            ended = worker.idle or worker.state is WorkerState.FAILED
            return ended or worker.held or stop.is_set()

        try:
            worker.wait_until(done)
        except KeyboardInterrupt:
            self.cancel()
            raise
        worker.raise_if_failed()
        if worker.held or stop.is_set():
            self.cancel()
        latest = self._latest
        if latest is not None and latest[0] == number:
            return latest[1]
        return FullAdjustmentRecord(self._wanted[1])

    @contextlib.contextmanager
    def kept_away(self) -> Iterator[None]:
        """Stop a running adjustment, and block the begin and end of others.

        For callers that move the map themselves: later requests wait.
        """
        with self.worker.pause(brief=True):
            self.cancel()
            yield

    def cancel(self, timeout: float | None = None) -> None:
        """Stop a running adjustment. After the return it does not change the map any more."""
        self.worker.reset(timeout)

    def run(self, map_index: int | None = None) -> FullAdjustmentRecord:
        """Run an adjustment in the caller's thread, after the workers have ended."""
        chosen = self._map.active_map if map_index is None else map_index
        return self._adjust(core.StopFlag(), chosen)

    def _refine_newest(self, cancelled: core.StopFlag, map_index: int) -> None:
        """Move keyframes that were added in between with the optimised map."""
        newest = int(core.snapshot_keyframes(self._map, map_index).ids[-1])
        core.local_bundle_adjustment(self._map, newest, cancelled, self._monocular)

    def _process(self, number: int) -> None:
        wanted, map_index = self._wanted
        if wanted == number:
            self._latest = number, self._adjust(self.worker.cancel_flag, map_index)

    def _adjust(self, cancelled: core.StopFlag, map_index: int) -> FullAdjustmentRecord:
        timer = StageTimer()
        with self.worker.off_duty():
            with timer("gather"):
                bundle = core.gather_full_bundle(self._map, map_index)
            with timer("solve"):
                summary = core.solve_full_bundle(bundle, self._options, cancelled, self._n_threads)
        used = False
        if not (summary.aborted or cancelled.is_set()):
            with self._mapping.pause(brief=True) as ticket:
                with timer("wait"):
                    ticket.wait()
                with timer("commit"):
                    commit = core.commit_full_bundle(self._map, bundle)
                used = commit.committed
                if commit.n_followed_keyframes > 0:
                    with timer("local"):
                        self._refine_newest(cancelled, map_index)
        record = FullAdjustmentRecord(
            map_index=map_index,
            n_keyframes=bundle.n_keyframes,
            n_points=bundle.n_points,
            n_observations=bundle.n_observations,
            iterations=summary.iterations,
            initial_cost=summary.initial_cost,
            final_cost=summary.final_cost,
            used=used,
            milliseconds=timer.milliseconds,
        )
        self.records.append(record)
        self.statistics.add({f"adjustment.{k}": v for k, v in timer.milliseconds.items()})
        _log.info(
            "full bundle adjustment of %d keyframes and %d points: %d steps, %s",
            record.n_keyframes,
            record.n_points,
            record.iterations,
            "used" if used else "given up",
        )
        self._on_done(record)
        return record


def optimize_map(
    contents: MapContents, *, time_limit: float | None = None
) -> tuple[MapContents, FullAdjustmentRecord]:
    """Optimise all keyframes and points of a map together, as `System.optimize` does.

    Keyframe 0 does not move. Without a time limit the same map gives the same bytes.

    Parameters
    ----------
    contents
        The map, as from `load_map`.
    time_limit
        Time limit in seconds, above 0; the result up to then is used.

    Returns
    -------
    contents
        The refined map.
    record
        Size, cost before and after.

    Raises
    ------
    MapFileError
        If the contents are inconsistent, or no contents of a map.
    SettingsError
        If the time limit is not a number above 0.
    """
    contents_of(contents)
    if time_limit is not None:
        remedy = "seconds above 0, or None for no limit"
        time_limit = number_above_zero(time_limit, "time_limit", remedy)
    slam_map = restore_contents(contents)
    nobody: Worker[int] = Worker("local mapping", lambda _: None, threaded=False)
    adjustment = FullBundleAdjustment(
        slam_map,
        nobody,
        time_limit=time_limit,
        monocular=not sees_metres(contents),
        threaded=False,
        on_done=lambda _: None,
    )
    record = adjustment.run()
    refined = take_contents(slam_map)
    # No keyframe comes or goes, and nothing here knows the vocabulary.
    keyframes = replace(refined.keyframes, words=contents.keyframes.words)
    refined = replace(
        refined,
        map_index=contents.map_index,
        keyframes=keyframes,
        imu_states=contents.imu_states,
    )
    return refined, record
