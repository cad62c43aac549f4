# SPDX-License-Identifier: BSD-3-Clause
"""Forcing the order in which threads do things, without sleeping."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import System, _core
from orbslam2py._worker import Worker

#: Seconds after which something that should happen is held to have hung.
LIMIT = 15.0


class Call:
    """A call in a thread of its own."""

    def __init__(self, function: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        self._result: Any = None
        self._error: BaseException | None = None

        def run() -> None:
            try:
                self._result = function(*arguments, **options)
            except BaseException as error:
                self._error = error

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        return self._thread.is_alive()

    def result(self) -> Any:
        """Wait for the end; raises what the call raised."""
        self._thread.join(LIMIT)
        assert not self._thread.is_alive(), "the call has not ended"
        if self._error is not None:
            raise self._error
        return self._result


class Gate:
    """Stands before a function: tells when it is called, and holds the call until opened."""

    def __init__(self, function: Callable[..., Any], journal: list[str], name: str) -> None:
        self._function = function
        self._journal = journal
        self._name = name
        self._entered = threading.Semaphore(0)
        self._open = threading.Event()
        self.error: Exception | None = None

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        self._journal.append(f"{self._name} begins")
        self._entered.release()
        assert self._open.wait(2 * LIMIT)
        if self.error is not None:
            raise self.error
        result = self._function(*arguments, **options)
        self._journal.append(f"{self._name} ends")
        return result

    def wait_entered(self) -> None:
        assert self._entered.acquire(timeout=LIMIT), f"{self._name} was not called"

    def is_entered(self, timeout: float) -> bool:
        return self._entered.acquire(timeout=timeout)

    def open(self) -> None:
        self._open.set()


class Stage:
    """Gates before functions of the core, and stand-ins for the steps of a loop's correction."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._patch = monkeypatch
        self._gates: list[Gate] = []
        #: Names of the gated functions, as they began and ended.
        self.journal: list[str] = []

    def gate(self, verb: str, *, opened: bool = False) -> Gate:
        """Put a gate before a function of the core."""
        gate = Gate(getattr(_core, verb), self.journal, verb)
        self._gates.append(gate)
        self._patch.setattr(_core, verb, gate)
        if opened:
            gate.open()
        return gate

    def entering(self, owner: object, method: str) -> threading.Event:
        """An event that is set when a method of an object is called."""
        event = threading.Event()
        function = getattr(owner, method)

        def wrapped(*arguments: Any, **options: Any) -> Any:
            event.set()
            return function(*arguments, **options)

        self._patch.setattr(owner, method, wrapped)
        return event

    def waitable_cancel(self, worker: Worker[Any]) -> threading.Event:
        """Replace a worker's cancel flag by one that stand-ins of the core can wait for."""
        flag = threading.Event()
        self._patch.setattr(worker, "cancel_flag", flag)
        return flag

    def endless_solve(self) -> Gate:
        """A full adjustment that is solved until it is cancelled."""

        def solve(_bundle: object, _options: object, flag: threading.Event, _n: int) -> object:
            assert flag.wait(2 * LIMIT), "nobody cancelled"
            return SimpleNamespace(aborted=True, iterations=0, initial_cost=1.0, final_cost=1.0)

        self._patch.setattr(_core, "solve_full_bundle", solve)
        return self.gate("solve_full_bundle", opened=True)

    def loops(self, system: System, *, far: int = 0) -> Callable[[int], None]:
        """Make loops to keyframe `far` on demand: the function returned queues a keyframe that
        closes one. The steps of the correction are stand-ins that count a big change."""
        closing = system.pipeline.back_end.loop_closing
        wanted: set[int] = set()

        def find(keyframe: int, _timer: object) -> object:
            if keyframe not in wanted:
                return None
            return SimpleNamespace(
                current=keyframe, matched=far, n_inliers=40, n_matches=160, S_cm=np.eye(4)
            )

        def apply(world: _core.Map, _correction: object) -> object:
            world.count_big_change()
            return SimpleNamespace(
                applied=True, n_fused=5, translation=0.1, rotation=0.0, scale=1.0
            )

        self._patch.setattr(closing, "_find_loop", find)
        self._patch.setattr(_core, "plan_loop_correction", lambda *_: "correction")
        self._patch.setattr(
            _core,
            "optimize_essential_graph",
            lambda _correction, flag: SimpleNamespace(aborted=flag.is_set()),
        )
        self._patch.setattr(_core, "apply_loop_correction", apply)

        def close(keyframe: int) -> None:
            wanted.add(keyframe)
            closing.worker.submit(keyframe)

        return close

    def open_all(self) -> None:
        for gate in self._gates:
            gate.open()


def last_keyframe(slam: System) -> int:
    return int(slam.pipeline.back_end.map.keyframe_ids()[-1])


def refine(slam: System) -> None:
    """Ask for a full adjustment, as a loop does."""
    slam.pipeline.back_end.adjustment.start()


def settle(slam: System) -> None:
    assert slam.pipeline.back_end.wait_until_idle(LIMIT)
    assert slam.check_map() == []
