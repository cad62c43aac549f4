# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of results."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _palette as palette
from orbslam2py._figures import write_figure
from orbslam2py._palette import hexadecimal
from orbslam2py.runs.gravity import Height
from orbslam2py.runs.report_page.plane_view import FROM_ABOVE, View, choose_view
from orbslam2py.runs.report_page.round_numbers import round_down, short
from orbslam2py.runs.timeline import Timeline, gaps_in_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = npt.NDArray[np.float64]

_ESTIMATE = hexadecimal(palette.PAPER_PATH)
_TRUTH = hexadecimal(palette.PAPER_TRUTH)
_UNTRACKED = hexadecimal(palette.PAPER_UNTRACKED)
_POINTS = hexadecimal(palette.PAPER_POINTS)
_LOOP = hexadecimal(palette.PAPER_LOOP)
_TEXT = hexadecimal(palette.PAPER_TEXT)
_GRID = hexadecimal(palette.PAPER_GRID)
_ERRORS = [hexadecimal(colour) for colour in palette.PAPER_ERRORS]
#: How much white is in the shade behind times in another map.
_SHADE = 0.72
#: Width by height of the view from above.
_SHAPE = 1.85
#: Room for words around the axes, in parts of the picture. Measuring the words instead would take
#: longer than drawing them.
_MARGINS = {"left": 0.11, "right": 0.98, "bottom": 0.065, "top": 0.92, "hspace": 0.2}


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
    errors: FloatArray | None = None,
    timeline: Timeline | None = None,
    subtitle: str = "",
    unit: str = "m",
    height: Height | None = None,
) -> None:
    """Draw the trajectory from above, and its height over time, into a picture.

    If the camera moved more vertically than forward, the trajectory is drawn from behind.

    Parameters
    ----------
    path : Path
        The file; its suffix determines the format, PNG without one.
    title, subtitle : str
        Two lines of text above the picture.
    positions : array of float64, (n, 3)
        Camera positions in `unit`, in the camera frame of the first keyframe (x right, y down, z
        forward), or in level axes there (`level_frame`).
    seconds : array of float64, (n,)
        Time since the first image.
    keyframes : array of float64, (k, 3)
        Positions of keyframes.
    points : array of float64, (p, 3)
        Map points.
    truth : tuple of (seconds, positions), optional
        Ground truth, aligned with the estimate.
    loops : array of float64, (l, 2, 3), optional
        Positions of the two keyframes of every loop.
    gaps : array of bool, (n,), optional
        Whether the trajectory is interrupted before each position; by default only at long pauses.
    errors : array of float64, (n,), optional
        Distance of each position to the ground truth in `unit`, nan if unknown; it determines the
        colours.
    timeline : Timeline, optional
        Length of the whole recording; by default that of the positions.
    unit : str
        Unit of length of all positions, for the axes.
    height : Height, optional
        The up direction; by default that of the first camera.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(10, 8), dpi=110)
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, 1, height_ratios=[3.2, 1], gridspec_kw=_MARGINS)
    figure.suptitle(
        f"{title}\n{subtitle}" if subtitle else title,
        fontsize=11,
        y=0.99,
        va="top",
        parse_math=False,  # names may have dollars
    )

    estimate = _Path(seconds, positions, gaps_in_time(seconds) if gaps is None else gaps)
    true = None if truth is None else _Path(*truth, gaps_in_time(truth[0]))
    view = choose_view(positions)
    coloured = errors is not None and bool(np.isfinite(errors).any())
    label = None if coloured else "estimate"  # else the bar of colours names it
    _draw_flat(above, view, estimate, keyframes, points, true, label)
    if errors is not None and coloured:
        _draw_errors(above, view, estimate, errors, unit)
    if loops is not None and len(loops):
        _draw_loops(above, view, loops)
    above.legend(loc="best", fontsize=9, framealpha=0.9, markerscale=1.2)
    _say_where_up_is(above, view, unit)
    height = height or Height.of_first_keyframe()
    _draw_height(below, estimate, true, height, timeline)
    below.set_xlabel("time since the first image [s]")
    below.set_ylabel(f"{height.label} [{unit}]")
    for axes in (above, below):
        axes.grid(color=_GRID, linewidth=0.8)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    write_figure(path, figure)


def draw_map_from_above(
    axes: Axes,
    *,
    positions: FloatArray,
    gaps: npt.NDArray[np.bool_],
    keyframes: FloatArray,
    points: FloatArray,
    loops: FloatArray,
    colour: palette.Colour,
    unit: str,
) -> None:
    """Draw one of several maps into its panel; arrays as for `draw_trajectory`."""
    view = choose_view(positions)
    path = _Path(np.arange(float(len(positions))), positions, gaps)
    _draw_flat(axes, view, path, keyframes, points, None, "path", hexadecimal(colour))
    if len(loops):
        _draw_loops(axes, view, loops)
    _say_where_up_is(axes, view, unit)
    axes.legend(loc="best", fontsize=7, framealpha=0.9)
    axes.grid(color=_GRID, linewidth=0.8)
    axes.set_axisbelow(True)


@dataclass(frozen=True)
class _Path:
    """Positions (n, 3) over time (n,), and whether there is a gap before each."""

    seconds: FloatArray
    positions: FloatArray
    gaps: npt.NDArray[np.bool_]

    def draw(self, axes: Axes, x: FloatArray, y: FloatArray, **style: Any) -> None:
        """Draw a line with gaps; a position between two gaps becomes a dot."""
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
    shaded = [(_UNTRACKED, "not tracked", timeline.untracked)]
    for number, spans in timeline.in_others.items():
        colour = palette.lighter(palette.paper_map_colour(number), _SHADE)
        shaded.append((hexadecimal(colour), f"in map {number}", spans))
    for colour_text, label, spans in shaded:
        for place, (begin, end) in enumerate(spans):
            name = label if place == 0 else None
            axes.axvspan(begin, end, color=colour_text, linewidth=0, label=name)
    if any(spans for _, _, spans in shaded):
        axes.legend(loc="best", fontsize=8, framealpha=0.9, ncols=1 + len(shaded) // 4)
    end = max([timeline.duration, *(span[1] for span in timeline.untracked)])
    if end > 0:
        axes.set_xlim(-0.01 * end, 1.01 * end)


def _draw_flat(
    axes: Axes,
    view: View,
    estimate: _Path,
    keyframes: FloatArray,
    points: FloatArray,
    truth: _Path | None,
    label: str | None,
    colour: str = _ESTIMATE,
) -> None:
    flat, dots = view.flatten(estimate.positions), view.flatten(points)
    true = None if truth is None else view.flatten(truth.positions)
    low, high = _window(flat if true is None else np.vstack([flat, true]), dots)
    if len(points):
        seen = dots[np.all((dots > low) & (dots < high), axis=1)]
        small: dict[str, Any] = {"s": 2.0, "color": _POINTS, "linewidths": 0, "rasterized": True}
        axes.scatter(*seen.T, label="map points", **small)
    if truth is not None and true is not None:
        # Wide enough to be seen on both sides of an estimate that lies on it.
        truth.draw(axes, *true.T, color=_TRUTH, linewidth=6.0, label="ground truth")
    estimate.draw(axes, *flat.T, color=colour, linewidth=1.4, label=label)
    rings: dict[str, Any] = {"facecolors": "white", "edgecolors": colour, "linewidths": 0.7}
    x, y = view.flatten(keyframes).T
    if len(keyframes):
        axes.scatter(x, y, s=9, zorder=3, label="keyframes", **rings)
    axes.scatter(flat[:1, 0], flat[:1, 1], s=50, marker="s", color=colour, zorder=4, label="start")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal", adjustable="box")


def _window(path: FloatArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner of the visible part."""
    low, high = path.min(axis=0), path.max(axis=0)
    # The window follows the path and shows the points around it, but not those so far away that
    # they would shrink the path to a dot. It has the shape of the axes: lengths are equal on both.
    extent = float((high - low).max())
    if len(points):
        near, far = np.quantile(points, [0.03, 0.97], axis=0)
        low = np.clip(near, low - 2.0 - 0.5 * extent, low)
        high = np.clip(far, high, high + 2.0 + 0.5 * extent)
    center, half = 0.5 * (low + high), 0.5 * (high - low) + 0.1 + 0.05 * extent
    half = np.array([max(half[0], half[1] * _SHAPE), max(half[1], half[0] / _SHAPE)])
    return center - half, center + half


def _draw_errors(axes: Axes, view: View, estimate: _Path, errors: FloatArray, unit: str) -> None:
    """Colour the trajectory by its distance to the ground truth, with a colour bar."""
    from matplotlib.collections import LineCollection  # noqa: PLC0415
    from matplotlib.colors import LinearSegmentedColormap  # noqa: PLC0415
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415

    flat = view.flatten(estimate.positions)
    joined = np.flatnonzero(~estimate.gaps[1:] & np.isfinite(errors[:-1]))
    colours = LinearSegmentedColormap.from_list("error", _ERRORS)
    lines = LineCollection(
        [flat[[k, k + 1]] for k in joined.tolist()], cmap=colours, linewidths=2.2, zorder=2.5
    )
    lines.set_array(errors[joined])
    lines.set_clim(0.0, float(np.nanmax(errors)) or 1.0)
    lines.set_capstyle("round")
    axes.add_collection(lines, autolim=False)
    # Few ticks: labels of many digits would push the bar's own label out of the picture.
    ticks = MaxNLocator(nbins=4, steps=[1, 2, 5, 10])
    bar = axes.figure.colorbar(
        lines, ax=axes, shrink=0.85, fraction=0.1, pad=0.01, ticks=ticks, format="{x:g}"
    )
    bar.set_label(f"estimate: distance to the ground truth [{unit}]")


def _say_where_up_is(axes: Axes, view: View, unit: str) -> None:
    """Label the axes, name the up direction, and draw a scale bar."""
    axes.set_xlabel(f"{view.right_name} [{unit}]")
    axes.set_ylabel(f"{view.up_name} [{unit}]")
    whence = "From above" if view is FROM_ABOVE else "From behind"
    text = f"{whence}: up in the picture is {view.up_name}, as the first keyframe looked"
    axes.set_title(text, fontsize=9, loc="left", color=hexadecimal(palette.PAPER_FAINT_TEXT))
    left, right = axes.get_xlim()
    bottom, top = axes.get_ylim()
    length = round_down(0.2 * (right - left))
    x, y = left + 0.03 * (right - left), bottom + 0.05 * (top - bottom)
    axes.plot(
        [x, x + length], [y, y], color=hexadecimal(palette.PAPER_TEXT), linewidth=2.0, zorder=6
    )
    axes.annotate(f"{short(length, 1)} {unit}", (x + length / 2, y), xytext=(0, 3),
                  textcoords="offset points", ha="center", fontsize=9)  # fmt: skip


def _draw_loops(axes: Axes, view: View, loops: FloatArray) -> None:
    # Ends of a closed loop are close together: rings around them show where they are.
    look: dict[str, Any] = {"marker": "o", "markersize": 9, "markerfacecolor": "none"}
    for number, ends in enumerate(loops):
        label = "loops closed" if number == 0 else None
        x, y = view.flatten(ends).T
        axes.plot(x, y, color=_LOOP, linewidth=2.0, zorder=5, label=label, **look)
