# SPDX-License-Identifier: BSD-3-Clause
"""Runs one after the other, or in several processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import cv2

from benchmarks.holding_on.judgement import judge
from benchmarks.holding_on.play import play
from benchmarks.holding_on.results import Row, row_of
from benchmarks.holding_on.scene import Case


def played_row(case: Case, changes: Mapping[str, Any] | None = None) -> Row:
    """Play and judge a case, with changes of the configuration."""
    cv2.setNumThreads(1)
    return row_of(case, judge(play(case, changes)))


def all_rows(
    cases: Sequence[Case], jobs: int, changes: Mapping[str, Any] | None = None
) -> Iterator[Row]:
    """Rows as they are done."""
    if jobs == 1:
        yield from (played_row(case, changes) for case in cases)
        return
    # Not fork: the extension may have started threads.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        for future in as_completed([pool.submit(played_row, case, changes) for case in cases]):
            yield future.result()
    finally:
        # Interrupted, it ends with the runs that have begun.
        pool.shutdown(cancel_futures=True)
