# SPDX-License-Identifier: BSD-3-Clause
"""How another process holds a vocabulary in memory."""

from __future__ import annotations

from multiprocessing import Queue
from pathlib import Path

from orbslam2py import load_vocabulary


def tell_permissions(path: str, queue: Queue[str]) -> None:
    """Open a vocabulary; put the permissions of its pages, as the kernel writes them."""
    opened = load_vocabulary(path)
    opened.check_content()
    lines = Path("/proc/self/maps").read_text().splitlines()
    queue.put(next(line.split()[1] for line in lines if line.endswith(path)))
