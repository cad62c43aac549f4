# SPDX-License-Identifier: BSD-3-Clause
"""Full bundle adjustment: all keyframes and points together, while the system goes on.

Mur-Artal and Tardos, "ORB-SLAM2", 2017, section III-C.
"""

from __future__ import annotations

import contextlib
import itertools
import logging
import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from orbslam2py import _core as core
from orbslam2py.errors import SettingsError
from orbslam2py.slam.timing import StageStatistics, StageTimer
from orbslam2py.slam.worker import Worker, WorkerState

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class FullAdjustmentOptions:
    """Whether and how long."""

    enabled: bool = True
    """After every loop; `FullAdjustment.run` works in any case."""
    iterations: int = 10
    """Accepted steps at most."""
    time_limit: float | None = None
    """Seconds; what was reached by then is used."""


@dataclass(frozen=True)
class FullAdjustmentRecord:
    """One full bundle adjustment."""

    map_index: int
    n_keyframes: int
    n_points: int
    n_observations: int
    iterations: int
    """Accepted steps."""
    initial_cost: float
    """Sum of squared residuals, each over its standard deviation, robustified."""
    final_cost: float
    used: bool
    """False: given up because of another loop, a reset or the shutdown, or it gained nothing."""
    milliseconds: dict[str, float] = field(default_factory=dict)
    """Time per step: gather, solve, wait, commit, local (if there were new keyframes)."""


def check_time_limit(seconds: float | None, *, deterministic: bool) -> None:
    """See that a time limit makes sense.

    Raises
    ------
    SettingsError
        Saying what does not.
    """
    if seconds is None:
        return
    if not (math.isfinite(seconds) and seconds > 0):
        raise SettingsError(
            f"the time limit of the full adjustment must be more than 0 s, got {seconds}"
        )
    if deterministic:
        raise SettingsError(
            "deterministic mode takes no time limit for the full adjustment: what is reached in a "
            "given time differs from run to run"
        )


class FullAdjustment:
    """Refines the whole map on demand; the fourth worker.

    Solving works on a copy and stops nobody. To write the result back, mapping stands still for a
    moment; keyframes and points made meanwhile follow those they hang on.

    Parameters
    ----------
    world : orbslam2py._core.Map
        The map.
    mapping : Worker
        Stands still while the result is written.
    options : FullAdjustmentOptions
        Iterations and time limit.
    monocular : bool
        The map has no scale of its own.
    threaded : bool
        In a thread of its own, or inline.
    on_done : callable
        ``on_done(record)``, after each one.
    """

    def __init__(
        self,
        world: core.Map,
        mapping: Worker[int],
        options: FullAdjustmentOptions,
        *,
        monocular: bool,
        threaded: bool,
        on_done: Callable[[FullAdjustmentRecord], None],
    ) -> None:
        self._map = world
        self._mapping = mapping
        self._monocular = monocular
        self.options = options
        self._on_done = on_done
        #: One core is left for tracking; a single thread gives the same bytes in every run.
        self._n_threads = min(4, max(1, (os.cpu_count() or 1) // 2)) if threaded else 1
        #: 0 for the first map; grows with every reset.
        self.map_index = 0
        #: All that were begun, also those given up.
        self.records: list[FullAdjustmentRecord] = []
        #: Milliseconds per step.
        self.statistics = StageStatistics()
        self._numbers = itertools.count()
        self._latest: tuple[int, FullAdjustmentRecord] | None = None
        #: Its jobs are numbers that tell one adjustment from another.
        self.worker: Worker[int] = Worker(
            "full bundle adjustment", self._process, threaded=threaded
        )

    def start(self) -> int:
        """Begin one; a running one is given up. Returns its number."""
        self.cancel()
        number = next(self._numbers)
        self.worker.submit(number)
        return number

    def start_and_wait(self) -> FullAdjustmentRecord:
        """Begin one, and wait for its end.

        It is given up when the worker is to stand still for longer (localization mode), and when
        another one, a reset or the shutdown takes its place, maybe before it has begun: then
        nothing is counted in its record.
        """
        number = self.start()
        worker = self.worker
        try:
            worker.wait_until(
                lambda: worker.idle or worker.held or worker.state is WorkerState.FAILED
            )
        except KeyboardInterrupt:
            self.cancel()
            raise
        worker.raise_if_failed()
        if worker.held:
            self.cancel()
        latest = self._latest
        if latest is not None and latest[0] == number:
            return latest[1]
        return FullAdjustmentRecord(self.map_index, 0, 0, 0, 0, 0.0, 0.0, used=False)

    @contextlib.contextmanager
    def kept_away(self) -> Iterator[None]:
        """Give up a running one, and let none begin or end meanwhile.

        For those that are about to move the map themselves: one that somebody else asks for waits.
        """
        with self.worker.pause(brief=True):
            self.cancel()
            yield

    def cancel(self, timeout: float | None = None) -> None:
        """Give up a running one. On return it will not touch the map any more."""
        self.worker.reset(timeout)

    def run(self) -> FullAdjustmentRecord:
        """Do one now, in the caller's thread; for when the workers have ended."""
        return self._adjust(self.map_index, core.StopFlag())

    def _refine_newest(self, cancelled: core.StopFlag) -> None:
        """Fit keyframes that were made meanwhile, and only moved along, to the refined map."""
        newest = int(core.snapshot_keyframes(self._map).ids[-1])
        core.local_bundle_adjustment(self._map, newest, cancelled, self._monocular)

    def _process(self, number: int) -> None:
        self._latest = number, self._adjust(self.map_index, self.worker.cancel_flag)

    def _adjust(self, map_index: int, cancelled: core.StopFlag) -> FullAdjustmentRecord:
        timer = StageTimer()
        options = core.GlobalBundleOptions(
            iterations=self.options.iterations, max_seconds=self.options.time_limit or 0.0
        )
        with self.worker.off_duty():
            with timer("gather"):
                bundle = core.gather_global_bundle(self._map)
            with timer("solve"):
                summary = core.solve_global_bundle(bundle, options, cancelled, self._n_threads)
        used = False
        if not (summary.aborted or cancelled.is_set()):
            with self._mapping.pause(brief=True) as ticket:
                with timer("wait"):
                    ticket.wait()
                with timer("commit"):
                    commit = core.commit_global_bundle(self._map, bundle)
                used = commit.committed
                if commit.n_followed_keyframes > 0:
                    with timer("local"):
                        self._refine_newest(cancelled)
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
            *(record.n_keyframes, record.n_points, record.iterations),
            "used" if used else "given up",
        )
        self._on_done(record)
        return record
