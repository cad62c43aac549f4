# SPDX-License-Identifier: BSD-3-Clause
"""A scheduler and workers as processes of their own, on a loopback address."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest


class Cluster:
    """A scheduler, and workers that come and go.

    Parameters
    ----------
    folder
        For what they write.
    path
        More folders that they import from.
    """

    def __init__(self, folder: Path, path: tuple[Path, ...] = ()) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self._logs: list[Any] = []
        # Workers find the package where this process does.
        places = os.pathsep.join([*map(str, path), *sys.path])
        self._environment = {**os.environ, "PYTHONPATH": places}
        self.workers: dict[subprocess.Popen[bytes], tuple[Path, ...]] = {}
        self._scheduler = self._start(
            *("scheduler", "--host", "127.0.0.1", "--port", "0"),
            *("--no-show", "--dashboard-address", "127.0.0.1:0"),
        )
        # It is there before it is written.
        self._wait(lambda: self._file.is_file() and self._file.read_text().endswith("}"))
        from distributed import Client  # noqa: PLC0415

        self._client = Client(self.address, set_as_default=False)

    @property
    def address(self) -> str:
        return str(json.loads(self._file.read_text())["address"])

    def require(self, n: int, hidden: tuple[Path, ...] = ()) -> None:
        """Have so many workers, and no others; of a computer that lacks some folders, if named."""
        of_others = [worker for worker, lacks in self.workers.items() if lacks != hidden]
        dead = [worker for worker in self.workers if worker.poll() is not None]
        mine = [worker for worker in self.workers if worker not in {*of_others, *dead}]
        for worker in {*of_others, *dead, *mine[n:]}:
            self.kill(worker)
        for _ in range(n - len(self.workers)):
            self.add_worker(hidden)
        self._wait(lambda: len(self._client.nthreads()) == n)

    def require_none(self) -> None:
        """End all workers, also without a scheduler."""
        for worker in list(self.workers):
            self.kill(worker)

    def add_worker(self, hidden: tuple[Path, ...] = ()) -> None:
        around: list[str] = []
        if hidden:
            mounts = " && ".join(f'mount -t tmpfs tmpfs "{folder}"' for folder in hidden)
            around = ["unshare", "-m", "sh", "-c", f'{mounts} && exec "$0" "$@"']
            try:
                subprocess.run([*around, "true"], check=True, capture_output=True)
            except (OSError, subprocess.CalledProcessError):
                pytest.skip("file systems cannot be mounted here")
        worker = self._start(
            *("worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny"),
            *("--no-dashboard", "--local-directory", str(self._folder)),
            around=around,
        )
        self.workers[worker] = hidden

    def kill(self, worker: subprocess.Popen[bytes]) -> None:
        worker.kill()
        worker.wait()
        del self.workers[worker]

    def log(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._folder.glob("*.log")))

    def close(self) -> None:
        self._client.close()
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()
        for log in self._logs:
            log.close()

    def end_scheduler(self) -> None:
        self._scheduler.kill()
        self._scheduler.wait()

    def _start(
        self, what: str, *options: str, around: list[str] | None = None
    ) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{what}{len(self._logs)}.log").open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}"]
        return subprocess.Popen(
            [*(around or []), *command, "--scheduler-file", str(self._file), *options],
            stdout=log,
            stderr=log,
            env=self._environment,
        )

    def _wait(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 60
        while not condition():
            assert self._scheduler.poll() is None, self.log()
            assert time.monotonic() < deadline, self.log()
            time.sleep(0.02)  # for a condition
