# SPDX-License-Identifier: BSD-3-Clause
"""Round numbers for axes, and lines reduced to visible points."""

from __future__ import annotations

import math

import numpy as np

from orbslam2py._arrays import FloatArray

#: Text for a missing value.
NONE = "\N{EN DASH}"

#: Most buckets that a line is reduced to; each keeps its smallest and its largest value.
_BUCKETS = 600


def round_ticks(low: float, high: float, n: int) -> FloatArray:
    """Choose round numbers between two bounds.

    Parameters
    ----------
    low, high
        The bounds, finite, `low` below `high`.
    n
        Approximate largest number of values.

    Returns
    -------
    array of float64, (k,)
        Multiples of 1, 2 or 5 times a power of ten.
    """
    raw = (high - low) / max(1, n)
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= 0.999 * raw)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    ticks: FloatArray = step * np.arange(first, last + 1, dtype=np.float64)
    return ticks


def round_down(value: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that does not exceed a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= 1.001 * value)


def tick_texts(ticks: FloatArray) -> list[str]:
    """Write ticks with just enough decimals to distinguish them."""
    if len(ticks) < 2:
        return [short(float(tick)) for tick in ticks]
    step = float(ticks[1] - ticks[0])
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    if max(np.abs(ticks)) >= 1e6 or decimals > 6:
        return [f"{tick:.3g}" for tick in ticks]
    return [f"{0.0 if abs(tick) < step / 2 else tick:.{decimals}f}" for tick in ticks]


def short(value: float, digits: int = 3) -> str:
    """Write a number with `digits` significant digits; never with an exponent below a million."""
    if not math.isfinite(value):
        return NONE
    if value == 0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size >= 6 or size < -5:
        return f"{value:.{digits}g}"
    return f"{value:.{max(0, digits - 1 - size)}f}"


def thin(x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Keep the visible points of a line: the lowest and the highest value in each bucket.

    Parameters
    ----------
    x, y
        (n,) each, x ascending; nan in y interrupts the line.

    Returns
    -------
    x, y
        At most 1800 values; a bucket without a value keeps one nan.
    """
    if len(x) <= 2 * _BUCKETS:
        return x, y
    width = -(-len(x) // _BUCKETS)
    padded = np.full(width * -(-len(x) // width), np.nan)
    padded[: len(y)] = y
    rows = padded.reshape(-1, width)
    gaps = np.isnan(rows)
    first = width * np.arange(len(rows))
    known = first[~gaps.all(axis=1)]
    inside = rows[~gaps.all(axis=1)]
    kept = [
        known + np.where(np.isnan(inside), np.inf, inside).argmin(axis=1),
        known + np.where(np.isnan(inside), -np.inf, inside).argmax(axis=1),
        (first + gaps.argmax(axis=1))[gaps.any(axis=1)],
    ]
    chosen = np.unique(np.concatenate(kept))
    chosen = chosen[chosen < len(x)]
    return x[chosen], y[chosen]


def path_data(x: FloatArray, y: FloatArray) -> str:
    """Return a line as the ``d`` of an SVG path; nan interrupts it, one point becomes a dot."""
    said = []
    down = False
    broken = np.isnan(x) | np.isnan(y)
    for px, py, gap in zip(x.tolist(), y.tolist(), broken.tolist(), strict=True):
        if gap:
            down = False
            continue
        said.append(f"{'L' if down else 'M'}{px:.1f} {py:.1f}" + ("" if down else "h0"))
        down = True
    return "".join(said)


def dots_data(x: FloatArray, y: FloatArray) -> str:
    """Return points as the ``d`` of an SVG path, whose round line ends form the dots."""
    return "".join(f"M{px:.1f} {py:.1f}h0" for px, py in zip(x.tolist(), y.tolist(), strict=True))
