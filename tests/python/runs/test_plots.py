# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py.runs import plots
from orbslam2py.runs.plots import draw_trajectory
from orbslam2py.runs.report_page.plane_view import choose_view
from orbslam2py.runs.timeline import Timeline
from support.files import names_in
from support.made_up_rows import FPS, rows_of

pytestmark = pytest.mark.watchdog(20)


@pytest.mark.parametrize("n", [1, 2, 200])
@pytest.mark.parametrize("with_truth", [False, True])
def test_picture(tmp_path: Path, n: int, with_truth: bool) -> None:
    angles = np.linspace(0, 2 * np.pi, n)
    positions = np.stack([10 * np.cos(angles), 0 * angles, 10 * np.sin(angles)], axis=1)
    path = tmp_path / "t.png"
    draw_trajectory(
        path,
        title="a $strange_$ name [x]",
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


# ---- what there is to see ------------------------------------------------------------------------
def circle(n: int = 200) -> np.ndarray:
    angles = np.linspace(0, 2 * np.pi, n)
    return np.stack([10 * np.cos(angles), np.sin(angles), 10 * np.sin(angles)], axis=1)


def drawn(path: Path, positions: np.ndarray, **more: Any) -> np.ndarray:
    values: dict[str, Any] = {
        "seconds": np.arange(len(positions)) / FPS,
        "keyframes": np.zeros((0, 3)),
        "points": np.zeros((0, 3)),
    }
    draw_trajectory(path, title="t", positions=positions, **values | more)
    picture = cv2.imread(str(path))
    assert picture is not None
    return picture


def pixels_of(picture: np.ndarray, colour: str, within: int = 0) -> np.ndarray:
    """Rows and columns (n, 2) of the pixels that have this colour, or nearly."""
    bgr = [int(colour[i : i + 2], 16) for i in (5, 3, 1)]
    return np.argwhere((abs(picture.astype(int) - bgr) <= within).all(axis=2))


def test_ground_truth_is_seen_under_a_perfect_estimate(tmp_path: Path) -> None:
    positions = circle()
    seconds = np.arange(200) / FPS
    picture = drawn(tmp_path / "p", positions, keyframes=positions[::4], truth=(seconds, positions))
    middle = picture.shape[0] * 0.7
    rows = pixels_of(picture, plots._TRUTH)[:, 0]
    assert (rows < middle).sum() > 2000, "from above"
    assert (rows > middle).sum() > 1000, "over time"


def test_gaps_are_gaps(tmp_path: Path) -> None:
    gaps = np.zeros(200, bool)
    gaps[[50, 150]] = True
    positions, seconds = circle(), np.arange(200) / FPS
    # Half of the circle is missing, and half of the time.
    kept = np.r_[0:50, 150:200]
    pictures = [
        drawn(tmp_path / "a", positions[kept], seconds=seconds[kept]),
        drawn(tmp_path / "b", positions[kept], seconds=seconds[kept], gaps=gaps[kept]),
    ]
    blue = [len(pixels_of(picture, plots._ESTIMATE)) for picture in pictures]
    np.testing.assert_array_equal(pictures[0], pictures[1], "ten seconds are a gap by themselves")
    straight = drawn(tmp_path / "c", positions[kept])
    assert len(pixels_of(straight, plots._ESTIMATE)) > blue[0] + 300, "20 m of a straight line"


def test_a_pose_between_two_gaps_is_a_dot(tmp_path: Path) -> None:
    lonely = np.array([[0.0, 0, 0], [1, 0, 1], [2, 0, 2]])
    picture = drawn(tmp_path / "p", lonely, gaps=np.array([False, True, True]))
    start = drawn(tmp_path / "q", lonely[:1])
    assert len(pixels_of(picture, plots._ESTIMATE)) >= len(pixels_of(start, plots._ESTIMATE))


def test_time_axis_is_that_of_the_recording(tmp_path: Path) -> None:
    rows = rows_of("n" * 50 + "k" * 50 + "r" + "l" * 99)
    timeline = Timeline.of(rows, 0)
    positions, seconds = circle(50), np.arange(50, 100) / FPS
    picture = drawn(tmp_path / "p", positions, seconds=seconds, timeline=timeline)
    below = np.arange(len(picture)) > 0.75 * len(picture)
    marked = pixels_of(picture, plots._UNTRACKED)
    marked = marked[below[marked[:, 0]], 1]
    line = pixels_of(picture, plots._ESTIMATE)
    line = line[below[line[:, 0]], 1]
    width = marked.max() - marked.min()
    assert line.min() - marked.min() == pytest.approx(0.25 * width, abs=0.02 * width)
    assert line.max() - marked.min() == pytest.approx(0.5 * width, abs=0.02 * width)
    assert not ((marked > line.min() + 5) & (marked < line.max() - 5)).any()


def test_errors_colour_the_path(tmp_path: Path) -> None:
    positions, seconds = circle(), np.arange(200) / FPS
    truth = (seconds, positions)
    plain = drawn(tmp_path / "a", positions, truth=truth)
    errors = np.linspace(0, 0.5, 200)
    coloured = drawn(tmp_path / "b", positions, truth=truth, errors=errors)
    unknown = drawn(tmp_path / "c", positions, truth=truth, errors=np.full(200, np.nan))
    np.testing.assert_array_equal(unknown, plain, "no colours without a known error")
    for colour in (plots._ERRORS[0], plots._ERRORS[-1]):
        assert len(pixels_of(plain, colour, within=1)) == 0
        assert len(pixels_of(coloured, colour, within=1)) > 10, "on the path and in the bar"
    top = coloured[: int(0.7 * len(coloured))]
    assert len(pixels_of(top, plots._ESTIMATE)) < len(pixels_of(plain, plots._ESTIMATE)) / 4


@pytest.mark.parametrize("largest", [0.000037, 0.00079, 0.0123, 0.0345, 0.28, 7.5, 123.4, 4567.0])
def test_labels_of_the_colour_bar_are_in_the_picture(tmp_path: Path, largest: float) -> None:
    positions = circle()
    truth = (np.arange(200) / FPS, positions)
    errors = np.linspace(0, largest, 200)
    picture = drawn(tmp_path / "p", positions, truth=truth, errors=errors)
    assert (picture[:, -3:] > 250).all(), "nothing is cut off at the right"


def test_a_camera_that_climbs_is_seen_from_behind() -> None:
    climb = np.stack([np.zeros(9), -np.arange(9.0), 0.1 * np.arange(9.0)], axis=1)
    view = choose_view(climb)
    assert (view.right_name, view.up_name) == ("right", "up")
    np.testing.assert_allclose(view.flatten(climb), np.stack([np.zeros(9), np.arange(9.0)], axis=1))
    walk = climb[:, [0, 2, 1]]
    assert choose_view(walk).up_name == "forward"
    assert choose_view(walk[:1]).up_name == "forward"
