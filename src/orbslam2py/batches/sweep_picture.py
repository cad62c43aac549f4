# SPDX-License-Identifier: BSD-3-Clause
"""A picture of a sweep: the error against each parameter."""

from __future__ import annotations

import statistics
from pathlib import Path
from typing import Any

from orbslam2py._figures import write_figure
from orbslam2py.batches.table import printable

_PREFIX = "sweep."
_PER_ROW = 3
_PANEL = (4.0, 3.2)
_ERROR = "ate_rmse_m"


def write_sweep_picture(path: Path, rows: list[dict[str, Any]]) -> bool:
    """Draw the error of every run over each varied key, one colour for each sequence.

    Runs that failed, or tracked too little for an error, are crosses at the bottom, so that no run
    is left out. A line joins the medians where a value was used more than once.

    Parameters
    ----------
    path
        The file; its suffix determines the format.
    rows
        The table of the batch.

    Returns
    -------
    bool
        False if nothing was varied; then there is no file.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415 (who sweeps nothing does not wait for it)

    keys = sorted({name for row in rows for name in row if name.startswith(_PREFIX)})
    if not keys:
        return False
    columns = min(len(keys), _PER_ROW)
    lines = -(-len(keys) // columns)
    figure = Figure(figsize=(_PANEL[0] * columns, _PANEL[1] * lines), layout="constrained")
    for number, key in enumerate(keys):
        axes = figure.add_subplot(lines, columns, number + 1)
        _draw(axes, key, rows)
        if number == 0:
            for text in axes.legend(fontsize="small").get_texts():
                text.set_parse_math(False)  # names may have dollars
    write_figure(path, figure, dpi=120)
    return True


def _draw(axes: Any, key: str, rows: list[dict[str, Any]]) -> None:
    sequences = sorted({str(row["sequence"]) for row in rows})
    for number, sequence in enumerate(sequences):
        mine = [row for row in rows if row["sequence"] == sequence and row.get(key) is not None]
        judged = [row for row in mine if row.get(_ERROR) is not None]
        colour, name = f"C{number % 10}", printable(sequence)
        values = [float(row[key]) for row in judged]
        errors = [float(row[_ERROR]) for row in judged]
        axes.plot(values, errors, "o", color=colour, alpha=0.6, label=name)
        medians = _medians(values, errors)
        if len(medians) < len(values):
            axes.plot(*zip(*medians, strict=True), "-", color=colour)
        lost = [float(row[key]) for row in mine if row.get(_ERROR) is None]
        if lost:
            axes.plot(
                *(lost, [0.02] * len(lost), "x"),
                color=colour,
                transform=axes.get_xaxis_transform(),
                label=f"{name}: no result",
            )
    axes.set_xlabel(key.removeprefix(_PREFIX))
    axes.set_ylabel("ATE [m]")
    axes.set_ylim(bottom=0)
    axes.grid(visible=True, alpha=0.3)


def _medians(values: list[float], errors: list[float]) -> list[tuple[float, float]]:
    """Return the median of the errors at each value, in the order of the values."""
    by_value: dict[float, list[float]] = {}
    for value, error in zip(values, errors, strict=True):
        by_value.setdefault(value, []).append(error)
    return [(value, statistics.median(by_value[value])) for value in sorted(by_value)]
