# SPDX-License-Identifier: BSD-3-Clause
"""How many processor cores there are for this process."""

from __future__ import annotations

import os


def n_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def n_threads(most: int) -> int:
    """Threads for work that can be divided: at most so many, one a core, and as many as are wanted.

    ``OMP_NUM_THREADS`` says what is wanted, here as for most libraries; a batch sets it in its
    workers, each of which has one core.

    Parameters
    ----------
    most : int
        As many can share the work.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "").split(",")[0].strip()  # one per nested level
    limit = int(wanted) if wanted.isdecimal() and int(wanted) > 0 else most
    return max(1, min(most, limit, n_cores()))
