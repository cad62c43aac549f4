# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from orbslam2py._files import atomic_write
from orbslam2py.runs.gravity import Height
from orbslam2py.runs.timeline import Timeline, gaps_in_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

_ESTIMATE = "#1f5fa8"
_TRUTH = "#8fce7e"
_UNTRACKED = "#f6cfc6"
_EARLIER = "#e2e2e2"
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
    gaps: npt.NDArray[np.bool_] | None = None,
    timeline: Timeline | None = None,
    subtitle: str = "",
    unit: str = "m",
    height: Height | None = None,
) -> None:
    """Draw the path from above, and how high it goes over time, into a PNG file.

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
    gaps : array of bool, (n,), optional
        Whether the path is interrupted before each position; by default only where much time
        passes.
    timeline : Timeline, optional
        Of the whole recording; by default that of the positions.
    unit : str
        Unit of length of all positions, for the axes.
    height : Height, optional
        Which way is up; by default as the first camera was held.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(10, 8), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=[3.2, 1])
    figure.suptitle(f"{title}\n{subtitle}" if subtitle else title, fontsize=11)

    estimate = _Path(seconds, positions, gaps_in_time(seconds) if gaps is None else gaps)
    true = None if truth is None else _Path(*truth, gaps_in_time(truth[0]))
    _draw_above(above, estimate, keyframes, points, true)
    if loops is not None and len(loops):
        _draw_loops(above, loops)
    above.legend(loc="best", fontsize=9, framealpha=0.9, markerscale=1.2)
    above.set_xlabel(f"x (right) [{unit}]")
    above.set_ylabel(f"z (forward) [{unit}]")
    height = height or Height.of_first_keyframe()
    _draw_height(below, estimate, true, height, timeline)
    below.set_xlabel("time since the first image [s]")
    below.set_ylabel(f"{height.label} [{unit}]")
    for axes in (above, below):
        axes.grid(color="#eeeeee", linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    with atomic_write(path, binary=True) as stream:
        figure.savefig(stream, format="png")


@dataclass(frozen=True)
class _Path:
    """Positions (n, 3) over time (n,), and whether there is a gap before each."""

    seconds: FloatArray
    positions: FloatArray
    gaps: npt.NDArray[np.bool_]

    def draw(self, axes: Axes, x: FloatArray, y: FloatArray, **style: Any) -> None:
        """Draw a line that ends at gaps; a position between two gaps becomes a dot."""
        where = np.flatnonzero(self.gaps)
        axes.plot(np.insert(x, where, np.nan), np.insert(y, where, np.nan), **style)
        alone = self.gaps | (np.arange(len(x)) == 0)
        alone &= np.append(self.gaps[1:], True)
        size = float(style["linewidth"]) ** 2
        axes.scatter(x[alone], y[alone], s=size, color=style["color"], zorder=2, linewidths=0)


def _draw_height(
    axes: Axes,
    estimate: _Path,
    truth: _Path | None,
    height: Height,
    timeline: Timeline | None,
) -> None:
    if truth is not None:
        up = height.of(truth.positions)
        truth.draw(axes, truth.seconds, up, color=_TRUTH, linewidth=5.0)
    up = height.of(estimate.positions)
    estimate.draw(axes, estimate.seconds, up, color=_ESTIMATE, linewidth=1.2)
    low, high = axes.get_ylim()
    if high - low < 0.1:  # a level path should look level
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.05, middle + 0.05)
    if timeline is None:
        return
    labels = {_UNTRACKED: "not tracked", _EARLIER: "in an earlier map"}
    for spans, color in ((timeline.untracked, _UNTRACKED), (timeline.earlier, _EARLIER)):
        for begin, end in spans:
            axes.axvspan(begin, end, color=color, linewidth=0, label=labels.pop(color, None))
    if len(labels) < 2:
        axes.legend(loc="best", fontsize=8, framealpha=0.9)
    end = max([timeline.duration, *(span[1] for span in timeline.untracked)])
    if end > 0:
        axes.set_xlim(-0.01 * end, 1.01 * end)


def _draw_above(
    axes: Axes,
    estimate: _Path,
    keyframes: FloatArray,
    points: FloatArray,
    truth: _Path | None,
) -> None:
    positions = estimate.positions
    path = positions if truth is None else np.vstack([positions, truth.positions])
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
        # Wide enough to be seen on both sides of an estimate that lies on it.
        x, z = truth.positions[:, 0], truth.positions[:, 2]
        truth.draw(axes, x, z, color=_TRUTH, linewidth=6.0, label="ground truth")
    x, z = positions[:, 0], positions[:, 2]
    estimate.draw(axes, x, z, color=_ESTIMATE, linewidth=1.4, label="estimate")
    axes.scatter(
        keyframes[:, 0],
        keyframes[:, 2],
        s=9,
        facecolors="white",
        edgecolors=_ESTIMATE,
        linewidths=0.7,
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
