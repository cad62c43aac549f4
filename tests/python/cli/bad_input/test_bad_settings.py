# SPDX-License-Identifier: BSD-3-Clause
"""Settings and vocabularies that cannot be used."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import orbslam2py
from support.command_line import CommandLine
from support.spoilt_runs import expect_refused, run

pytestmark = pytest.mark.watchdog(40)


@pytest.mark.parametrize(
    ("old", "new", "messages"),
    [
        ("Camera.fx: ", "# ", ["Camera.fx"]),
        ("Camera.fx: ", "Camera.fxx: ", ["Camera.fxx", "Camera.fx"]),
        ("Camera.fx: ", "Camera.fx: 1.0\nCamera.fx: ", ["Camera.fx"]),
        ("Camera.fx: ", "Camera.fx: -", ["Camera.fx"]),
        ("Camera.bf: ", "Camera.bf: x", ["Camera.bf"]),
        ("ORBextractor.nFeatures: ", "ORBextractor.nFeatures: -", ["ORBextractor.nFeatures"]),
        ("ORBextractor.scaleFactor: ", "ORBextractor.scaleFactor: 0 #", ["scaleFactor"]),
        ("DepthMapFactor: ", "DepthMapFactor: -", ["DepthMapFactor"]),
        ("DepthMapFactor: ", "DepthMapFactor: 0 #", ["DepthMapFactor is 0", "5000 for TUM"]),
        ("DepthMapFactor: ", "# ", ["DepthMapFactor is missing", "1000 for millimetres"]),
        ("%YAML:1.0", "\x00\x01\x02", ["mine.yaml"]),
    ],
)
def test_settings(
    command: CommandLine, rgbd: Path, old: str, new: str, messages: list[str]
) -> None:
    good = (rgbd / "settings.yaml").read_text()
    assert old in good
    Path("mine.yaml").write_text(good.replace(old, new))
    expect_refused(run(command, rgbd, "rgbd", "--settings", "mine.yaml"), "mine.yaml", *messages)
    # The same where it is found by itself.
    shutil.copy("mine.yaml", rgbd / "settings.yaml")
    expect_refused(run(command, rgbd), "settings.yaml", *messages[: 1 if old[0] != "%" else 0])


def test_depth_that_does_not_fit_the_factor(command: CommandLine, rgbd: Path) -> None:
    """A warning, once, with the factor that would make sense."""
    good = (rgbd / "settings.yaml").read_text()
    assert "DepthMapFactor: 5000.0" in good
    Path("mine.yaml").write_text(good.replace("DepthMapFactor: 5000.0", "DepthMapFactor: 1"))
    done = run(command, rgbd, "rgbd", "--settings", "mine.yaml")
    assert done.err.count("Warning: depth images do not fit DepthMapFactor 1:") == 1, done.err
    assert "DepthMapFactor: 5000 would make it" in done.err


def vocabulary_file() -> Path:
    (path,) = (Path(orbslam2py.__file__).parent / "data").glob("*.bvoc")
    return path


BAD_VOCABULARIES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "truncated": lambda good: good[: len(good) // 2],
    "one byte short": lambda good: good[:-1],
    "random": lambda _: np.random.default_rng(0).integers(0, 256, 5000, np.uint8).tobytes(),
    "text": lambda _: b"ten 5 0 0\n1 0 0 0\n",
    "picture": lambda _: b"\x89PNG\r\n\x1a\n" + bytes(500),
    "flipped": lambda good: good[:2000] + bytes([good[2000] ^ 255]) + good[2001:],
}


@pytest.mark.parametrize("kind", BAD_VOCABULARIES)
def test_vocabulary(command: CommandLine, rgbd: Path, kind: str) -> None:
    Path("mine.bvoc").write_bytes(BAD_VOCABULARIES[kind](vocabulary_file().read_bytes()))
    expect_refused(run(command, rgbd, "rgbd", "--vocabulary", "mine.bvoc"), "mine.bvoc")
