# SPDX-License-Identifier: BSD-3-Clause
"""Corners of a board as cameras see them, computed, with noise."""

from __future__ import annotations

import numpy as np

from orbslam2py import CameraModel
from orbslam2py.calibration import BoardViews, Target
from orbslam2py.calibration.chessboard import BoardView
from support.rendered_boards import board_poses

#: Cameras of all models; three of them see 150 degrees and more.
CAMERAS = {
    "pinhole": CameraModel("pinhole", [470, 468, 321, 238], (640, 480)),
    "radtan4": CameraModel("radtan4", [458, 457, 330, 236, -0.283, 0.0739, 2e-4, 1e-5], (640, 480)),
    "radtan5": CameraModel(
        "radtan5", [470, 468, 321, 238, -0.3, 0.14, 2e-4, 1e-4, -0.04], (640, 480)
    ),
    "rational": CameraModel(
        "rational", [420, 419, 318, 242, 2.1, 0.6, 1e-4, 2e-4, 0.03, 2.4, 1.1, 0.1], (640, 480)
    ),
    "thin_prism": CameraModel(
        "thin_prism",
        [420, 419, 318, 242, 2.1, 0.6, 1e-4, 2e-4, 0.03, 2.4, 1.1, 0.1, 2e-3, 0, -1e-3, 0],
        (640, 480),
    ),
    "kannala_brandt": CameraModel(
        "kannala_brandt", [145, 145, 254, 257, 0.01, -0.004, 0.001, -0.0002], (512, 512)
    ),
    "double_sphere": CameraModel(
        "double_sphere", [158.3, 158.1, 255, 257, -0.17, 0.59], (512, 512)
    ),
    "eucm": CameraModel("eucm", [190, 190, 255, 254, 0.59, 1.1], (512, 512)),
    "mei": CameraModel("mei", [600, 600, 320, 240, 1.1, -0.2, 0.1, 5e-4, 0], (640, 480)),
    "fov": CameraModel("fov", [250, 250, 320, 240, 0.93], (640, 480)),
}


def views_of_poses(
    camera: CameraModel,
    board: Target,
    poses: list[np.ndarray],
    *,
    noise: float = 0.05,
    seed: int = 1,
) -> BoardViews:
    """What a camera sees of a board: corners beside the image are missing."""
    generator = np.random.default_rng(seed)
    found = BoardViews(camera.image_size)
    for number, T in enumerate(poses):
        pixels = camera.project(board.points @ T[:3, :3].T + T[:3, 3])
        inside = np.isfinite(pixels).all(axis=1)
        inside[inside] &= (pixels[inside] >= 0).all(axis=1)
        inside[inside] &= (pixels[inside] <= np.array(camera.image_size) - 1).all(axis=1)
        name = f"{number:03d}.png"
        found.names.append(name)
        found.n_searched += 1
        if inside.sum() >= 12:
            ids = np.flatnonzero(inside)
            seen = pixels[ids] + generator.normal(0, noise, (len(ids), 2))
            found.views.append(BoardView(name, seen, ids))
    return found


def views_everywhere(camera: CameraModel, board: Target, n: int = 16) -> BoardViews:
    """Views of a board at all places of the image."""
    angles = np.degrees(camera.angle_of_view())
    return views_of_poses(camera, board, board_poses(board, n, 0.45 * max(angles[:2]), (0.3, 0.5)))


def ray_errors(found: CameraModel, true: CameraModel, pixels: np.ndarray) -> np.ndarray:
    """Angles between the rays of two cameras at pixels (n, 2), degrees.

    A turn of the camera, which the poses of the board take, is removed before.
    """
    a, b = found.unproject(pixels), true.unproject(pixels)
    U, _, Vt = np.linalg.svd(a.T @ b)
    turned = a @ U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(turned - b, axis=1) / 2, 0, 1)))
