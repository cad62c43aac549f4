# SPDX-License-Identifier: BSD-3-Clause
"""The command line, in a folder of the test's own."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.command_line import CommandLine, logging_restored


@pytest.fixture(autouse=True)
def _log_as_it_was() -> Iterator[None]:
    """Let no test of a command redirect the log of the tests after it."""
    with logging_restored():
        yield


@pytest.fixture
def command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> CommandLine:
    return CommandLine(monkeypatch, capsys, tmp_path)
