# SPDX-License-Identifier: BSD-3-Clause
"""The computer of a run, for its report."""

from __future__ import annotations

import platform
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from orbslam2py._cores import n_cores


def describe_machine() -> dict[str, Any]:
    """Return the properties of the computer that determine the times of a run.

    Returns
    -------
    dict
        ``system``, ``processor``, ``cores`` (available to this process), ``memory_gb`` (None if
        unknown), and the versions of ``python``, ``numpy`` and ``opencv``.
    """
    return {
        "system": f"{platform.system()} {platform.release()} ({platform.machine()})",
        "processor": _processor(),
        "cores": n_cores(),
        "memory_gb": _memory_gb(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "opencv": str(cv2.__version__),
    }


def _processor() -> str:
    for line in _lines_of("/proc/cpuinfo"):
        name, _, value = line.partition(":")
        if name.strip() == "model name":
            return value.strip()
    return platform.processor() or platform.machine()


def _memory_gb() -> float | None:
    for line in _lines_of("/proc/meminfo"):
        if line.startswith("MemTotal:"):
            return round(int(line.split()[1]) / 1e6, 1)
    return None


def _lines_of(path: str) -> list[str]:
    try:
        return Path(path).read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
