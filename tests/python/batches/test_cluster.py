# SPDX-License-Identifier: BSD-3-Clause
"""A scheduler and workers as processes of their own: one dies, one is added, no run is lost."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import engine
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytest.importorskip("distributed", reason="dask is an extra")


class Cluster:
    """A scheduler on a loopback address, and workers."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file = folder / "scheduler.json"
        self._logs: list[Any] = []
        self.workers: list[subprocess.Popen[bytes]] = []
        self._scheduler = self._start(
            "scheduler",
            "--host",
            "127.0.0.1",
            "--port",
            "0",
            "--no-show",
            "--dashboard-address",
            ":0",
        )
        deadline = time.monotonic() + 60
        while not self._file.is_file():
            assert self._scheduler.poll() is None, self.log()
            assert time.monotonic() < deadline, self.log()
            time.sleep(0.05)  # for a condition

    @property
    def address(self) -> str:
        return str(json.loads(self._file.read_text())["address"])

    def add_worker(self) -> None:
        self.workers.append(
            self._start(
                *("worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny"),
                *("--no-dashboard", "--local-directory", str(self._folder)),
            )
        )

    def log(self) -> str:
        return "\n".join(path.read_text() for path in sorted(self._folder.glob("*.log")))

    def close(self) -> None:
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()
        for log in self._logs:
            log.close()

    def _start(self, what: str, *options: str) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{what}{len(self._logs)}.log").open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}"]
        return subprocess.Popen(
            [*command, "--scheduler-file", str(self._file), *options], stdout=log, stderr=log
        )


@pytest.fixture
def cluster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Cluster]:
    # Workers find the package where this process does.
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    folder = tmp_path / "cluster"
    folder.mkdir()
    started = Cluster(folder)
    yield started
    started.close()


def jobs(folder: Path, n: int) -> dict[str, Any]:
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=15, size=(320, 240))
    path = SyntheticSequence(options).write(folder / "lap")
    return {"sequences": [str(path)], "options": {"deterministic": True}, "seeds": n}


@pytest.mark.watchdog(300)
def test_a_worker_dies_and_another_is_added(cluster: Cluster, tmp_path: Path) -> None:
    for _ in range(3):
        cluster.add_worker()
    killed = []

    def progress(row: dict[str, Any], done: int, total: int) -> None:
        if not killed:  # all are in the middle of their next run
            victim = next(
                w for w in cluster.workers if not str(row["worker"]).endswith(f":{w.pid}")
            )
            victim.kill()
            killed.append(victim.pid)
            cluster.add_worker()

    done = orb.batch(
        jobs(tmp_path, 12), tmp_path / "out", scheduler=cluster.address, progress=progress
    )
    assert len(killed) == 1
    assert (len(done.rows), done.n_failed, done.n_left) == (12, 0, 0), cluster.log()
    assert len({row["run"] for row in done.rows}) == 12
    lines = (tmp_path / "out" / "results.csv").read_text().splitlines()
    assert len(lines) == 13
    assert len({str(row["worker"]) for row in done.rows}) >= 2
    again = orb.batch(jobs(tmp_path / "again", 2), tmp_path / "here", workers=0)
    for row in again.rows:  # the same bytes wherever they ran
        file = f"runs/{row['run']}/points.ply"
        assert (tmp_path / "out" / file).read_bytes() == (tmp_path / "here" / file).read_bytes()


@pytest.mark.watchdog(120)
def test_another_version_is_refused(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.add_worker()
    monkeypatch.setattr(engine, "_PATIENCE", 90.0)
    monkeypatch.setattr(engine, "__version__", "9.9.9")
    with pytest.raises(orb.DatasetError, match=r"has orbslam2py .*, here it is 9\.9\.9; install"):
        orb.batch(jobs(tmp_path, 1), tmp_path / "out", scheduler=cluster.address)


@pytest.mark.watchdog(120)
def test_no_workers(cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine, "_PATIENCE", 1.0)
    with pytest.raises(orb.DatasetError, match="has no workers; start some with 'dask worker"):
        orb.batch(jobs(tmp_path, 1), tmp_path / "out", scheduler=cluster.address)


@pytest.mark.watchdog(120)
def test_own_workers_listen_on_loopback_addresses_only() -> None:
    psutil = pytest.importorskip("psutil", reason="it comes with dask")
    with engine.open_workers(None, 1, None) as client:
        client.wait_for_workers(1)
        own = psutil.Process()
        listening = [
            connection.laddr.ip
            for process in (own, *own.children(recursive=True))
            for connection in process.net_connections()
            if connection.status == "LISTEN"
        ]
    assert len(listening) >= 2
    assert set(listening) == {"127.0.0.1"}
