# SPDX-License-Identifier: BSD-3-Clause
"""Points are followed from image to image, and from left to right."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orbslam2py._arrays import ByteArray
from orbslam2py.calibration.pair_rows import disparities_of, measure_rows
from orbslam2py.calibration.tracks import PointTracker


def wallpaper(right: float = 0.0, down: float = 0.0) -> ByteArray:
    """A smooth random texture, seen shifted by pixels."""
    noise = np.random.default_rng(1).integers(0, 255, (300, 400), np.uint8)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.0)
    smooth = cv2.normalize(smooth, None, 0, 255, cv2.NORM_MINMAX)
    shift = np.array([[1, 0, right - 40], [0, 1, down - 30]], np.float64)
    return np.asarray(cv2.warpAffine(smooth, shift, (320, 240)), np.uint8)


def test_pairs_come_at_even_distances_and_are_exact() -> None:
    tracker = PointTracker(every=3, spans=2)
    frames = []
    for number in range(8):
        for pair in tracker.add(wallpaper(1.5 * number, -0.5 * number)):
            frames.append(pair.frames)
            moved = np.median(pair.second - pair.first, axis=0)
            n = pair.frames[1] - pair.frames[0]
            assert moved == pytest.approx([1.5 * n, -0.5 * n], abs=0.1)
            assert len(pair) >= 60
    assert frames == [(0, 3), (0, 6), (3, 6)]


def test_points_are_followed_wherever_they_go() -> None:
    """Also where one turns back."""
    tracker = PointTracker(every=4)
    places = [0.0, 6.0, 12.0, 8.0, 4.0, 16.0, 28.0, 16.0, 4.0]
    found = {}
    for place in places:
        for pair in tracker.add(wallpaper(place)):
            found[pair.frames] = float(np.median(pair.second[:, 0] - pair.first[:, 0]))
    assert found == pytest.approx({(0, 4): 4, (0, 8): 4, (4, 8): 0}, abs=0.1)


def test_nothing_to_follow_gives_no_pairs() -> None:
    tracker = PointTracker(every=1)
    black = np.zeros((240, 320), np.uint8)
    assert not any(tracker.add(image) for image in (black, black, wallpaper(), black, black))


def test_no_point_begins_where_the_mask_is_black() -> None:
    mask = np.zeros((240, 320), np.uint8)
    mask[:, 160:] = 255
    tracker = PointTracker(every=1)
    tracker.add(wallpaper(), mask)
    (pair,) = tracker.add(wallpaper(), mask)
    assert pair.first[:, 0].min() >= 155


@pytest.mark.parametrize(("down", "right", "wrong"), [(0, -12, 0), (4, -12, 0), (0, 12, 1)])
def test_rows_and_signs_of_a_pair(down: float, right: float, wrong: float) -> None:
    rows = measure_rows(wallpaper(), wallpaper(right, down))
    assert rows is not None
    assert rows.row_difference == pytest.approx(abs(down), abs=0.1)
    assert rows.wrong_sign == pytest.approx(wrong, abs=0.05)
    assert rows.n_points > 100


def test_a_black_pair_says_nothing() -> None:
    black = np.zeros((240, 320), np.uint8)
    assert measure_rows(black, black) is None
    assert measure_rows(wallpaper(), black) is None


def test_disparities() -> None:
    points = np.random.default_rng(2).uniform((60, 40), (260, 200), (50, 2))
    found = disparities_of(wallpaper(), wallpaper(-9.0), points)
    assert (found > 0).mean() > 0.8
    assert found[found > 0] == pytest.approx(9.0, abs=0.2)
    assert not disparities_of(wallpaper(), wallpaper(9.0), points).any()
    assert len(disparities_of(wallpaper(), wallpaper(), np.zeros((0, 2)))) == 0
