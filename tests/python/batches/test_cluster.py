# SPDX-License-Identifier: BSD-3-Clause
"""A scheduler and workers as processes of their own: one dies, one is added, no run is lost."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
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

    def add_worker(self, hidden: Path | None = None) -> None:
        """Start a worker; one of a computer that does not have a folder, if one is named."""
        around: list[str] = []
        if hidden is not None:
            around = ["unshare", "-m", "sh", "-c"]
            around += ['mount -t tmpfs tmpfs "$0" && exec "$@"', str(hidden)]
            try:
                subprocess.run([*around, "true"], check=True, capture_output=True)
            except (OSError, subprocess.CalledProcessError):
                pytest.skip("file systems cannot be mounted here")
        self.workers.append(
            self._start(
                *("worker", "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny"),
                *("--no-dashboard", "--local-directory", str(self._folder)),
                around=around,
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

    def _start(
        self, what: str, *options: str, around: Sequence[str] = ()
    ) -> subprocess.Popen[bytes]:
        log = (self._folder / f"{what}{len(self._logs)}.log").open("wb")
        self._logs.append(log)
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}"]
        return subprocess.Popen(
            [*around, *command, "--scheduler-file", str(self._file), *options],
            stdout=log,
            stderr=log,
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
def test_a_path_that_only_some_workers_see(cluster: Cluster, tmp_path: Path) -> None:
    """Runs where it is not seen say so, and are made again where it is."""
    document = jobs(tmp_path / "data", 4)
    cluster.add_worker(hidden=tmp_path / "data")
    folder = tmp_path / "out"
    done = orb.batch(document, folder, scheduler=cluster.address)
    assert done.n_failed == 4, cluster.log()
    for row in done.rows:
        assert row["reason"] == (
            f"{tmp_path}/data/lap does not exist on {platform.node()}; put the sequences where all "
            "workers see them"
        )
    cluster.workers[0].kill()
    cluster.workers[0].wait()
    cluster.add_worker()
    again = orb.batch(document, folder, scheduler=cluster.address, resume=True)
    assert again.n_failed == 0, cluster.log()


@pytest.mark.watchdog(120)
def test_results_where_the_batch_is_not(cluster: Cluster, tmp_path: Path) -> None:
    """Nothing is run whose results would lie on the disk of another computer."""
    (tmp_path / "results").mkdir()
    cluster.add_worker(hidden=tmp_path / "results")
    folder = tmp_path / "results/out"
    done = orb.batch(jobs(tmp_path, 1), folder, scheduler=cluster.address)
    assert [row["reason"] for row in done.rows] == [
        f"{folder} is not seen on {platform.node()}; give an --output that all workers see"
    ], cluster.log()
    assert "is not seen on" in (folder / "results.csv").read_text()


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
