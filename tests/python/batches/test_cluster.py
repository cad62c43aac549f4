# SPDX-License-Identifier: BSD-3-Clause
"""A scheduler and workers as processes of their own: one dies, one is added, no run is lost."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py.batches import engine
from orbslam2py.batches.workers import Workers
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.cluster import Cluster

pytest.importorskip("distributed", reason="dask is an extra")

#: A loader whose sequence ends the process that opens it, and counts how often.
DEADLY = """
import os
from pathlib import Path


class Deadly:
    @staticmethod
    def recognises(folder: Path) -> bool:
        return (folder / "deadly.txt").is_file()

    def __init__(self, folder: Path, *more: object, **named: object) -> None:
        with (folder / "deadly.txt").open("a") as opened:
            opened.write("opened\\n")
        os._exit(1)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two places that a worker may lack, a package with a loader, and what is run."""
    made = tmp_path_factory.mktemp("cluster")
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=8, size=(160, 120))
    SyntheticSequence(options).write(made / "data/lap")
    for name in ("site/deadly-1.0.dist-info", "results", "logs"):
        (made / name).mkdir(parents=True)
    (made / "site/deadly.py").write_text(DEADLY)
    information = made / "site/deadly-1.0.dist-info"
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: deadly\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text("[orbslam2py.sequences]\nd = deadly:Deadly\n")
    return made


@pytest.fixture(scope="module")
def cluster(folder: Path) -> Iterator[Cluster]:
    started = Cluster(folder / "logs", (folder / "site",))
    yield started
    started.close()


def jobs(folder: Path, n: int) -> dict[str, Any]:
    path = str(folder / "data/lap")
    return {"sequences": [path], "options": {"deterministic": True}, "seeds": n}


@pytest.mark.watchdog(120)
def test_no_workers(
    cluster: Cluster, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.require(0)
    monkeypatch.setattr(engine, "_PATIENCE", 0.2)
    with pytest.raises(orb.DatasetError, match="has no workers; start some with 'dask worker"):
        orb.batch(jobs(folder, 1), tmp_path / "out", scheduler=cluster.address)


@pytest.mark.watchdog(120)
def test_a_path_that_only_some_workers_see(cluster: Cluster, folder: Path, tmp_path: Path) -> None:
    """Runs where it is not seen say so, and are made again where it is."""
    cluster.require(1, hidden=(folder / "data", folder / "results"))
    document, output = jobs(folder, 2), tmp_path / "out"
    done = orb.batch(document, output, scheduler=cluster.address)
    assert done.n_failed == 2, cluster.log()
    for row in done.rows:
        assert row["reason"] == (
            f"{folder}/data/lap does not exist on {platform.node()}; put the sequences where all "
            "workers see them"
        )
    # Nothing is run whose results would lie on the disk of another computer.
    lost = folder / "results/out"
    done = orb.batch(document, lost, scheduler=cluster.address)
    assert [row["reason"] for row in done.rows] == 2 * [
        f"{lost} is not seen on {platform.node()}; give an --output that all workers see"
    ], cluster.log()
    assert "is not seen on" in (lost / "results.csv").read_text()
    cluster.require(3)
    again = orb.batch(document, output, scheduler=cluster.address, resume=True)
    assert again.n_failed == 0, cluster.log()


@pytest.mark.watchdog(120)
def test_another_version_is_refused(
    cluster: Cluster, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.require(3)
    monkeypatch.setattr(engine, "__version__", "9.9.9")
    with pytest.raises(orb.DatasetError, match=r"has orbslam2py .*, here it is 9\.9\.9; install"):
        orb.batch(jobs(folder, 1), tmp_path / "out", scheduler=cluster.address)


@pytest.mark.watchdog(300)
def test_a_worker_dies_and_another_is_added(cluster: Cluster, folder: Path, tmp_path: Path) -> None:
    cluster.require(3)
    killed = []

    def progress(row: dict[str, Any], done: int, total: int) -> None:
        if not killed:  # all are in the middle of their next run
            victim = next(w for w in cluster.workers if not row["worker"].endswith(f":{w.pid}"))
            killed.append(victim.pid)
            cluster.kill(victim)
            cluster.add_worker()

    done = orb.batch(
        jobs(folder, 9), tmp_path / "out", scheduler=cluster.address, progress=progress
    )
    assert len(killed) == 1
    assert (len(done.rows), done.n_failed, done.n_left) == (9, 0, 0), cluster.log()
    assert len({row["run"] for row in done.rows}) == 9
    lines = (tmp_path / "out" / "results.csv").read_text().splitlines()
    assert len(lines) == 10
    assert len({str(row["worker"]) for row in done.rows}) >= 2
    again = orb.batch(jobs(folder, 2), tmp_path / "here", workers=0)
    for row in again.rows:  # the same bytes wherever they ran
        file = f"runs/{row['run']}/points.ply"
        assert (tmp_path / "out" / file).read_bytes() == (tmp_path / "here" / file).read_bytes()


@pytest.mark.watchdog(300)
def test_a_run_that_ends_its_workers(cluster: Cluster, folder: Path, tmp_path: Path) -> None:
    """It is begun three times, and costs no other run."""
    cluster.require(4)
    deadly = tmp_path / "deadly"
    deadly.mkdir()
    (deadly / "deadly.txt").touch()
    document = jobs(folder, 1)
    document["sequences"] = [str(deadly), {"path": document["sequences"][0], "name": "b"}]
    document["sequences"] += [{**document["sequences"][1], "name": name} for name in "cdefgh"]
    done = orb.batch(document, tmp_path / "out", scheduler=cluster.address)
    assert (deadly / "deadly.txt").read_text() == 3 * "opened\n", cluster.log()
    states = {row["sequence"]: row["state"] for row in done.rows}
    assert states == {"deadly": "failed", **dict.fromkeys("bcdefgh", "done")}, cluster.log()
    (reason,) = [row["reason"] for row in done.rows if row["state"] == "failed"]
    assert reason.startswith("its worker ended 3 times while it ran: it was killed, or had too")
    assert not list((tmp_path / "out").rglob("begun.json"))


@pytest.mark.watchdog(120)
def test_the_scheduler_is_lost(
    cluster: Cluster, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cluster.require(1)
    monkeypatch.setattr(engine, "_PATIENCE", 1.0)
    with pytest.raises(
        orb.DatasetError, match="the scheduler was lost; start it again, and continue"
    ):
        orb.batch(
            jobs(folder, 3),
            tmp_path / "out",
            scheduler=cluster.address,
            progress=lambda row, done, total: cluster.end_scheduler(),
        )
    cluster.require_none()  # one that still makes a run holds its folder
    done = orb.batch(jobs(folder, 3), tmp_path / "out", workers=0, resume=True)
    assert (len(done.rows), done.n_failed) == (3, 0), [row.get("reason") for row in done.rows]


@pytest.mark.watchdog(120)
def test_own_workers_of_two_batches_listen_on_loopback_addresses_of_their_own(
    recwarn: pytest.WarningsRecorder,
) -> None:
    psutil = pytest.importorskip("psutil", reason="it comes with dask")
    with (
        engine.open_workers(Workers(count=1)) as first,
        engine.open_workers(Workers(count=1)) as second,
    ):
        assert second.run_on_scheduler(_web_address).startswith("127.0.0.1:")
        for client in (first, second):
            client.wait_for_workers(1)
        own = psutil.Process()
        listening = [
            connection.laddr.ip
            for process in (own, *own.children(recursive=True))
            for connection in process.net_connections()
            if connection.status == "LISTEN"
        ]
    assert len(listening) >= 4
    assert set(listening) == {"127.0.0.1"}
    assert [str(warning.message) for warning in recwarn if "Port" in str(warning.message)] == []


def _web_address(dask_scheduler: Any) -> str:
    server = dask_scheduler.http_server
    return f"{server.address}:{server.port}"
