# SPDX-License-Identifier: BSD-3-Clause
"""On a terminal that cannot show a letter, print a question mark instead of a traceback."""

from __future__ import annotations

import codecs
import io
import sys

_HANDLER = "orbslam2py.question_marks"


def _question_marks(error: UnicodeError) -> tuple[bytes, int]:
    """Write bytes of file names unchanged, and ? for each letter that cannot be written."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letters = map(ord, error.object[error.start : error.end])
    # Bytes that the locale could not read stand as surrogates U+DC80 to U+DCFF (PEP 383).
    written = bytes(code - 0xDC00 if 0xDC80 <= code <= 0xDCFF else ord("?") for code in letters)
    return written, error.end


def accept_all_letters() -> None:
    """Let standard output and errors accept any text, in any locale."""
    codecs.register_error(_HANDLER, _question_marks)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_HANDLER)
