# SPDX-License-Identifier: BSD-3-Clause
"""The workers of a batch, checked before the start."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from orbslam2py._arguments import is_whole, shown
from orbslam2py.batches.sizes import bytes_of
from orbslam2py.errors import SettingsError

#: A worker takes 110 MB before its first run, and 170 MB in a short one of 640 x 480 pixels. Dask
#: gives none work that fills 80 % of its limit: with less it would wait for ever, or be killed.
LEAST_MEMORY = 500 * 10**6
_LARGEST_PORT = 65535
_ADDRESS = re.compile(r"(?:tcp://)?(?:[^\s/:\[\]]+|\[[0-9A-Fa-f:.%\w]+\]):([0-9]{1,5})/?")
#: Dask knows more protocols (``tls``, ``ws``, ``inproc``), some with addresses of another form;
#: what is none of them is said by it.
_OTHER_PROTOCOL = re.compile(r"(?!tcp://)[a-z]+://\S+")


@dataclass(frozen=True)
class Workers:
    """The workers of a batch.

    Attributes
    ----------
    scheduler
        Address of a running scheduler; None: the batch starts its own workers.
    count
        Number of workers to start; None: one per core; 0: none, this process makes the runs.
    memory_limit
        Limit for each started worker, in bytes; None: an equal share of the computer's memory.
    """

    scheduler: str | None = None
    count: int | None = None
    memory_limit: int | None = None

    @property
    def is_this_process(self) -> bool:
        """Whether no workers are needed."""
        return self.scheduler is None and self.count == 0

    @classmethod
    def of(cls, scheduler: Any, count: Any, memory_limit: Any) -> Workers:
        """Check the arguments of a caller.

        Parameters
        ----------
        scheduler, count
            As the attributes.
        memory_limit
            A size such as ``4GB``, or None.

        Raises
        ------
        SettingsError
            If a value is invalid, or useless together with the others.
        """
        if scheduler is not None:
            _require_address(scheduler)
        if count is not None and (not is_whole(count) or count < 0):
            raise SettingsError(
                f"the number of workers (--workers) is {shown(count)}; give a whole number from 0, "
                "or leave it out for one a core"
            )
        if count is not None and scheduler is not None:
            raise SettingsError(
                f"--workers {count} has no meaning with --scheduler {scheduler}, which has workers "
                "of its own; leave one of them out"
            )
        made = cls(
            scheduler,
            None if count is None else int(count),
            None if memory_limit is None else _memory_of(memory_limit),
        )
        if made.memory_limit is not None and scheduler is not None:
            raise SettingsError(
                f"--memory-limit {memory_limit} has no meaning with --scheduler {scheduler}, whose "
                "workers have limits of their own; leave it out, and give it to 'dask worker'"
            )
        if made.memory_limit is not None and made.is_this_process:
            raise SettingsError(
                f"--memory-limit {memory_limit} has no meaning with --workers 0, which runs all in "
                "this process; leave it out, or give --workers 1"
            )
        return made


def _memory_of(limit: Any) -> int:
    what = "the memory of a worker (--memory-limit)"
    return bytes_of(limit, what, "4GB", LEAST_MEMORY)


def _require_address(scheduler: Any) -> None:
    if isinstance(scheduler, str):
        found = _ADDRESS.fullmatch(scheduler)
        if found and 0 < int(found[1]) <= _LARGEST_PORT:
            return
        if _OTHER_PROTOCOL.fullmatch(scheduler):
            return
    raise SettingsError(
        f"the scheduler (--scheduler) is {shown(scheduler)}; give an address such as "
        "tcp://10.0.0.1:8786, which 'dask scheduler' prints, or leave it out to work on this "
        "computer"
    )
