# SPDX-License-Identifier: BSD-3-Clause
"""Boards with tags: found in rendered images through narrow and wide lenses; how they are named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import CameraModel, SettingsError
from orbslam2py.calibration import AprilGrid, Board, CharucoBoard, Target, parse_board
from support.rendered_boards import BoardRenderer, board_poses, texture_of

NARROW = CameraModel("radtan4", [340, 340, 201, 148, -0.25, 0.07, 0, 0], (400, 300))
#: 190 degrees from side to side.
WIDE = CameraModel("kannala_brandt", [118, 118, 199, 201, 0.01, -0.004, 0.001, -2e-4], (400, 400))
BOARDS = {
    "charuco": CharucoBoard(6, 5, 0.04, 0.029),
    "legacy charuco": CharucoBoard(6, 4, 0.04, 0.029, legacy=True),
    "aprilgrid": AprilGrid(3, 3, 0.06),
}


@pytest.mark.parametrize("lens", ["narrow", "wide"])
@pytest.mark.parametrize("name", BOARDS)
def test_corners_lie_where_the_board_was_drawn(name: str, lens: str) -> None:
    board = BOARDS[name]
    if name == "legacy charuco":
        # Which pattern it is need not be known.
        searched: Target = CharucoBoard(6, 4, 0.04, 0.029)
    else:
        searched = board
    camera = NARROW if lens == "narrow" else WIDE
    degrees, distances = (12, (0.35, 0.45)) if lens == "narrow" else (75, (0.16, 0.22))
    renderer = BoardRenderer(camera, texture_of(board))
    errors = []
    for T in board_poses(board, 4, degrees, distances, seed=3):
        found = searched.find(renderer.render(T))
        if found is None:
            continue
        points = board.points[found.ids] @ T[:3, :3].T + T[:3, 3]
        errors.append(np.linalg.norm(found.pixels - camera.project(points), axis=1))
    assert len(errors) >= 3
    assert np.median(np.concatenate(errors)) < 0.1
    assert np.concatenate(errors).max() < 0.6


def test_a_board_beside_the_image_is_not_found() -> None:
    empty = np.full((300, 400), 120, np.uint8)
    assert all(board.find(empty) is None for board in (*BOARDS.values(), Board(9, 6, 0.025)))


def test_points_of_boards() -> None:
    charuco = CharucoBoard(4, 3, 0.1, 0.07).points
    np.testing.assert_allclose(charuco[:3], [[0.1, 0.1, 0], [0.2, 0.1, 0], [0.3, 0.1, 0]])
    assert len(charuco) == 6
    april = AprilGrid(2, 2, 0.1, 0.3).points
    np.testing.assert_allclose(april[4:8, :2], [[0.13, 0], [0.23, 0], [0.23, 0.1], [0.13, 0.1]])
    np.testing.assert_allclose(april[8, :2], [0, 0.13])


def test_texts_of_boards(tmp_path: Path) -> None:
    assert parse_board("9x6", 0.025) == parse_board("chessboard:9X6", 0.025) == Board(9, 6, 0.025)
    charuco = parse_board("charuco:11x8", 0.03, marker=0.022, dictionary="5X5_100")
    assert charuco == CharucoBoard(11, 8, 0.03, 0.022, "5X5_100")
    assert parse_board("aprilgrid:6x5", 0.088, spacing=0.25) == AprilGrid(6, 5, 0.088, 0.25)
    file = tmp_path / "target.yaml"
    file.write_text(
        "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 5\ntagSize: 0.088\ntagSpacing: 0.3\n"
    )
    assert parse_board(str(file), None) == AprilGrid(6, 5, 0.088, 0.3)
    file.write_text(
        "target_type: checkerboard\ntargetCols: 7\ntargetRows: 6\n"
        "rowSpacingMeters: 0.06\ncolSpacingMeters: 0.06\n"
    )
    assert parse_board(str(file), None) == Board(7, 6, 0.06)


def test_wrong_boards(tmp_path: Path) -> None:
    file = tmp_path / "target.yaml"
    wrong = {
        "target_type: circlegrid\n": "target_type is circlegrid; give a target of Kalibr",
        "target_type: aprilgrid\ntagCols: 6\n": "tagRows, tagSize, tagSpacing must be a number",
        "a: [": "is no YAML",
        "target_type: checkerboard\ntargetCols: 7\ntargetRows: 6\nrowSpacingMeters: 0.06\n"
        "colSpacingMeters: 0.05\n": "0.06 by 0.05 m are no squares; print",
    }
    for text, message in wrong.items():
        file.write_text(text)
        with pytest.raises(SettingsError, match=message):
            parse_board(str(file), None)
    with pytest.raises(SettingsError, match="--square does not belong to the board"):
        parse_board(str(file), 0.08)
    with pytest.raises(SettingsError, match=r"1 x 1 tags cannot be used: give 1 to 100 each way"):
        AprilGrid(1, 1, 0.05)
    with pytest.raises(SettingsError, match=r"first tag is 580; the family 36h11 has"):
        AprilGrid(6, 6, 0.05, first=580)
    with pytest.raises(SettingsError, match=r"the side of a tag is 880 m; give metres"):
        AprilGrid(6, 6, 880)


def test_an_opencv_without_tags_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr("cv2.aruco.CharucoDetector")
    for make in (lambda: CharucoBoard(6, 5, 0.04, 0.029), lambda: AprilGrid(6, 6, 0.05)):
        with pytest.raises(SettingsError, match=r"install 4\.8 or later .* or use a chessboard"):
            make()
    assert parse_board("9x6", 0.025) == Board(9, 6, 0.025)
