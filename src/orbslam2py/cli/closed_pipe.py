# SPDX-License-Identifier: BSD-3-Clause
"""A closed output pipe (``| head``) stops the output, but not the run."""

from __future__ import annotations

import io
import os
import stat
import sys


class _Pipe(io.FileIO):
    """Standard output into a pipe; after its reader has closed it, output is dropped."""

    def write(self, data: object, /) -> int:
        """Write bytes."""
        try:
            return super().write(data)  # type: ignore[arg-type]
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            return super().write(data)  # type: ignore[arg-type]


def outlive_the_reader() -> None:
    """Continue after the reader of standard output has closed it: files must still be written."""
    out = sys.stdout
    if out is not sys.__stdout__ or not isinstance(out, io.TextIOWrapper):
        return  # the output is captured
    if not stat.S_ISFIFO(os.fstat(out.fileno()).st_mode):
        return
    out.flush()
    pipe = _Pipe(out.fileno(), "wb", closefd=False)
    sys.stdout = io.TextIOWrapper(
        # Nothing is held back for who wants it at once (python -u).
        pipe if out.write_through else io.BufferedWriter(pipe),
        encoding=out.encoding,
        errors=out.errors,
        line_buffering=out.line_buffering,
        write_through=out.write_through,
    )
