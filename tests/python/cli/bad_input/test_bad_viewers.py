# SPDX-License-Identifier: BSD-3-Clause
"""Viewers that cannot be: the thing, the remedy, and no run that goes to waste."""

from __future__ import annotations

import socket
import sys
from pathlib import Path

import pytest

from support.command_line import CommandLine


def flat(text: str) -> str:
    """Without the frame in which wrong usage is told."""
    return " ".join(text.replace("│", " ").split())


@pytest.mark.parametrize(
    "option", [("--viewer-port", "8000"), ("--viewer-host", "0.0.0.0"), ("--viewer-exit",)]
)
def test_options_of_the_viewer_need_one(command: CommandLine, option: tuple[str, ...]) -> None:
    done = command("demo", "--frames", 10, *option)
    assert done.code == 2
    assert f"{option[0]} is for the viewer; give --viewer as well" in flat(done.err)
    assert not Path("runs").exists()


def test_a_port_that_is_taken_is_told_before_the_run(command: CommandLine) -> None:
    pytest.importorskip("viser", reason="the viewer's extra is not installed")
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        done = command("demo", "--frames", 10, "--viewer", "--viewer-port", port)
    assert done.code == 2
    assert done.err.startswith(f"Error: the viewer cannot use port {port}: address already in use;")
    assert not Path("runs").exists()


def test_without_viser_its_installation_is_told_before_the_run(
    command: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "viser", None)
    done = command("demo", "--frames", 10, "--viewer")
    assert done.code == 2
    assert "pip install 'orbslam2py[viewer]'" in done.err
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("empty",), "empty holds no run: report.json is missing; give a folder that"),
        (("nowhere",), "nowhere is no folder; give one that orbslam2py run has written"),
        ((), "runs/latest is no folder; give one that orbslam2py run has written"),
    ],
)
def test_a_folder_without_a_run_is_named(
    command: CommandLine, arguments: tuple[str, ...], text: str
) -> None:
    Path("empty").mkdir()
    done = command("view", *arguments)
    assert done.code == 2
    assert done.err.startswith(f"Error: {text}")
