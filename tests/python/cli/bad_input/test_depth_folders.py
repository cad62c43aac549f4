# SPDX-License-Identifier: BSD-3-Clause
"""Folders with images and depth whose parts do not fit, and what the run says of those that do."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from support.command_line import CommandLine, Results
from support.spoilt_runs import N, expect_refused, run

pytestmark = pytest.mark.watchdog(60)


@pytest.fixture
def phone(rgbd: Path, tmp_path: Path) -> Path:
    """The images and the depth of a sequence under other names, with its settings."""
    folder = tmp_path / "phone"
    for old, new in (("rgb", "color"), ("depth", "depth16")):
        (folder / new).mkdir(parents=True)
        for k, path in enumerate(sorted((rgbd / old).iterdir())):
            shutil.copy(path, folder / new / f"{k:04d}{path.suffix}")
    shutil.copy(rgbd / "settings.yaml", tmp_path / "phone.yaml")
    return folder


def test_it_runs_and_says_what_was_paired(command: CommandLine, phone: Path) -> None:
    done = run(command, phone, "rgbd", "--settings", "phone.yaml")
    assert done.code == 0, done.err
    (line,) = [line for line in done.err.splitlines() if line.startswith("Note: ")]
    assert f"{N} images of color are paired with depth of depth16 by equal names" in line


def test_quiet_says_nothing(command: CommandLine, phone: Path) -> None:
    done = run(command, phone, "rgbd", "--settings", "phone.yaml", "--quiet")
    assert done.code == 0, done.err
    assert done.err == ""


def test_half_of_it(command: CommandLine, phone: Path) -> None:
    done = run(command, phone / "color", "rgbd", "--settings", "phone.yaml")
    expect_refused(done, "depth in depth16", f"give the folder of both, {phone}")


def test_a_missing_part(command: CommandLine, phone: Path) -> None:
    sorted((phone / "depth16").iterdir())[0].unlink()
    for k, path in enumerate(sorted((phone / "color").iterdir())):
        path.rename(path.with_stem(f"c{k}"))
    done = run(command, phone, "rgbd", "--settings", "phone.yaml")
    expect_refused(done, f"color ({N} images, 8 bits)", f"depth16 ({N - 1} images", "rgb.txt")


def test_the_median_of_depth_is_told(command: CommandLine, phone: Path) -> None:
    done = run(command, phone, "rgbd", "--settings", "phone.yaml")
    depth = Results(Path("r")).report["depth"]
    assert depth["factor"] == 5000
    assert f"median {depth['median_m']:.2f} m with DepthMapFactor 5000" in done.out
    assert "Warning" not in done.err


def test_depth_that_is_too_near_for_the_factor(command: CommandLine, phone: Path) -> None:
    for path in (phone / "depth16").iterdir():
        raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        cv2.imwrite(str(path), (raw / 5 / 3).astype(np.uint16))
    done = run(command, phone, "rgbd", "--settings", "phone.yaml")
    report = Results(Path("r")).report
    assert report["depth"]["median_m"] < 0.5
    assert "DepthMapFactor: 1000 makes it" in done.err
    assert any("DepthMapFactor: 1000" in warning for warning in report["warnings"])
