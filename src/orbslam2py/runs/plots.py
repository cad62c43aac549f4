# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from orbslam2py._files import atomic_write

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

_ESTIMATE = "#1f5fa8"
_TRUTH = "#9a9a9a"
_POINTS = "#c9b99a"
_LOOP = "#c8442c"
#: Width by height of the view from above.
_SHAPE = 1.85


def draw_trajectory(
    path: Path,
    *,
    title: str,
    positions: FloatArray,
    seconds: FloatArray,
    keyframes: FloatArray,
    points: FloatArray,
    truth: tuple[FloatArray, FloatArray] | None = None,
    loops: FloatArray | None = None,
    subtitle: str = "",
    unit: str = "m",
) -> None:
    """Draw the path from above, and its height over time, into a PNG file.

    Parameters
    ----------
    path : Path
        Where to write.
    title, subtitle : str
        Two lines of text above the picture.
    positions : array of float64, (n, 3)
        Camera positions in `unit`, in the camera frame of the first image (x right, y down, z
        forward).
    seconds : array of float64, (n,)
        Time since the first image.
    keyframes : array of float64, (k, 3)
        Positions of keyframes.
    points : array of float64, (p, 3)
        Map points.
    truth : tuple of (seconds, positions), optional
        Ground truth, aligned to the estimate.
    loops : array of float64, (l, 2, 3), optional
        Positions of the two keyframes of every loop.
    unit : str
        Unit of length of the estimate, for the axes.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(10, 8), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    above, height = figure.subplots(2, 1, height_ratios=[3.2, 1])
    figure.suptitle(f"{title}\n{subtitle}" if subtitle else title, fontsize=11)

    _draw_above(above, positions, keyframes, points, truth)
    if loops is not None and len(loops):
        _draw_loops(above, loops)
    above.legend(loc="best", fontsize=9, framealpha=0.9, markerscale=1.2)
    above.set_xlabel(f"x (right) [{unit}]")
    above.set_ylabel(f"z (forward) [{unit}]")
    if truth is not None:
        height.plot(truth[0], -truth[1][:, 1], color=_TRUTH, linewidth=2.5)
    height.plot(seconds, -positions[:, 1], color=_ESTIMATE, linewidth=1.2)
    height.set_xlabel("time [s]")
    height.set_ylabel(f"height [{unit}]")
    low, high = height.get_ylim()
    if high - low < 0.1:  # a level path should look level
        middle = 0.5 * (low + high)
        height.set_ylim(middle - 0.05, middle + 0.05)
    for axes in (above, height):
        axes.grid(color="#eeeeee", linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    with atomic_write(path, binary=True) as stream:
        figure.savefig(stream, format="png")


def _draw_above(
    axes: Axes,
    positions: FloatArray,
    keyframes: FloatArray,
    points: FloatArray,
    truth: tuple[FloatArray, FloatArray] | None,
) -> None:
    path = positions if truth is None else np.vstack([positions, truth[1]])
    low, high = path[:, [0, 2]].min(axis=0), path[:, [0, 2]].max(axis=0)
    # The window follows the path and shows the points around it, but not those so far away that
    # they would shrink the path to a dot. It has the shape of the axes: lengths are equal on both.
    extent = float((high - low).max())
    if len(points):
        near, far = np.quantile(points[:, [0, 2]], [0.03, 0.97], axis=0)
        low = np.clip(near, low - 2.0 - 0.5 * extent, low)
        high = np.clip(far, high, high + 2.0 + 0.5 * extent)
    center, half = 0.5 * (low + high), 0.5 * (high - low) + 0.1 + 0.05 * extent
    half = np.array([max(half[0], half[1] * _SHAPE), max(half[1], half[0] / _SHAPE)])
    low, high = center - half, center + half
    if len(points):
        inside = np.all((points[:, [0, 2]] > low) & (points[:, [0, 2]] < high), axis=1)
        axes.scatter(
            points[inside, 0],
            points[inside, 2],
            s=2.0,
            color=_POINTS,
            linewidths=0,
            label="map points",
            rasterized=True,
        )
    if truth is not None:
        axes.plot(truth[1][:, 0], truth[1][:, 2], color=_TRUTH, linewidth=3.0, label="ground truth")
    axes.plot(positions[:, 0], positions[:, 2], color=_ESTIMATE, linewidth=1.4, label="estimate")
    axes.scatter(
        keyframes[:, 0],
        keyframes[:, 2],
        s=14,
        facecolors="white",
        edgecolors=_ESTIMATE,
        linewidths=0.9,
        zorder=3,
        label="keyframes",
    )
    axes.scatter(
        positions[:1, 0],
        positions[:1, 2],
        s=50,
        marker="s",
        color=_ESTIMATE,
        zorder=4,
        label="start",
    )
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")


def _draw_loops(axes: Axes, loops: FloatArray) -> None:
    # Ends of a closed loop are close together: rings around them show where they are.
    for number, ends in enumerate(loops):
        axes.plot(
            ends[:, 0],
            ends[:, 2],
            color=_LOOP,
            linewidth=2.0,
            marker="o",
            markersize=9,
            markerfacecolor="none",
            zorder=5,
            label="loops closed" if number == 0 else None,
        )
