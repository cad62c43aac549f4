# SPDX-License-Identifier: BSD-3-Clause
"""Arrays during whose conversion other threads run, as while NumPy copies large ones."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray


class SlowArray:
    """Is converted in one thread until another one says `go_on`."""

    def __init__(self, array: NDArray[np.generic]) -> None:
        self._array = array
        self.is_read, self.go_on = threading.Event(), threading.Event()

    def __array__(self, *_: object, **__: object) -> NDArray[np.generic]:
        self.is_read.set()
        assert self.go_on.wait(30)
        return self._array
