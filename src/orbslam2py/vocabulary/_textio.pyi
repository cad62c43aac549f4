# SPDX-License-Identifier: BSD-3-Clause
from collections.abc import Callable
from typing import Protocol

import numpy as np
import numpy.typing as npt

Header = tuple[int, int, int, int]
Columns = tuple[
    npt.NDArray[np.uint32],
    npt.NDArray[np.uint8],
    npt.NDArray[np.uint8],
    npt.NDArray[np.float64],
]

class _Source(Protocol):
    def readinto(self, buffer: memoryview, /) -> int | None: ...

class _Target(Protocol):
    def write(self, data: bytes | memoryview, /) -> object: ...

def read_header(line: bytes) -> Header: ...
def read_vocabulary_text(
    source: _Source, size_hint: int = 0, progress: Callable[[int], object] | None = None
) -> tuple[Header, Columns, list[int]]: ...
def write_vocabulary_text(
    target: _Target,
    header: tuple[int, ...],
    columns: Columns,
    progress: Callable[[int], object] | None = None,
) -> None: ...
