# SPDX-License-Identifier: BSD-3-Clause
"""Runs one after the other, or in several processes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

import cv2

from benchmarks.inertial.cases import Case
from benchmarks.inertial.judgement import Row, rows_of


def played(case: Case, chips: Sequence[str], config: Mapping[str, Any]) -> list[Row]:
    """Play and judge a case, in one thread."""
    cv2.setNumThreads(1)
    return rows_of(case, chips, config)


def all_rows(
    chosen: Sequence[Case], chips: Sequence[str], jobs: int, config: Mapping[str, Any]
) -> Iterator[list[Row]]:
    """Rows of each case, as they are done."""
    if jobs == 1:
        yield from (played(case, chips, config) for case in chosen)
        return
    # Not fork: the extension may have started threads.
    pool = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"))
    try:
        for future in as_completed([pool.submit(played, case, chips, config) for case in chosen]):
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)
