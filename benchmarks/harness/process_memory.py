# SPDX-License-Identifier: BSD-3-Clause
"""Memory of this process, in units of 10^6 bytes."""

from __future__ import annotations

import ctypes
from pathlib import Path


def resident_mb(*, trimmed: bool = False) -> float:
    """Resident memory now; `trimmed`: without what malloc only keeps for later."""
    if trimmed:
        ctypes.CDLL(None).malloc_trim(0)
    return _status_mb("VmRSS")


def peak_mb() -> float:
    """Largest resident memory so far; unlike getrusage not that of the program before exec."""
    return _status_mb("VmHWM")


def _status_mb(key: str) -> float:
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(f"{key}:"):
            return float(line.split()[1]) * 1.024e-3
    raise OSError(f"/proc/self/status has no {key}")
