# SPDX-License-Identifier: BSD-3-Clause
"""A file that several threads may read at any position."""

from __future__ import annotations

import os
import weakref
from pathlib import Path

from orbslam2py._arguments import cannot_open
from orbslam2py.errors import DatasetError


class OpenFile:
    """Reads parts of a file; it is open as long as the object exists.

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    DatasetError
        If it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._descriptor = os.open(path, os.O_RDONLY)
        except OSError as error:
            raise DatasetError(cannot_open(path, error)) from error
        weakref.finalize(self, os.close, self._descriptor)
        #: Bytes of the file.
        self.size = os.fstat(self._descriptor).st_size

    def read(self, position: int, size: int) -> bytes:
        """Read `size` bytes from `position` on, fewer at the end of the file.

        Raises
        ------
        DatasetError
            If the disk fails.
        """
        parts = []
        try:
            # One call reads 2 GB at most.
            while size > 0 and (part := os.pread(self._descriptor, size, position)):
                parts.append(part)
                position, size = position + len(part), size - len(part)
        except OSError as error:
            raise DatasetError(f"cannot read {self.path}: {error.strerror or error}") from error
        return parts[0] if len(parts) == 1 else b"".join(parts)
