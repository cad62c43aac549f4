# SPDX-License-Identifier: BSD-3-Clause
"""Calibration on made-up views of a board."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError, SettingsError
from orbslam2py.calibration import (
    Board,
    BoardViews,
    Calibration,
    calibrate,
    choose_views,
    find_views,
)
from support import chessboards

BOARD = Board(chessboards.COLUMNS, chessboards.ROWS, chessboards.SQUARE)


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return chessboards.write_views(tmp_path_factory.mktemp("board"))


@pytest.fixture(scope="module")
def found(views: Path) -> BoardViews:
    return find_views(views, BOARD)


@pytest.fixture(scope="module")
def result(found: BoardViews) -> Calibration:
    return calibrate(found, BOARD, model="radtan4")


def test_calibration_recovers_the_camera(result: Calibration) -> None:
    np.testing.assert_allclose(result.K, chessboards.K, atol=0.8)
    np.testing.assert_allclose(result.distortion[:2], chessboards.DISTORTION[:2], atol=0.02)
    np.testing.assert_allclose(result.distortion[2:], chessboards.DISTORTION[2:], atol=5e-4)
    assert result.rms < 0.15
    assert result.size == chessboards.SIZE
    assert result.rms == pytest.approx(np.sqrt((result.residuals**2).sum(axis=1).mean()), rel=1e-3)
    nearest, farthest = result.distances
    assert 0.2 < nearest < farthest < 0.6


def test_distances_follow_the_size_of_the_squares(found: BoardViews, result: Calibration) -> None:
    twice = calibrate(found, Board(9, 6, 2 * chessboards.SQUARE), model="radtan4")
    np.testing.assert_allclose(twice.distances, 2 * np.array(result.distances), rtol=1e-3)
    np.testing.assert_allclose(twice.K, result.K, rtol=1e-4)


def test_doubtful_calibrations_say_so(found: BoardViews) -> None:
    few = BoardViews(found.size, found.views[:4], found.n_searched)
    assert any(
        "only 4 different views" in text for text in calibrate(few, BOARD, k3=True).warnings()
    )


def test_views_that_do_not_fit_are_left_out(found: BoardViews) -> None:
    bent = [*found.views]
    noise = np.random.default_rng(0).normal(0, 5, bent[3].corners.shape)
    bent[3] = type(bent[3])(bent[3].name, bent[3].corners + noise)
    result = calibrate(BoardViews(found.size, bent, found.n_searched), BOARD, model="radtan4")
    assert result.left_out == (bent[3].name,)
    assert result.rms < 0.15


def test_chosen_views_differ(found: BoardViews) -> None:
    doubled = BoardViews(found.size, [*found.views, *found.views], 32)
    chosen = choose_views(doubled, 100)
    assert len(chosen) <= len(found.views)
    assert len({view.name for view in chosen}) == len(chosen)
    assert len(choose_views(found, 5)) == 5


def test_video_of_a_board(views: Path, tmp_path: Path) -> None:
    path = tmp_path / "board.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 8, chessboards.SIZE)
    for i in range(16):
        writer.write(cv2.imread(str(views / f"{i}.png")))
    writer.release()
    found = find_views(path, BOARD)  # eight frames per second: every second one
    assert (found.n_searched, found.fps) == (8, 8)
    np.testing.assert_allclose(calibrate(found, BOARD, model="radtan4").K, chessboards.K, atol=4)


def test_bad_input(views: Path, tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no images in"):
        find_views(tmp_path, BOARD)
    with pytest.raises(DatasetError, match="does not exist"):
        find_views(tmp_path / "none", BOARD)
    (tmp_path / "a.png").write_bytes(b"x")
    with pytest.raises(ImageError, match="none of the 1 images"):
        find_views(tmp_path, BOARD)
    cv2.imwrite(str(tmp_path / "b.png"), np.full((480, 640), 90, np.uint8))
    with pytest.raises(DatasetError, match="no board of 9x6 inner corners in any of the 2 images"):
        find_views(tmp_path, BOARD)
    cv2.imwrite(str(tmp_path / "c.png"), np.full((400, 640), 90, np.uint8))
    with pytest.raises(DatasetError, match=r"c\.png of .* is 640 x 400, the images before it 640"):
        find_views(tmp_path, BOARD)


def test_too_few_views(found: BoardViews) -> None:
    few = BoardViews(found.size, found.views[:3], 20)
    with pytest.raises(DatasetError, match=r"only 3 different views .*3 of 20 images"):
        calibrate(few, BOARD)


@pytest.mark.parametrize("text", ["9", "9x", "axb", "9x6x2", "2x6", "900x6"])
def test_bad_boards(text: str) -> None:
    with pytest.raises(SettingsError, match="inner corners"):
        Board.parse(text, 0.025)


def test_corners_have_the_same_numbers_from_both_sides() -> None:
    """The second camera of a pair may see the board upside down."""
    image = chessboards.render(chessboards.poses(6)[5])
    upright, turned = BOARD.find(image), BOARD.find(np.ascontiguousarray(image[::-1, ::-1]))
    assert upright is not None
    assert turned is not None
    middle = np.array(chessboards.SIZE) - 1
    np.testing.assert_allclose(turned.pixels, middle - upright.pixels, atol=0.05)
