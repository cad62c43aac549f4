# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a run."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py.runs.plots import draw_trajectory
from support.files import names_in

pytestmark = pytest.mark.watchdog(20)


@pytest.mark.parametrize("n", [1, 2, 200])
@pytest.mark.parametrize("with_truth", [False, True])
def test_picture(tmp_path: Path, n: int, with_truth: bool) -> None:
    angles = np.linspace(0, 2 * np.pi, n)
    positions = np.stack([10 * np.cos(angles), 0 * angles, 10 * np.sin(angles)], axis=1)
    path = tmp_path / "t.png"
    draw_trajectory(
        path,
        title="a $strange_ name [x]",
        positions=positions,
        seconds=np.arange(float(n)),
        keyframes=positions[::20],
        points=np.vstack([positions + 1, [[1e9, 0, 0]]]),
        truth=(np.arange(float(n)), positions + 0.1) if with_truth else None,
    )
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.shape[0] > 500
    # The estimate's blue is there.
    blue = (picture[:, :, 0] > 140) & (picture[:, :, 2] < 80)
    assert blue.sum() > 100
    assert names_in(tmp_path) == ["t.png"]


def test_axes_tell_the_unit(tmp_path: Path) -> None:
    pictures = []
    for unit in ("m", "units"):
        draw_trajectory(
            tmp_path / unit,
            title="t",
            positions=np.eye(3),
            seconds=np.arange(3.0),
            keyframes=np.eye(3),
            points=np.zeros((0, 3)),
            unit=unit,
        )
        picture = cv2.imread(str(tmp_path / unit))
        assert picture is not None
        pictures.append(picture)
    rows, columns = np.nonzero((pictures[0] != pictures[1]).any(axis=2))
    height, width = pictures[0].shape[:2]
    # The labels differ, left and below; and with their size, a little, the axes.
    assert columns.min() < 0.05 * width
    assert rows.max() > 0.5 * height
