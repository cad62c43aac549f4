# SPDX-License-Identifier: BSD-3-Clause
"""Picture of what a calibration leaves unexplained."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py import _palette as palette
from orbslam2py._figures import write_figure
from orbslam2py._palette import hexadecimal
from orbslam2py.calibration.calibration import Calibration

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_DOTS = hexadecimal(palette.PAPER_PATH)
_ARROWS = hexadecimal(palette.PAPER_LOOP)
_LINES = hexadecimal(palette.PAPER_LINE)
#: Length of the arrow of a large residual, as a part of the image's width.
_ARROW = 0.04
#: Nice scales for arrows.
_SCALES = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000)


def draw_residuals(path: str | PathLike[str], calibration: Calibration, *, title: str) -> None:
    """Draw the residuals over the image, as a cloud, and the error of every view, into a picture.

    Parameters
    ----------
    path
        Where to write; the suffix gives the format, PNG without one.
    calibration
        What to show.
    title
        First line above the picture.

    Raises
    ------
    OutputFileError
        If the ending is that of no format of pictures that is known here.
    OSError
        If the file cannot be written.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(11, 7.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.6, 1], height_ratios=[2.9, 1])
    K, n = calibration.K, len(calibration.views)
    figure.suptitle(
        f"{title}\nreprojection error {calibration.rms:.3f} pixels (RMS), {n} views, fx "
        f"{K[0, 0]:.1f}, fy {K[1, 1]:.1f}, cx {K[0, 2]:.1f}, cy {K[1, 2]:.1f}",
        fontsize=11,
        parse_math=False,  # names may have dollars
    )
    _draw_image(figure.add_subplot(grid[0, 0]), calibration)
    _draw_cloud(figure.add_subplot(grid[0, 1]), calibration)
    _draw_views(figure.add_subplot(grid[1, :]), calibration)
    write_figure(path, figure)


def _draw_image(axes: Axes, calibration: Calibration) -> None:
    width, height = calibration.size
    corners, residuals = calibration.corners, calibration.residuals
    large = float(np.percentile(np.linalg.norm(residuals, axis=1), 95))
    fitting = [scale for scale in _SCALES if scale * large <= _ARROW * width]
    scale = fitting[-1] if fitting else 1
    axes.scatter(corners[:, 0], corners[:, 1], s=2.5, color=_DOTS, linewidths=0)
    axes.quiver(
        *corners.T,
        *(scale * residuals).T,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.0014,
        headwidth=3.5,
        headlength=4,
        color=_ARROWS,
    )
    axes.plot(*calibration.K[:2, 2], "+", color="black", markersize=11, label="principal point")
    axes.set_xlim(-0.5, width - 0.5)
    axes.set_ylim(height - 0.5, -0.5)
    axes.set_aspect(
        "equal",
        adjustable="box",
    )
    axes.set_title(
        f"corners and residuals ({scale} times as long); {calibration.coverage:.0%} of the image "
        "covered",
        fontsize=10,
    )
    axes.set_xlabel("u [pixels]")
    axes.set_ylabel("v [pixels]")
    axes.legend(loc="upper right", fontsize=9)


def _draw_cloud(axes: Axes, calibration: Calibration) -> None:
    residuals = calibration.residuals
    limit = 1.15 * max(float(np.abs(residuals).max()), 1e-6)
    axes.scatter(residuals[:, 0], residuals[:, 1], s=5, color=_DOTS, alpha=0.45, linewidths=0)
    angle = np.linspace(0, 2 * np.pi, 200)
    axes.plot(
        calibration.rms * np.cos(angle),
        calibration.rms * np.sin(angle),
        color=_ARROWS,
        linewidth=1.4,
        label=f"RMS {calibration.rms:.3f}",
    )
    axes.set_xlim(-limit, limit)
    axes.set_ylim(limit, -limit)
    axes.set_aspect("equal", adjustable="box")
    axes.set_title("residuals", fontsize=10)
    axes.set_xlabel("du [pixels]")
    axes.set_ylabel("dv [pixels]")
    _tidy(axes)
    axes.legend(loc="upper right", fontsize=9)


def _draw_views(axes: Axes, calibration: Calibration) -> None:
    errors = [view.error for view in calibration.views]
    axes.bar(np.arange(1, len(errors) + 1), errors, color=_DOTS, width=0.75)
    axes.axhline(calibration.rms, color=_ARROWS, linewidth=1.4)
    axes.set_xlim(0.3, len(errors) + 0.7)
    axes.set_title("error of every view", fontsize=10)
    axes.set_xlabel("view")
    axes.set_ylabel("RMS [pixels]")
    _tidy(axes)


def _tidy(axes: Axes) -> None:
    axes.grid(color=hexadecimal(palette.PAPER_GRID), linewidth=0.8)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(_LINES)
