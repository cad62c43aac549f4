# SPDX-License-Identifier: BSD-3-Clause
"""Draw the pictures of the guide: a calibration's residuals, and tracking that ends.

    python scripts/draw_guide_pictures.py

Everything in them is made on the spot, so they are the same in every run.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from orbslam2py.calibration import Board, calibrate, find_views
from orbslam2py.calibration.plot import draw_residuals
from orbslam2py.runs import RunOptions, RunResult, SystemOptions, run_sequence
from orbslam2py.settings import Sensor
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

ROOT = Path(__file__).resolve().parents[1]
Image = npt.NDArray[np.uint8]

OK, LOST = "#1f5fa8", "#c8452d"

#: The camera of the calibration: pixels, and OpenCV's distortion.
SIZE = (640, 480)
K = np.array([[520.0, 0.0, 325.0], [0.0, 515.0, 236.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.25, 0.08, 0.0008, -0.0006, 0.0])
BOARD = Board(9, 6, 0.025)


# ---- calibration ---------------------------------------------------------------------------------
def board_image(T_cb: npt.NDArray[np.float64]) -> Image:
    """The board as the camera sees it, each pixel the mean of nine samples."""
    width, height = SIZE
    step = (np.arange(3) + 0.5) / 3 - 0.5
    u, v = np.meshgrid(
        (np.arange(width)[:, None] + step).ravel(), (np.arange(height)[:, None] + step).ravel()
    )
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)[:, None]
    rays = cv2.undistortPoints(pixels, K, DISTORTION)[:, 0]
    R, t = T_cb[:3, :3], T_cb[:3, 3]
    H = np.linalg.inv(np.column_stack([R[:, 0], R[:, 1], t]))
    x, y, w = H @ np.column_stack([rays, np.ones(len(rays))]).T
    column, row = np.floor(x / w / BOARD.square), np.floor(y / w / BOARD.square)
    inside = (column >= -1) & (column < BOARD.columns) & (row >= -1) & (row < BOARD.rows)
    shade = np.where(inside & ((column + row) % 2 == 0), 30.0, 225.0)
    means = shade.reshape(height, 3, width, 3).mean(axis=(1, 3))
    return np.asarray(means, dtype=np.uint8)


def poses(n: int) -> list[npt.NDArray[np.float64]]:
    """Board to camera (4, 4): slanted every way, at different places in the image."""
    generator = np.random.default_rng(2)
    middle = BOARD.points.mean(axis=0)
    found = []
    for _ in range(n):
        T = np.eye(4)
        T[:3, :3] = cv2.Rodrigues(generator.uniform([-0.6, -0.6, -0.4], [0.6, 0.6, 0.4]))[0]
        distance = generator.uniform(0.25, 0.45)
        aim = generator.uniform([-0.3, -0.22], [0.3, 0.22]) * distance
        T[:3, 3] = np.array([*aim, distance]) - T[:3, :3] @ middle
        found.append(T)
    return found


def draw_calibration(path: Path) -> None:
    """Calibrate from made-up views with noise and draw the residuals."""
    generator = np.random.default_rng(3)
    with tempfile.TemporaryDirectory() as folder:
        for i, T_cb in enumerate(poses(24)):
            noisy = board_image(T_cb) + generator.normal(0, 4, SIZE[::-1])
            grey = np.clip(np.rint(noisy), 0, 255).astype(np.uint8)
            cv2.imwrite(f"{folder}/{i:02d}.png", cv2.GaussianBlur(grey, (0, 0), 0.7))
        result = calibrate(find_views(folder, BOARD), BOARD)
    draw_residuals(path, result, title="Calibration from board.mp4")


# ---- lost ----------------------------------------------------------------------------------------
def race(stride: int) -> RunResult:
    """The race of docs/guide/tuning.md#it-gets-lost."""
    options = SyntheticOptions(
        world="corridor", sensor="rgbd", frames=60, size=(320, 240), speed=6.0
    )
    sequence = SyntheticSequence(options)
    wanted = RunOptions(Sensor.RGBD, SystemOptions(deterministic=True), stride=stride)
    result = run_sequence(sequence, wanted).result
    if result.error is not None:
        sys.exit(f"the run failed: {result.error}")
    return result


def draw_inliers(axes: Axes, result: RunResult, title: str) -> None:
    """Inliers of every frame, lost ones marked at the bottom."""
    rows = [row for row in result.rows if row.record is not None]
    x = np.array([row.index for row in rows])
    inliers = np.array([row.record.n_inliers for row in rows if row.record is not None])
    lost = np.array([row.state == "LOST" for row in rows])
    axes.plot(x[~lost], inliers[~lost], "o-", color=OK, markersize=4, linewidth=1, label="tracked")
    if lost.any():
        axes.plot(x[lost], 0 * x[lost], "x", color=LOST, markersize=6, label="lost")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("image")
    axes.grid(color="#eeeeee", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.legend(fontsize=8, frameon=False)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def draw_lost(path: Path) -> None:
    """The same race with every fourth image, and with all of them."""
    figure = Figure(figsize=(9, 3.4), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    draw_inliers(left, race(4), "every fourth image")
    draw_inliers(right, race(1), "all images")
    left.set_ylabel("inliers")
    figure.savefig(path)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "docs/images")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    draw_calibration(folder / "calibration.png")
    draw_lost(folder / "lost.png")


if __name__ == "__main__":
    main()
