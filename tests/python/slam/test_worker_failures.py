# SPDX-License-Identifier: BSD-3-Clause
"""Workers that fail."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from orbslam2py import WorkerError
from orbslam2py._worker import Worker, WorkerState
from support.worker_steps import NAME, eventually, failing

pytestmark = pytest.mark.watchdog(10)


@pytest.fixture
def failed() -> Iterator[Worker[int]]:
    worker = Worker(NAME, failing, threaded=True)
    worker.start()
    worker.submit(0)
    assert worker.wait_until_idle(10)
    worker.submit(1)
    eventually(lambda: worker.state is WorkerState.FAILED)
    yield worker
    with pytest.raises(WorkerError):
        worker.finish(timeout=10)


@pytest.mark.parametrize(
    "call",
    [
        lambda worker: worker.submit(2),
        lambda worker: worker.raise_if_failed(),
        lambda worker: worker.wait_until_idle(10),
        lambda worker: worker.wait_until_waiting(at_most=0),
        lambda worker: worker.finish(drain=True, timeout=10),
        lambda worker: worker.finish(timeout=10),
    ],
    ids=["submit", "raise_if_failed", "wait_until_idle", "wait_until_waiting", "drain", "finish"],
)
def test_a_failure_arrives_with_its_cause(
    failed: Worker[int], call: Callable[[Worker[int]], object]
) -> None:
    for _ in range(2):  # and again: it is not forgotten
        with pytest.raises(WorkerError, match=f"{NAME} stopped: bad job") as caught:
            call(failed)
        assert isinstance(caught.value.__cause__, ValueError)


def test_failure_ends_those_who_wait() -> None:
    worker = Worker(NAME, failing, threaded=True)
    worker.start()
    with worker.pause():
        worker.submit(1)
        worker.submit(2)
        waiting = threading.Event()
        raised: list[BaseException] = []

        def wait() -> None:
            waiting.set()
            try:
                worker.wait_until_idle()
            except WorkerError as error:
                raised.append(error)

        thread = threading.Thread(target=wait)
        thread.start()
        assert waiting.wait(10)
    thread.join(10)
    assert not thread.is_alive()
    assert len(raised) == 1
    with pytest.raises(WorkerError):
        worker.finish(timeout=10)


def test_reset_of_a_failed_worker_does_not_wait(failed: Worker[int]) -> None:
    failed.reset(10)
    assert failed.state is WorkerState.FAILED, "a reset does not bring the thread back"


def test_exception_without_text_is_named() -> None:
    worker = Worker(NAME, lambda _: (_ for _ in ()).throw(KeyError()), threaded=False)
    with pytest.raises(WorkerError, match="KeyError"):
        worker.submit(0)


def test_failure_of_a_later_worker_keeps_the_original_cause() -> None:
    last = Worker("last", failing, threaded=False)
    first = Worker(NAME, last.submit, threaded=False)
    with pytest.raises(WorkerError, match="last stopped: bad job") as caught:
        first.submit(1)
    assert isinstance(caught.value.__cause__, ValueError)
