# SPDX-License-Identifier: BSD-3-Clause
"""Failures inside: the results until then are saved."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from orbslam2py import _core
from orbslam2py.trajectory import read_tum
from support.command_line import RUN_FILES, CommandLine, Results
from support.spoilt_runs import run

pytestmark = pytest.mark.watchdog(40)


class After:
    """Raises at the n-th call."""

    def __init__(self, original: Callable[..., object], n: int) -> None:
        self._original = original
        self._left = n

    def __call__(self, *arguments: object, **named: object) -> object:
        self._left -= 1
        if self._left < 0:
            raise RuntimeError("out of order")
        return self._original(*arguments, **named)


@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize(
    ("verb", "n", "message"),
    [
        ("process_new_keyframe", 1, "local mapping stopped: out of order"),
        ("cull_keyframes", 1, "local mapping stopped: out of order"),
        ("match_local_map", 5, "out of order"),
        ("build_rgbd_frame", 6, "out of order"),
    ],
)
def test_failure_inside(
    command: CommandLine,
    rgbd: Path,
    monkeypatch: pytest.MonkeyPatch,
    verb: str,
    n: int,
    message: str,
    deterministic: bool,
) -> None:
    monkeypatch.setattr(_core, verb, After(getattr(_core, verb), n))
    options = ("--deterministic",) if deterministic else ()
    done = run(command, rgbd, "rgbd", *options)
    assert done.code == 1
    assert f"Error: {message} (the results until then are saved)" in done.err
    assert {path.name for path in Path("r").iterdir()} == RUN_FILES
    rows = Results(Path("r")).frames
    assert len(read_tum(Path("r/trajectory.txt"))) >= len(rows) >= 1
    if verb in {"match_local_map", "to_grey"}:
        assert len(rows) == 6


def test_failure_while_reading(
    command: CommandLine, rgbd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from orbslam2py.datasets import tum  # noqa: PLC0415

    monkeypatch.setattr(tum, "read_depth", After(tum.read_depth, 6))
    done = run(command, rgbd)
    assert done.code == 1
    assert "Error: out of order (the results until then are saved)" in done.err
    assert len(read_tum(Path("r/trajectory.txt"))) == 6
