# SPDX-License-Identifier: BSD-3-Clause
"""Networks of nodes on this computer alone."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

#: Domains of tests; processes that run at once use different ones.
_FIRST_DOMAIN, _N_DOMAINS = 120, 110


@pytest.fixture(autouse=True)
def _this_computer_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in ("ROS_DOMAIN_ID", "CYCLONEDDS_URI", "ZENOH_SESSION_CONFIG_URI"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def domain() -> int:
    """A domain of this process of the tests."""
    return _FIRST_DOMAIN + os.getpid() % _N_DOMAINS


@pytest.fixture
def router() -> Iterator[str]:
    """Address of a Zenoh router."""
    zenoh = pytest.importorskip("zenoh")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    address = f"tcp/127.0.0.1:{port}"
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{address}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    yield address
    session.close()


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag of two seconds of small rendered pairs."""
    folder = tmp_path_factory.mktemp("bag")
    options = SyntheticOptions(world="corridor", sensor="stereo", frames=40, size=(320, 240))
    SyntheticSequence(options).write(folder / "pairs", "mcap")
    return folder / "pairs"
