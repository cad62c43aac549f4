# SPDX-License-Identifier: BSD-3-Clause
"""The picture of several maps: one panel for each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from orbslam2py import _palette as palette
from orbslam2py._figures import write_figure
from orbslam2py._palette import hexadecimal
from orbslam2py.runs.plots import draw_map_from_above
from orbslam2py.runs.several_maps.drawn_map import DrawnMap

#: Panels that a picture has room for; of more maps those with the longest paths are drawn.
MOST_PANELS = 12
#: Width and height of a panel, and height of the head [inches].
_PANEL = (5.6, 3.5)
_HEAD = 0.85


def draw_maps(
    path: Path, maps: Sequence[DrawnMap], *, title: str, unit: str = "m", main: int | None = None
) -> None:
    """Draw maps from above, each in its own colour and world, into a picture.

    Parameters
    ----------
    path : Path
        The file; its suffix determines the format, PNG without one.
    maps : sequence of DrawnMap
        At least one.
    title : str
        First line above the picture.
    unit : str
        Unit of length for the axes; each map of a single camera has its own.
    main : int, optional
        Number of the map of the run's figures.

    Raises
    ------
    OutputFileError
        If the suffix is of no known format of pictures.
    OSError
        If the file cannot be written.
    """
    # The object interface keeps the process-wide state of pyplot untouched.
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415

    longest = sorted(maps, key=lambda one: -len(one.positions))[:MOST_PANELS]
    shown = sorted(longest, key=lambda one: one.number)
    n_columns = min(len(shown), 2 if len(shown) < 5 else 3)
    n_rows = math.ceil(len(shown) / n_columns)
    height = n_rows * _PANEL[1] + _HEAD
    figure = Figure(figsize=(n_columns * _PANEL[0], height), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    said = "Each map has its own world frame: the relative position of two maps has no meaning."
    if len(shown) < len(maps):
        said += f" The {len(shown)} longest of {len(maps)} maps."
    figure.suptitle(f"{title}\n{said}", fontsize=10, parse_math=False)  # names may have dollars
    panels = figure.subplots(n_rows, n_columns, squeeze=False).ravel()
    for panel in panels[len(shown) :]:
        panel.set_axis_off()
    for panel, one in zip(panels, shown, strict=False):
        colour = palette.paper_map_colour(one.number)
        draw_map_from_above(
            panel,
            positions=one.positions,
            gaps=one.gaps,
            keyframes=one.keyframes,
            points=one.points,
            loops=one.loops,
            colour=colour,
            unit=unit,
        )
        text = f"{one.title}{' (main)' if one.number == main else ''}"
        ink = hexadecimal(colour)
        panel.set_title(text, fontsize=10, loc="left", color=ink, parse_math=False)
    write_figure(path, figure)
