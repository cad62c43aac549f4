# SPDX-License-Identifier: BSD-3-Clause
"""The page of what can be read is that of the code's lists, and its examples are recognised."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from orbslam2py.datasets.base import Layout
from orbslam2py.datasets.readable import READABLE_LAYOUTS
from orbslam2py.settings.foreign import FORMATS, CalibrationText, ForeignFormat
from orbslam2py.trajectory import read_trajectory
from orbslam2py.trajectory.layouts import TRAJECTORY_LAYOUTS, TrajectoryLayout
from support.documents import ROOT, read


def test_the_page_is_made_of_the_code() -> None:
    command = [sys.executable, "scripts/format_reference.py", "--check"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_every_layout_is_on_the_page() -> None:
    named = [layout for one in READABLE_LAYOUTS for layout in one.layouts]
    assert sorted(named) == sorted(Layout), "each once"


@pytest.mark.parametrize("kind", FORMATS, ids=lambda kind: kind.name)
def test_examples_of_calibrations_are_recognised(kind: ForeignFormat) -> None:
    if "..." in kind.example:
        pytest.skip("the example is cut short")
    first = next(one for one in FORMATS if one.sign(CalibrationText(kind.example)))
    assert first is kind


@pytest.mark.parametrize("layout", TRAJECTORY_LAYOUTS, ids=lambda layout: layout.name)
def test_examples_of_trajectories_are_read(layout: TrajectoryLayout, tmp_path: Path) -> None:
    path = tmp_path / "path.txt"
    path.write_text(layout.example)
    poses = read_trajectory(path)
    assert poses.positions[0] == pytest.approx([1, 2, 3])


def test_the_page_is_linked() -> None:
    assert "reference/formats.md" in read(ROOT / "mkdocs.yml")
