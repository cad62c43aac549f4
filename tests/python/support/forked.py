# SPDX-License-Identifier: BSD-3-Clause
"""Programs in processes of their own that need not load the package first.

One process loads it, and forks for each program. Such a process ends as any other: what runs when
an interpreter ends, runs.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_LOADED_ONCE = """
import json, os, sys
import matplotlib.backends.backend_agg, matplotlib.figure
import orbslam2py.cli, orbslam2py.cli.run, orbslam2py.datasets.tum, orbslam2py.vocabulary
from orbslam2py import System, run_sequence

def program(wanted):
    os.chdir(wanted["folder"])
    for number, name in ((0, os.devnull), (1, wanted["out"]), (2, wanted["err"])):
        opened = os.open(name, os.O_RDONLY if number == 0 else os.O_WRONLY | os.O_CREAT)
        os.dup2(opened, number)
        os.close(opened)
    sys.argv = ["-c", *wanted["arguments"]]
    exec(compile(wanted["code"], "<program>", "exec"), {"__name__": "__main__"})

print("loaded", flush=True)
while line := sys.stdin.readline():
    child = os.fork()
    if child == 0:
        program(json.loads(line))
        break
    print(child, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@dataclass(frozen=True)
class Ended:
    """A program that has ended."""

    code: int
    out: str
    err: str


class Forked:
    """Starts programs, one at a time; leave with `close`."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        # Threads of libraries do not live through a fork.
        quiet = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        self._process = subprocess.Popen(
            [sys.executable, "-c", _LOADED_ONCE],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **quiet},
        )
        assert self._told(60) == "loaded"

    def run(self, code: str, arguments: Sequence[str], folder: Path, patience: float = 40) -> Ended:
        """Run a program to its end; one that does not end is killed, and fails the test."""
        out, err = (self._folder / name for name in ("out.txt", "err.txt"))
        for path in (out, err):
            path.unlink(missing_ok=True)
        wanted = {"code": code, "arguments": list(arguments), "folder": str(folder)}
        assert self._process.stdin is not None
        self._process.stdin.write(
            json.dumps({**wanted, "out": str(out), "err": str(err)}).encode() + b"\n"
        )
        self._process.stdin.flush()
        child = int(self._told(patience))
        try:
            ended = int(self._told(patience))
        except TimeoutError:
            os.kill(child, signal.SIGKILL)
            self._told(patience)
            raise
        return Ended(ended, out.read_text(), err.read_text())

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(10)

    def _told(self, patience: float) -> str:
        assert self._process.stdout is not None
        line, until = b"", time.monotonic() + patience
        while not line.endswith(b"\n"):
            left = max(0.0, until - time.monotonic())
            if not select.select([self._process.stdout], [], [], left)[0]:
                raise TimeoutError(f"nothing happened for {patience} s")
            more = os.read(self._process.stdout.fileno(), 1)
            assert more, "the process that forks has ended"
            line += more
        return line.decode().strip()
