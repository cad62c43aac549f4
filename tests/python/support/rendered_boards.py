# SPDX-License-Identifier: BSD-3-Clause
"""Images of a board through a camera of any model: each ray is followed to the plane."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from orbslam2py import CameraModel
from orbslam2py.calibration import AprilGrid, Board, CharucoBoard, Target

_OVERSAMPLING = 3
_BACKGROUND, _PAPER, _INK = 110, 225, 30


@dataclass(frozen=True, eq=False)
class Texture:
    """A printed board: grey levels, and the pixel of the board's origin."""

    grey: np.ndarray
    pixels_per_metre: float
    origin: tuple[float, float]
    y_up: bool = False


def texture_of(board: Target, n: int = 40) -> Texture:
    """Draw a board with `n` pixels per square, or per tag."""
    if isinstance(board, CharucoBoard):
        drawn = cv2.aruco.CharucoBoard(
            (board.columns, board.rows),
            board.square,
            board.marker,
            cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{board.dictionary}")),
        )
        drawn.setLegacyPattern(bool(board.legacy))
        grey = drawn.generateImage((board.columns * n, board.rows * n), marginSize=0)
        return _on_paper(grey, n / board.square, n // 2)
    if isinstance(board, AprilGrid):
        return _april_texture(board, n)
    assert isinstance(board, Board)
    squares = np.indices((board.rows + 1, board.columns + 1)).sum(axis=0) % 2 * 255
    grey = np.kron(squares, np.ones((n, n))).astype(np.uint8)
    paper = _on_paper(grey, n / board.square, n // 2)
    return Texture(paper.grey, paper.pixels_per_metre, (paper.origin[0] + n, paper.origin[1] + n))


def _on_paper(grey: np.ndarray, per_metre: float, margin: int) -> Texture:
    inked = np.where(grey > 127, _PAPER, _INK).astype(np.uint8)
    framed = cv2.copyMakeBorder(inked, *[margin] * 4, cv2.BORDER_CONSTANT, value=_PAPER)
    return Texture(framed, per_metre, (margin - 0.5, margin - 0.5))


def _april_texture(board: AprilGrid, n: int) -> Texture:
    """Kalibr's grid: tags with a frame of two cells, and small squares between their corners."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    gap = round(board.spacing * n)
    width, height = (count * n + (count + 1) * gap for count in (board.columns, board.rows))
    grey = np.full((height, width), 255, np.uint8)
    for row in range(board.rows + 1):
        for column in range(board.columns + 1):
            y, x = height - (row + 1) * gap - row * n, column * (n + gap)
            grey[y : y + gap, x : x + gap] = 0
            if row < board.rows and column < board.columns:
                number = board.first + row * board.columns + column
                tag = cv2.aruco.generateImageMarker(dictionary, number, n, borderBits=2)
                grey[y - n : y, x + gap : x + gap + n] = tag
    paper = _on_paper(grey, n / board.tag, n // 2)
    left = paper.origin[0] + gap
    lower = paper.origin[1] + height - gap
    return Texture(paper.grey, paper.pixels_per_metre, (left, lower), y_up=True)


class BoardRenderer:
    """Renders a board through a camera."""

    def __init__(self, camera: CameraModel, texture: Texture) -> None:
        self._camera, self._texture = camera, texture

    @cached_property
    def _rays(self) -> np.ndarray:
        (width, height), n = self._camera.image_size, _OVERSAMPLING
        u, v = np.meshgrid(
            (np.arange(width * n) + 0.5) / n - 0.5, (np.arange(height * n) + 0.5) / n - 0.5
        )
        return self._camera.unproject(np.stack([u.ravel(), v.ravel()], axis=1)).astype(np.float32)

    def render(self, T_cb: np.ndarray) -> np.ndarray:
        """Grey image (h, w) of the board at a pose (4, 4)."""
        (width, height), n, texture = self._camera.image_size, _OVERSAMPLING, self._texture
        T_bc = np.linalg.inv(T_cb).astype(np.float32)
        ray = self._rays @ T_bc[:3, :3].T
        with np.errstate(divide="ignore", invalid="ignore"):
            far = -T_bc[2, 3] / ray[:, 2]
            x, y = (ray[:, i] * far + T_bc[i, 3] for i in (0, 1))
        sign = -1.0 if texture.y_up else 1.0
        u = x * texture.pixels_per_metre + texture.origin[0]
        v = sign * y * texture.pixels_per_metre + texture.origin[1]
        hit = np.isfinite(u) & np.isfinite(v) & (far > 0)
        maps = [
            np.where(hit, values, -1e4).reshape(height * n, width * n).astype(np.float32)
            for values in (u, v)
        ]
        samples = cv2.remap(
            texture.grey,
            *maps,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=_BACKGROUND,
        )
        return cv2.resize(samples, (width, height), interpolation=cv2.INTER_AREA)


def board_poses(
    board: Target, n: int, most_degrees: float, distances: tuple[float, float], seed: int = 0
) -> list[np.ndarray]:
    """Poses (4, 4) of a board that faces the camera about, up to an angle from the axis."""
    generator = np.random.default_rng(seed)
    middle = (board.points.min(axis=0) + board.points.max(axis=0)) / 2
    # The board of Kalibr has y up and is seen from +z; others have y down.
    front = np.diag([1.0, -1.0, -1.0]) if isinstance(board, AprilGrid) else np.eye(3)
    found = []
    for i in range(n):
        angle = np.radians(most_degrees) * np.sqrt((i + 0.5) / n)
        around = 2.4 * i + generator.uniform(0, 0.5)
        axis = np.array([-np.sin(around), np.cos(around), 0.0])
        toward = cv2.Rodrigues(axis * angle)[0]
        slant = cv2.Rodrigues(generator.uniform(-0.6, 0.6, 3))[0]
        T = np.eye(4)
        T[:3, :3] = toward @ slant @ front
        distance = generator.uniform(*distances)
        T[:3, 3] = toward @ [0, 0, distance] - T[:3, :3] @ middle
        found.append(T)
    return found
