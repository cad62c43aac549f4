# SPDX-License-Identifier: BSD-3-Clause
"""The process of the page, from the side of tracking: start, messages, answers, end."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from typing import Any

from orbslam2py._files import describe_error
from orbslam2py.errors import OrbSlamError, StateError
from orbslam2py.viewer.process.channel import SLICE, Channel

_log = logging.getLogger(__name__)

#: What the other process runs. The path is that of this one: the same package is found.
_CODE = (
    "import sys; number = int(sys.argv[1]); sys.path[:] = sys.argv[2:]; "
    "from orbslam2py.viewer.process.serve import main; main(number)"
)
#: Large messages that may wait until they are drawn: one that is, and one to go on with.
_AT_ONCE = 2
#: Slices of time in which one of them must be drawn: whoever takes longer hangs. It is
#: given only the time that others leave.
_PATIENCE = round(60 / SLICE)
#: Seconds for starting (its libraries are large, and disks can be slow), and for ending.
_START, _END = 60.0, 5.0


class CompanionError(OrbSlamError):
    """The other process has ended, or does not answer."""


class Companion:
    """A process that draws the data of this one, and forwards the user's requests.

    It has a low priority, ends with this process in any case, and ignores Ctrl-C.

    Parameters
    ----------
    host, port, title, stand_back
        See `LiveView`.
    answers : mapping of str to callable
        Requests that it may make to this process; each call is made in a separate thread.
    on_end : callable
        Called at its end, in a separate thread; again after a request that was still running.

    Attributes
    ----------
    address : str
        Address of the page.
    ended : threading.Event
        Set after its end.

    Raises
    ------
    StateError
        If it cannot start, or the page cannot be served there.
    """

    def __init__(
        self,
        *,
        host: str,
        port: int | None,
        title: str,
        stand_back: bool,
        answers: Mapping[str, Callable[..., object]],
        on_end: Callable[[], None],
    ) -> None:
        self._answers = answers
        self._on_end = on_end
        self.ended = threading.Event()
        self._condition = threading.Condition()
        self._n_waiting = 0
        self._why = ""
        self._opened: tuple[str, str] | None = None
        ours, theirs = socket.socketpair()
        with theirs:
            try:
                self._process = _start(theirs)
            except OSError as error:
                ours.close()
                raise StateError(
                    f"the viewer's process cannot be started: {describe_error(error)}"
                ) from error
        self._channel = Channel(ours)
        self._reader = threading.Thread(target=self._read, name="viewer page", daemon=True)
        self._reader.start()
        try:
            self.address = self._open(host, port, title, stand_back)
        except BaseException:  # a Ctrl-C as well
            self.stop()
            raise

    @property
    def process_id(self) -> int:
        """Of the other process."""
        return self._process.pid

    @property
    def why(self) -> str:
        """Why it has ended, as text."""
        return self._why

    def _open(self, *wishes: str | int | None) -> str:
        with contextlib.suppress(CompanionError):  # reported below
            self.tell("open", *wishes)
        with self._condition:
            self._condition.wait_for(
                lambda: self._opened is not None or self.ended.is_set(), _START
            )
            opened = self._opened
        if opened is not None and opened[0] == "opened":
            return opened[1]
        if opened is not None:
            raise StateError(opened[1])
        raise StateError(f"the viewer could not be started: {self._why or 'it does not answer'}")

    # ---- to the other process --------------------------------------------------------------------
    def tell(self, *message: Any) -> None:
        """Send a small message immediately.

        Raises
        ------
        CompanionError
            If it has ended.
        """
        try:
            self._channel.send(*message)
        except TimeoutError:
            self._give_up()
        except OSError:
            self.ended.wait(_END)  # the reader learns why
        else:
            return
        raise CompanionError(self._why or "its process has ended")

    def show(self, *message: Any) -> None:
        """Send data for drawing; waits until all earlier messages except one are processed.

        So messages do not accumulate, and a slow page gets fewer of them.

        Raises
        ------
        CompanionError
            If it has ended, or does not answer.
        """
        with self._condition:
            for _ in range(_PATIENCE):
                if self._condition.wait_for(self._has_room, SLICE):
                    break
            else:
                self._give_up()
            if self.ended.is_set():
                raise CompanionError(self._why)
            self._n_waiting += 1
        self.tell(*message)

    def _has_room(self) -> bool:
        return self._n_waiting < _AT_ONCE or self.ended.is_set()

    def _give_up(self) -> None:
        self._why = "its process does not answer"
        self._process.kill()
        raise CompanionError(self._why)

    def stop(self) -> None:
        """End it; may be called again."""
        try:
            if not self.ended.is_set():
                self.tell("stop")
        except CompanionError:
            pass  # it is gone, which was wanted
        try:
            self._process.wait(_END)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    # ---- from the other process, in a thread of its own ------------------------------------------
    def _read(self) -> None:
        while (message := self._channel.receive()) is not None:
            self._take(*message)
        try:
            code = self._process.wait(_END)
        except subprocess.TimeoutExpired:  # it has closed its end, and hangs
            self._process.kill()
            code = self._process.wait()
        with self._condition:
            self._why = self._why or _words_of(code)
            self.ended.set()
            self._condition.notify_all()
        self._channel.close()
        self._on_end()

    def _take(self, kind: str, *content: Any) -> None:
        if kind == "ask":
            threading.Thread(target=self._answer, args=content, name="viewer request").start()
        elif kind == "log":
            name, level, text = content
            logging.getLogger(name).log(level, "%s", text)
        else:
            with self._condition:
                if kind == "done":
                    self._n_waiting -= 1
                elif kind == "failed":
                    (self._why,) = content
                else:
                    self._opened = (kind, *content)
                self._condition.notify_all()

    def _answer(self, number: int, name: str, arguments: tuple[Any, ...]) -> None:
        answer: object = None
        try:
            answer = self._answers[name](*arguments)
        except Exception as error:
            # As for a button in this process: the run goes on, and it is said why nothing came.
            _log.warning("the viewer's %s failed: %s", name, describe_error(error))
            _log.debug("in full:", exc_info=error)
        try:
            self.tell("answer", number, answer)
        except CompanionError as error:
            _log.debug("nobody to answer: %s", error)
            self._on_end()  # again: what was asked last may be a pause


def _start(end: socket.socket) -> subprocess.Popen[bytes]:
    number = end.fileno()
    environment = dict(os.environ)
    for library in ("OMP", "OPENBLAS", "MKL"):
        environment[f"{library}_NUM_THREADS"] = "1"  # all cores are tracking's
    command = [sys.executable, "-c", _CODE, str(number), *sys.path]
    # The mask is inherited: a Ctrl-C does not reach the other one, not even while it starts.
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            pass_fds=[number],
            env=environment,
        )
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _words_of(code: int) -> str:
    if code >= 0:
        return "its process has ended"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    return f"its process was ended by {name}"
