# SPDX-License-Identifier: BSD-3-Clause
"""Stores of objects on a loopback address, which speak the protocols of S3 and of Google's."""

from __future__ import annotations

import importlib
import logging
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_MISSING = "pip install --group buckets brings the stores that are served here"


@contextmanager
def s3_store() -> Iterator[str]:
    """Serve an empty bucket, and have s3fs find it; yields its address."""
    pytest.importorskip("s3fs", reason=_MISSING)
    moto = pytest.importorskip("moto.server", reason=_MISSING)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with _environment(
        AWS_ENDPOINT_URL=f"http://{host}:{port}",
        AWS_ACCESS_KEY_ID="nobody",
        AWS_SECRET_ACCESS_KEY="nothing",
        AWS_DEFAULT_REGION="us-east-1",
    ):
        _new_bucket("s3")
        try:
            yield "s3://bucket"
        finally:
            server.stop()


@contextmanager
def gs_store() -> Iterator[str]:
    """The same for gcsfs."""
    pytest.importorskip("gcsfs", reason=_MISSING)
    emulator = pytest.importorskip("gcp_storage_emulator.server", reason=_MISSING)
    port = _free_port()
    server = emulator.create_server("127.0.0.1", port, in_memory=True)
    server.start()
    with _environment(STORAGE_EMULATOR_HOST=f"http://127.0.0.1:{port}"):
        _new_bucket("gs")
        try:
            yield "gs://bucket"
        finally:
            server.stop()


def _new_bucket(protocol: str) -> None:
    fsspec = importlib.import_module("fsspec")
    files = fsspec.filesystem(protocol, skip_instance_cache=True)
    files.mkdir("bucket")


@contextmanager
def _environment(**values: str) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        for name, value in values.items():
            patch.setenv(name, value)
        yield


def _free_port() -> int:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return int(taken.getsockname()[1])
