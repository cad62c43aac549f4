# SPDX-License-Identifier: BSD-3-Clause
"""Compiled Python is kept from process to process, of which the tests start hundreds."""

from __future__ import annotations

import os
import sys

from support.documents import ROOT

#: Of all libraries, below the paths of their sources.
FOLDER = ROOT / "build" / "bytecode"


def keep_bytecode() -> None:
    """Where nothing is to be written next to the sources, keep it in a folder of its own.

    With ``PYTHONDONTWRITEBYTECODE`` and libraries that were never compiled, each process that a
    test starts would compile them for seconds, and each worker of pytest all tests.
    """
    if not sys.dont_write_bytecode:
        return
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(FOLDER)
    # Of the processes that are started.
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = str(FOLDER)
