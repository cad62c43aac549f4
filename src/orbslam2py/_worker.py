# SPDX-License-Identifier: BSD-3-Clause
"""Workers: one thread around one step.

With counted pauses, a reset in every state, waits with a limit, and errors that reach the caller.

There are no deadlocks: pauses are counted tickets, a reset is also acknowledged during a pause, and
no lock of the map is held while waiting. A worker can also run inline (``threaded=False``): the
same steps in the caller's thread, so that two runs are equal. Then callers in several threads take
turns. The whole protocol: ``docs/method/threads.md#workers``.
"""

from __future__ import annotations

import contextlib
import enum
import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Generic, TypeVar

from orbslam2py import _core as core
from orbslam2py._turn import Turn
from orbslam2py._waiting import WAIT_SLICE
from orbslam2py.errors import StateError, WorkerError

_log = logging.getLogger(__name__)

Job = TypeVar("Job")


class WorkerState(enum.Enum):
    """The state of a worker."""

    IDLE = "idle"
    BUSY = "busy"
    PAUSED = "paused"
    FINISHED = "finished"
    FAILED = "failed"


class PauseTicket:
    """One holder of a worker's pause; the worker resumes when all tickets are released.

    A ticket may be released several times; it is a context manager.
    """

    def __init__(self, release: Callable[[], None], wait: Callable[[float | None], bool]) -> None:
        self._release = release
        self._wait = wait
        self._released = False

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the worker is paused; False if `timeout` seconds are over first."""
        return self._wait(timeout)

    def release(self) -> None:
        """Give the ticket back."""
        if not self._released:
            self._released = True
            self._release()

    def __enter__(self) -> PauseTicket:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class Worker(Generic[Job]):
    """A queue and a step that processes one job at a time from it.

    Parameters
    ----------
    name : str
        Name of the thread, used in messages.
    step : callable
        ``step(job)``; an exception in it stops the worker and is raised as `WorkerError` by
        `raise_if_failed`, `submit` and `finish`.
    threaded : bool
        False: `submit` runs the steps in the caller's thread.
    """

    def __init__(self, name: str, step: Callable[[Job], None], *, threaded: bool) -> None:
        self.name = name
        self._step = step
        self._threaded = threaded
        self._condition = threading.Condition()
        self._queue: deque[Job] = deque()
        self._busy = False
        self._off_duty = False
        self._pauses = 0
        self._holds = 0  # those of the pauses that may last
        self._finish_requested = False
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._inline_in: int | None = None  # the thread that a step runs in for its caller
        self._turn = Turn()  # of inline steps
        #: Raised when the running step should end early; lowered when a step begins.
        self.interrupt_flag = core.StopFlag()
        #: Raised when the result of the running step is no longer needed (reset, finish).
        self.cancel_flag = core.StopFlag()
        #: Raised while jobs wait behind the running one.
        self.waiting_flag = core.StopFlag()

    # ---- life cycle ------------------------------------------------------------------------------
    def start(self) -> None:
        """Start the thread (nothing to do for an inline worker)."""
        if self._threaded and self._thread is None:
            self._thread = threading.Thread(target=self._run, name=self.name, daemon=True)
            self._thread.start()

    def finish(self, *, drain: bool = False, timeout: float | None = None) -> None:
        """End the worker and join its thread.

        Parameters
        ----------
        drain : bool
            Process the waiting jobs first; otherwise they are dropped and the running step is asked
            to end early. If its pause may be long, it does not wait for the end of the pause, but
            drops them.
        timeout : float, optional
            Seconds to wait for the jobs, and again for the thread.

        Raises
        ------
        WorkerError
            If a step failed, now or earlier, or the thread did not end in time.
        """
        thread = self._thread  # others may call this at the same time
        if thread is threading.current_thread():
            thread = None  # a step ends its worker, and cannot wait for itself
        if drain and thread is not None:
            self.wait_until(
                lambda: self._error is not None or self._is_idle() or self.held, timeout
            )
        with self._condition:
            self._finish_requested = True
            self._queue.clear()
            self.waiting_flag.clear()
            self.interrupt_flag.set()
            self.cancel_flag.set()
            self._condition.notify_all()
        if not self._threaded and not self.wait_until(self._is_idle_elsewhere, timeout):
            raise WorkerError(f"{self.name} did not end within {timeout} s")
        if thread is not None:
            deadline = None if timeout is None else time.monotonic() + timeout
            while thread.is_alive():
                thread.join(WAIT_SLICE)
                if deadline is not None and time.monotonic() > deadline and thread.is_alive():
                    raise WorkerError(f"{self.name} did not end within {timeout} s")
            self._thread = None
        self.raise_if_failed()

    def reset(self, timeout: float | None = None) -> None:
        """Drop all waiting jobs and wait until the running step has ended, paused or not.

        The map is safe from a step that is off duty; nobody waits for it.
        """
        with self._condition:
            self._queue.clear()
            self.waiting_flag.clear()
            if self._busy:
                self.interrupt_flag.set()
                self.cancel_flag.set()
            self._condition.notify_all()
        if not self.wait_until(self._leaves_map_alone, timeout):
            raise WorkerError(f"{self.name} did not acknowledge the reset within {timeout} s")

    # ---- jobs ------------------------------------------------------------------------------------
    def submit(self, *jobs: Job) -> None:
        """Append jobs, and ask a running step to end early; none begins before all are queued.

        Inline, all jobs are done at the return.

        Raises
        ------
        StateError
            After `finish`.
        WorkerError
            If a step has failed.
        """
        if not self.offer(*jobs):
            raise StateError(f"{self.name} has been shut down")

    def offer(self, *jobs: Job) -> bool:
        """Like `submit`, for work that may be dropped at the end: then it returns False."""
        self.raise_if_failed()
        with self._condition:
            if self._finish_requested:
                return False
            if not jobs:
                return True
            self._queue.extend(jobs)
            self.waiting_flag.set()
            self.interrupt_flag.set()
            self._condition.notify_all()
        if not self._threaded:
            self._run_inline()
        return True

    def _run_inline(self) -> None:
        with self._turn:
            outer, self._inline_in = self._inline_in, threading.get_ident()
            try:
                while True:
                    with self._condition:
                        if not self._queue:
                            break
                        job = self._take()
                    self._step(job)
            except BaseException as error:
                with self._condition:
                    self._queue.clear()
                    self.waiting_flag.clear()
                if not isinstance(error, Exception):
                    raise  # Ctrl-C: it continues with the next job
                self._error = error
            finally:
                with self._condition:
                    self._inline_in = outer
                    self._busy = outer is not None
                    self._condition.notify_all()
        self.raise_if_failed()

    def _take(self) -> Job:
        job = self._queue.popleft()
        self._busy = True
        if not self._finish_requested:
            self.cancel_flag.clear()
        if not self._queue:
            self.waiting_flag.clear()
            self.interrupt_flag.clear()
        return job

    def interrupt(self) -> None:
        """Ask the running step to end early."""
        self.interrupt_flag.set()

    def lower_interrupt(self) -> bool:
        """Called by a step before its interruptible part.

        Returns
        -------
        bool
            False if the step should skip that part, because a job waits, a pause is requested or
            the worker should finish; otherwise the interrupt flag is cleared.
        """
        with self._condition:
            unwanted = self._finish_requested or self.cancel_flag.is_set()
            if self._queue or self._pauses or unwanted:
                return False
            self.interrupt_flag.clear()
            return True

    @contextlib.contextmanager
    def off_duty(self) -> Iterator[None]:
        """Used by a step around a long part that does not change the map.

        A pause or a reset does not wait for that part. At its end, the part waits for the end of
        the pause, or sets `cancel_flag` if the worker runs inline. Then the step must check that
        flag, and end if it is set.
        """
        with self._condition:
            self._off_duty = True
            self._condition.notify_all()
        try:
            yield
        finally:
            with self._condition:
                while self._threaded and self._pauses and not self.cancel_flag.is_set():
                    self._condition.wait(WAIT_SLICE)
                if not self._threaded and self._pauses:
                    # Another thread holds it, and may wait for the turn that this one has.
                    self.cancel_flag.set()
                self._off_duty = False

    def lend_turn(self) -> contextlib.AbstractContextManager[None]:
        """Let inline steps of other threads run during a callback of the user."""
        return self._turn.lent()

    # ---- pauses ----------------------------------------------------------------------------------
    def pause(self, *, brief: bool = False) -> PauseTicket:
        """Ask the worker to pause after the running step; see `PauseTicket`.

        An inline worker is paused whenever other code of its caller runs.

        Parameters
        ----------
        brief : bool
            Whether the ticket will certainly be released soon, so that others may wait for it.
        """
        lasting = 0 if brief else 1
        with self._condition:
            self._pauses += 1
            self._holds += lasting
            self.interrupt_flag.set()
            self._condition.notify_all()

        def release() -> None:
            with self._condition:
                self._pauses -= 1
                self._holds -= lasting
                self._condition.notify_all()

        return PauseTicket(release, lambda t: self.wait_until(self._leaves_map_alone, t))

    @property
    def pausing(self) -> bool:
        """Whether a pause is active or requested."""
        return self._pauses > 0

    @property
    def held(self) -> bool:
        """Whether a pause that may be long is active or requested."""
        return self._holds > 0

    # ---- state -----------------------------------------------------------------------------------
    @property
    def state(self) -> WorkerState:
        """The present state of the worker."""
        with self._condition:
            if self._error is not None:
                return WorkerState.FAILED
            if self._finish_requested and not self._busy:
                return WorkerState.FINISHED
            if self._busy:
                return WorkerState.BUSY
            return WorkerState.PAUSED if self._pauses else WorkerState.IDLE

    @property
    def threaded(self) -> bool:
        """Whether it has a separate thread."""
        return self._threaded

    @property
    def ended(self) -> bool:
        """Whether `finish` was called and no thread remains."""
        no_thread = self._thread is None and (self._threaded or self._is_idle_elsewhere())
        return self._finish_requested and no_thread

    @property
    def n_waiting(self) -> int:
        """Number of jobs that have not begun."""
        return len(self._queue)

    @property
    def idle(self) -> bool:
        """Whether no job waits and none is running."""
        with self._condition:
            return self._is_idle()

    def wait_until_waiting(self, at_most: int) -> None:
        """Wait while more than `at_most` jobs wait, or a brief pause lasts.

        Returns at once during a pause that may last long.
        """

        def done() -> bool:
            free = self._pauses == 0 and len(self._queue) <= at_most
            return free or self.held or self._error is not None

        self.wait_until(done)
        self.raise_if_failed()

    def wait_until_idle(self, timeout: float | None = None, *, unless_held: bool = False) -> bool:
        """Wait until every job is done; False if `timeout` seconds are over first.

        With `unless_held` also False as soon as there is a pause that may be long.
        """
        self.wait_until(
            lambda: self._is_idle() or self._error is not None or (unless_held and self.held),
            timeout,
        )
        self.raise_if_failed()
        return self.idle

    def raise_if_failed(self) -> None:
        """Raise `WorkerError`, with its cause, if a step has failed."""
        error = self._error
        if isinstance(error, WorkerError):
            # A later worker has failed, and this one when it handed a job on.
            raise WorkerError(str(error)) from error.__cause__
        if error is not None:
            raise WorkerError(
                f"{self.name} stopped: {str(error) or type(error).__name__}"
            ) from error

    def wait_until(self, condition: Callable[[], bool], timeout: float | None = None) -> bool:
        """Wait for a condition on the worker's state; False on time-out.

        Raises
        ------
        StateError
            If a step in this thread would have to end first, and no time is given.
        """
        deadline = None if timeout is None else time.monotonic() + timeout
        with self._condition:
            while not condition():
                if self._inline_in == threading.get_ident():
                    if timeout is not None:
                        return False
                    raise StateError(
                        f"{self.name} is at work in this very call, whose end cannot be waited "
                        "for within a callback; wait when the image has been tracked"
                    )
                left = WAIT_SLICE if deadline is None else deadline - time.monotonic()
                if left <= 0:
                    return False
                self._condition.wait(min(left, WAIT_SLICE))
        return True

    # ---- the thread ------------------------------------------------------------------------------
    def _is_idle(self) -> bool:
        return not self._queue and not self._busy

    def _leaves_map_alone(self) -> bool:
        return self._off_duty or self._is_idle_elsewhere()

    def _is_idle_elsewhere(self) -> bool:
        """Return whether no step runs, except the caller's, or one that has yielded its turn."""
        mine = self._inline_in == threading.get_ident()
        return not self._busy or mine or not (self._threaded or self._turn.owner == self._inline_in)

    def _run(self) -> None:
        while True:
            with self._condition:
                while not self._finish_requested and (self._pauses or not self._queue):
                    self._condition.wait()
                if self._finish_requested:
                    self._condition.notify_all()
                    return
                job = self._take()
                self._condition.notify_all()
            try:
                self._step(job)
            except BaseException as error:
                _log.exception("%s failed", self.name)
                with self._condition:
                    self._error = error
                    self._busy = False
                    self._queue.clear()
                    self._condition.notify_all()
                return
            with self._condition:
                self._busy = False
                self._condition.notify_all()


def take_turns(workers: Iterable[Worker[Any]]) -> None:
    """Prevents inline steps of these workers from running at once in different threads."""
    turn = Turn()
    for worker in workers:
        worker._turn = turn
