# SPDX-License-Identifier: BSD-3-Clause
"""Images of a chessboard as a camera with known intrinsics and distortion sees it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import cv2
import numpy as np

SIZE = (640, 480)
K = np.array([[520.0, 0.0, 325.0], [0.0, 515.0, 236.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.25, 0.08, 0.0008, -0.0006, 0.0])
COLUMNS, ROWS, SQUARE = 9, 6, 0.025
_OVERSAMPLING = 3


def poses(n: int, seed: int = 0) -> list[np.ndarray]:
    """Board to camera, (4, 4): slanted every way, at different places in the image."""
    generator = np.random.default_rng(seed)
    middle = np.array([(COLUMNS - 1) * SQUARE / 2, (ROWS - 1) * SQUARE / 2, 0.0])
    found = []
    for _ in range(n):
        angles = generator.uniform([-0.6, -0.6, -0.4], [0.6, 0.6, 0.4])
        distance = generator.uniform(0.25, 0.45)
        T = np.eye(4)
        T[:3, :3] = cv2.Rodrigues(angles)[0]
        aim = generator.uniform([-0.22, -0.16], [0.22, 0.16]) * distance
        T[:3, 3] = np.array([*aim, distance]) - T[:3, :3] @ middle
        found.append(T)
    return found


def _undistorted(pixels: np.ndarray) -> np.ndarray:
    """Normalised coordinates (n, 2) of pixels: the distortion inverted by fixed-point iteration.

    Each step leaves less than a third of the error; float32 is good for 1e-4 pixels.
    """
    x, y = wanted = ((pixels - K[:2, 2]) / (K[0, 0], K[1, 1])).T.astype(np.float32)
    k1, k2, p1, p2, k3 = DISTORTION.astype(np.float32)
    for _ in range(14):
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        x, y = (
            (wanted[0] - 2 * p1 * x * y - p2 * (r2 + 2 * x * x)) / radial,
            (wanted[1] - p1 * (r2 + 2 * y * y) - 2 * p2 * x * y) / radial,
        )
    return np.stack([x, y], axis=1)


@cache
def _rays() -> tuple[np.ndarray, np.ndarray]:
    """Directions (x, y, 1) of the samples of all pixels, float32; pixel centres are whole."""
    (width, height), n = SIZE, _OVERSAMPLING
    u, v = np.meshgrid(
        (np.arange(width * n) + 0.5) / n - 0.5, (np.arange(height * n) + 0.5) / n - 0.5
    )
    rays = _undistorted(np.stack([u.ravel(), v.ravel()], axis=1))
    return np.ascontiguousarray(rays[:, 0]), np.ascontiguousarray(rays[:, 1])


def render(T_cb: np.ndarray) -> np.ndarray:
    """Grey image (h, w): every sample's ray is followed to the plane of the board."""
    (width, height), n = SIZE, _OVERSAMPLING
    R, t = T_cb[:3, :3], T_cb[:3, 3]
    # A plane's homography: from rays to board coordinates in squares, from -1 to COLUMNS.
    H = np.linalg.inv(np.column_stack([R[:, 0], R[:, 1], t])) / np.array([[SQUARE], [SQUARE], [1]])
    x, y = _rays()
    board = [a * x + b * y + c for a, b, c in H.astype(np.float32)]
    column, row = (np.floor(one / board[2]).astype(np.int32) for one in board[:2])
    inside = (column >= -1) & (column < COLUMNS) & (row >= -1) & (row < ROWS)
    dark = inside & ((column + row) & 1 == 0)
    samples = dark.reshape(height, n, width, n).sum(axis=(1, 3), dtype=np.int32)
    return (225.0 - (225.0 - 30.0) * samples / n**2).astype(np.uint8)


@cache
def _views(n: int) -> list[np.ndarray]:
    return [render(T_cb) for T_cb in poses(n)]


def write_views(folder: Path, n: int = 16) -> Path:
    """Images 0.png, 1.png... of the board from everywhere."""
    for i, image in enumerate(_views(n)):
        assert cv2.imwrite(str(folder / f"{i}.png"), image)
    return folder
