# SPDX-License-Identifier: BSD-3-Clause
"""Python scripts in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

_TESTS = Path(__file__).parents[1]


def run_script(code: str, *arguments: object, timeout: float) -> subprocess.CompletedProcess[str]:
    """Run a script, which may import ``support``."""
    folders = [str(_TESTS), os.environ.get("PYTHONPATH", "")]
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, folders))},
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def run_to_the_end(code: str, timeout: float) -> None:
    """Run a script that prints "end": its interpreter ends as well, in time and in silence."""
    done = run_script(code, timeout=timeout)
    assert (done.returncode, done.stdout, done.stderr) == (0, "end\n", "")
