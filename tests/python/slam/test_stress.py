# SPDX-License-Identifier: BSD-3-Clause
"""Everything at once, at random: the system under several threads that use it.

Lasts ORBSLAM2PY_STRESS_SECONDS (8); no control call may take ORBSLAM2PY_STRESS_PATIENCE (2)
seconds, a shutdown that processes what waits ten times that.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import os
import random
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import lru_cache

import numpy as np

from orbslam2py import Callbacks, Sensor, StateError, System, load_vocabulary
from orbslam2py.datasets import Images
from orbslam2py.settings import ImuSettings
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.synthetic.imu import T_CI
from support.watchdog import watchdog, worker_threads

SECONDS = float(os.environ.get("ORBSLAM2PY_STRESS_SECONDS", "8"))
PATIENCE = float(os.environ.get("ORBSLAM2PY_STRESS_PATIENCE", "2"))
#: A turn on the spot, which closes a loop.
LAP = 150


@lru_cache
def sequence() -> SyntheticSequence:
    return SyntheticSequence(
        SyntheticOptions(
            world="room", sensor=Sensor.RGBD, frames=LAP, fps=LAP / 30, size=(320, 240)
        )
    )


@lru_cache(maxsize=LAP)
def images(index: int) -> Images:
    return sequence().load(index)


class Patience:
    """Notes which calls took too long."""

    def __init__(self) -> None:
        self.late: list[str] = []
        self.slowest: dict[str, float] = {}

    @contextlib.contextmanager
    def __call__(self, name: str, factor: float = 1.0) -> Iterator[None]:
        limit = factor * PATIENCE
        timer = threading.Timer(limit, self._expired, (name, limit))
        timer.daemon = True
        timer.start()
        begin = time.monotonic()
        try:
            yield
        finally:
            timer.cancel()
            taken = time.monotonic() - begin
            self.slowest[name] = max(taken, self.slowest.get(name, 0.0))

    def _expired(self, name: str, limit: float) -> None:
        self.late.append(f"{name} took more than {limit} s")
        faulthandler.dump_traceback()


class Session:
    """One system, from its start to its shutdown, and those who use it."""

    def __init__(self, seed: int, patience: Patience, counts: Counter[str]) -> None:
        self._seed = seed
        self._patience = patience
        self._counts = counts
        self._done = threading.Event()
        self._now = 0.0
        self.errors: list[BaseException] = []
        self.system = System(
            sequence().settings,
            Sensor.RGBD,
            load_vocabulary(None),
            wait_for_mapping=True,
            seed=seed,
            imu=ImuSettings(2e-4, 2e-3, 2e-5, 1e-3, T_ci=T_CI),
            callbacks=Callbacks(on_keyframe=self._look, on_map_change=self._count_change),
        )

    def run(self, seconds: float, *, drain: bool) -> None:
        users = (self._track, self._measure, self._switch, self._optimize, self._watch)
        threads = [threading.Thread(target=self._guarded, args=(user,)) for user in users]
        for thread in threads:
            thread.start()
        self._done.wait(seconds)
        with self._patience("drained shutdown" if drain else "shutdown", 10 if drain else 1):
            self.system.shutdown(drain=drain)  # while the others go on
        self._done.set()
        for thread in threads:
            thread.join(30)
            assert not thread.is_alive()
        assert self.system.check_map() == []
        self._counts["loops"] += self.system.n_loops_closed
        self._counts["resets"] += self.system.n_resets
        adjustments = self.system.full_adjustments
        self._counts["adjustments used"] += sum(record.used for record in adjustments)
        self._counts["adjustments given up"] += sum(not record.used for record in adjustments)

    def _guarded(self, user: Callable[[random.Random], None]) -> None:
        try:
            user(random.Random(self._seed))
        except StateError as error:
            if "shut down" not in str(error):
                self.errors.append(error)
        except BaseException as error:
            self.errors.append(error)
            self._done.set()

    # ---- users, each in a thread of its own ------------------------------------------------------
    def _track(self, rng: random.Random) -> None:
        index, frame = rng.randrange(LAP), 0
        localized = False
        while not self._done.is_set():
            wanted = self.system.localization_mode
            self._counts["switches"] += wanted != localized
            localized = wanted
            index += -1 if wanted else 1  # turns back, so as to stay in the map
            frame += 1
            shown = images(index % LAP)
            assert shown.depth is not None
            self._now = float(frame)
            with self._patience("track"):
                self.system.track_rgbd(shown.image, shown.depth, float(frame))
            self._counts["frames"] += 1

    def _measure(self, rng: random.Random) -> None:
        """Samples of a still IMU: late, doubled, out of order, not finite, or with gaps."""
        reached = 0.0
        while not self._done.wait(rng.uniform(0, 0.05)):
            until = self._now + rng.uniform(0, 2)
            t = np.arange(reached - rng.choice([0, 0, 0.5]), until, 0.02)
            rows = np.column_stack([t, np.full((len(t), 6), [0, 0, 0, 0, 0, 9.81])])
            fault = rng.randrange(10)
            if fault == 0:
                rows = rows[::-1]
            elif fault == 1:
                rows[: len(rows) // 2] = np.nan
            elif fault == 2:
                rows = rows[len(rows) // 2 :]
            reached = max(reached, until)
            with self._patience("samples"):
                self.system.add_imu(rows)
            assert self.system.imu_check is not None
            self._counts[f"IMU {self.system.imu_check.verdict}"] += 1

    def _switch(self, rng: random.Random) -> None:
        while not self._done.wait(rng.uniform(0, 0.3)):
            action = rng.randrange(20)
            with self._patience("request"):
                if self.system.localization_mode:
                    self.system.localization_mode = False
                elif action < 3:
                    self.system.localization_mode = True
                elif action < 4:
                    self.system.reset()

    def _optimize(self, rng: random.Random) -> None:
        while not self._done.wait(rng.uniform(0, 0.5)):
            try:
                self.system.optimize()
            except StateError as error:
                if "localization" not in str(error):
                    raise
            else:
                self._counts["optimized"] += 1

    def _watch(self, rng: random.Random) -> None:
        system = self.system
        looks: list[Callable[[], object]] = [
            *(system.map_snapshot, system.trajectory, system.trajectories),
            *(system.keyframe_trajectory, system.stage_statistics, system.map_hash),
            lambda: system.wait_until_idle(0.05),
        ]
        while not self._done.wait(rng.uniform(0, 0.1)):
            look = rng.choice(looks)
            with self._patience(getattr(look, "__name__", "look")):
                look()
            violations = system.check_map()
            assert violations == [], violations
            self._counts["looks"] += 1

    # ---- callbacks -------------------------------------------------------------------------------
    def _look(self, _event: object) -> None:
        self._counts["keyframes"] += 1
        with self._patience("look of a callback"):
            self.system.map_snapshot()

    def _count_change(self, _event: object) -> None:
        self._counts["changes"] += 1


def test_everything_at_once() -> None:
    before = worker_threads()
    patience, counts = Patience(), Counter[str]()
    for index in range(LAP):
        images(index)
    rng = random.Random(1)
    with watchdog(10 * SECONDS + 120):
        begin = time.monotonic()
        seed = 0
        needed = ("frames", "switches", "resets", "optimized", "looks", "changes")

        def enough() -> bool:
            # On a slow machine it takes longer until everything has happened.
            all_seen = all(counts[what] for what in needed)
            return time.monotonic() - begin > (1 if all_seen else 8) * SECONDS

        while not enough():
            session = Session(seed, patience, counts)
            session.run(rng.uniform(1, 5), drain=rng.random() < 0.5)
            assert session.errors == []
            seed += 1
            del session
    gc.collect()
    assert worker_threads() == before
    print(dict(counts), {name: round(s, 3) for name, s in patience.slowest.items()})
    assert patience.late == []
    assert [what for what in needed if not counts[what]] == []
