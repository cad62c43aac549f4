# SPDX-License-Identifier: BSD-3-Clause
"""Where runs are to be made: what is refused, before anything is begun, and what is left behind."""

from __future__ import annotations

import contextlib
import re
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import orbslam2py as orb
from orbslam2py._arguments import shown
from orbslam2py.batches import engine
from orbslam2py.batches.cache import cache_size_of
from orbslam2py.batches.sizes import bytes_of, text_of
from orbslam2py.batches.workers import LEAST_MEMORY, Workers
from support.batches import jobs_of, make_sequences

SIZE = "the memory of a worker (--memory-limit) is {}; give one such as 4GB, at least 500 MB"
ADDRESS = "the scheduler (--scheduler) is {}; give an address such as tcp://10.0.0.1:8786"
COUNT = "the number of workers (--workers) is {}; give a whole number from 0"

WRONG: list[tuple[dict[str, Any], str]] = [
    *(
        ({"memory_limit": size}, SIZE.format(shown(size)))
        for size in ("abc", "-1GB", "1kB", "", "0", "4", "499MB", "3 apples", "nan", "9" * 400)
    ),
    *(
        ({"scheduler": address}, ADDRESS.format(repr(address)))
        for address in ("foo", "", "tcp://foo", "tcp://foo:0", "tcp://foo:70000", "tcp://a b:1", 3)
    ),
    *(({"workers": count}, COUNT.format(repr(count))) for count in (-1, 1.5, "2", True)),
    (
        {"memory_limit": "4GB", "workers": 0},
        "--memory-limit 4GB has no meaning with --workers 0, which runs all in this process; leave",
    ),
    (
        {"memory_limit": "4GB", "scheduler": "tcp://a:1"},
        "--memory-limit 4GB has no meaning with --scheduler tcp://a:1, whose workers have limits",
    ),
    (
        {"workers": 2, "scheduler": "tcp://a:1"},
        "--workers 2 has no meaning with --scheduler tcp://a:1, which has workers of its own",
    ),
]


@pytest.fixture
def silent_program() -> Iterator[str]:
    """Address of a server that waits to be spoken to, as one of web pages does."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"127.0.0.1:{server.getsockname()[1]}"


@pytest.fixture(scope="module")
def sequences(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_sequences(tmp_path_factory.mktemp("sequences"))


@pytest.fixture
def other_program() -> Iterator[str]:
    """Address of a server that is no scheduler: it says what a web server does."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            while True:
                try:
                    connection, _ = server.accept()
                except OSError:
                    return
                with connection, contextlib.suppress(ConnectionResetError):
                    connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 4)
                    connection.recv(1)

        threading.Thread(target=answer, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_wrong_workers(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    """Refused before the jobs are looked at, and nothing is written."""
    with pytest.raises(orb.SettingsError, match=f"^{re.escape(message)}"):
        orb.batch(tmp_path / "none.yaml", tmp_path / "out", **options)
    with pytest.raises(orb.SettingsError, match=f"^{re.escape(message)}"):
        orb.batches.benchmark("tum", tmp_path / "nowhere", tmp_path / "out", **options)
    assert not list(tmp_path.iterdir())


def test_workers() -> None:
    assert Workers.of(None, None, None) == Workers()
    assert Workers.of(None, 2, "500MB") == Workers(None, 2, LEAST_MEMORY)
    assert Workers.of(None, None, "4 gib").memory_limit == 4 * 2**30
    assert Workers.of(None, 0, None).is_this_process
    for address in (
        "tcp://10.0.0.1:8786",
        "a-b.org:1",
        "tls://[fe80::1%eth0]:65535",
        "inproc://1/2",
        "ws://h:80/ws",
    ):
        assert Workers.of(address, None, None) == Workers(address)


@pytest.mark.parametrize(
    ("text", "size"),
    [
        *(("20GB", 20 * 10**9), ("1.5 MB", 1_500_000), (300, 300), ("4k", 4000), ("7b", 7)),
        *(("2gb", 2 * 10**9), ("4 GiB", 4 * 2**30), ("1ki", 1024), ("1T", 10**12)),
    ],
)
def test_sizes(text: str | int, size: int) -> None:
    assert bytes_of(text, "it", "20GB") == cache_size_of(text) == size


@pytest.mark.parametrize("wrong", ["", "much", "-1GB", "0", "3 apples", "9" * 400, "iB"])
def test_wrong_sizes(wrong: str) -> None:
    with pytest.raises(
        orb.SettingsError, match=r"the size of the cache is .*give one such as 20GB"
    ):
        cache_size_of(wrong)


def test_sizes_as_text() -> None:
    assert [text_of(size) for size in (7, 1500, LEAST_MEMORY)] == ["7 B", "1.5 KB", "500 MB"]


@pytest.mark.watchdog(120)
def test_the_limit_is_that_of_the_workers() -> None:
    pytest.importorskip("distributed", reason="dask is an extra")
    with engine.open_workers(Workers.of(None, 3, "600MB"), most=1) as client:
        client.wait_for_workers(1)
        limits = [one["memory_limit"] for one in client.scheduler_info()["workers"].values()]
    assert limits == [600 * 10**6]


def test_no_place_is_made_for_a_scheduler_that_is_not_there(
    sequences: Path,
    tmp_path: Path,
    other_program: str,
    silent_program: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """So that the right address does not need another folder, or --resume."""
    pytest.importorskip("distributed", reason="dask is an extra")
    monkeypatch.setattr(engine, "_PATIENCE", 0.5)
    for address, message in (
        ("tcp://127.0.0.1:9", "tcp://127.0.0.1:9 cannot be reached; start one with"),
        (silent_program, f"{silent_program} is no scheduler that can be used: another program"),
        (other_program, f"{other_program} is no scheduler that can be used: another program"),
        ("xyz://a:1", "xyz://a:1 is no scheduler that can be used: unknown address scheme"),
    ):
        with pytest.raises(orb.DatasetError, match=message):
            orb.batch(jobs_of(sequences), tmp_path / "out", scheduler=address)
    assert not (tmp_path / "out").exists()


@pytest.mark.watchdog(120)
def test_only_the_error_is_printed(sequences: Path, tmp_path: Path, other_program: str) -> None:
    """A client of Dask that failed halfway used to print a traceback as the program ended."""
    pytest.importorskip("distributed", reason="dask is an extra")
    (tmp_path / "jobs.yaml").write_text(f"sequences: [{sequences / 'one'}]\n")
    command = ("batch", "jobs.yaml", "--output", "out")
    for address in ("foo", "xyz://a:1", other_program):
        done = subprocess.run(
            [sys.executable, "-m", "orbslam2py", *command, "--scheduler", address],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 2, done.stderr
        assert done.stderr.startswith("Error: ")
        assert done.stderr.count("\n") == 1, done.stderr
        assert address in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_place_that_is_taken_is_said_before_workers_are_started(
    sequences: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def opened(*_: Any, **__: Any) -> Any:
        raise AssertionError

    monkeypatch.setattr(sys.modules["orbslam2py.batches.batch"], "open_workers", opened)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/notes.txt").write_text("mine\n")
    for options in ({}, {"scheduler": "tcp://127.0.0.1:9"}):
        with pytest.raises(orb.DatasetError, match="is not empty and holds no batch"):
            orb.batch(jobs_of(sequences), tmp_path / "out", **options)
