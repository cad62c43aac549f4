# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories from above, with equal scales of both axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.runs.report_page.markup import Markup, element, join
from orbslam2py.runs.report_page.plane_view import View
from orbslam2py.runs.report_page.round_numbers import (
    dots_data,
    path_data,
    round_down,
    round_ticks,
    short,
    tick_texts,
)

#: Width of the drawing, and bounds of its shape (height by width).
_WIDTH, _FLATTEST, _TALLEST = 1000.0, 0.35, 1.0
#: Classes of error that the path is coloured by.
N_COLOURS = 8
#: Most corners of a line, most map points.
_CORNERS, _POINTS = 2500, 3000


@dataclass(frozen=True)
class Window:
    """The visible part of the plane: centre and half size, in lengths."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, flat: FloatArray, points: FloatArray) -> Window:
        """Show the trajectory and its surroundings, without points that are too far away."""
        flat = flat if len(flat) else points if len(points) else np.zeros((1, 2))
        low, high = flat.min(axis=0), flat.max(axis=0)
        extent = float((high - low).max())
        if len(points):
            near, far = np.quantile(points, [0.03, 0.97], axis=0)
            room = 0.5 * extent if extent > 0 else np.inf
            low = np.clip(near, low - room, low)
            high = np.clip(far, high, high + room)
        size = np.maximum(high - low, 1e-9)
        middle, half = 0.5 * (low + high), 0.54 * size
        half = np.maximum(half, 0.02 * max(half))
        half[1] = np.clip(half[1], _FLATTEST * half[0], np.inf)
        half[0] = max(half[0], half[1] / _TALLEST)
        return cls(middle - half, middle + half)

    @property
    def height(self) -> float:
        """Of the drawing."""
        size = self.high - self.low
        return float(_WIDTH * size[1] / size[0])

    def place(self, flat: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Convert lengths to positions in the drawing."""
        per_length = _WIDTH / (self.high[0] - self.low[0])
        return per_length * (flat[:, 0] - self.low[0]), per_length * (self.high[1] - flat[:, 1])

    def inside(self, flat: FloatArray) -> FloatArray:
        """Only the visible part."""
        return flat[np.all((flat > self.low) & (flat < self.high), axis=1)]


def thin_path(flat: FloatArray, gaps: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return coordinates of a line with interruptions before `gaps`, with fewer corners."""
    keep = np.arange(0, len(flat), max(1, len(flat) // _CORNERS))
    keep = np.unique(np.concatenate([keep, gaps, gaps - 1, [len(flat) - 1]]).astype(int))
    keep = keep[keep >= 0] if len(flat) else keep[:0]
    where = np.searchsorted(keep, gaps)
    return tuple(np.insert(flat[keep, axis], where, np.nan) for axis in (0, 1))  # type: ignore[return-value]


def path_mark(window: Window, flat: FloatArray, gaps: IntArray, look: str) -> Markup:
    """Draw a path."""
    x, y = thin_path(flat, gaps)
    px, py = window.place(np.stack([x, y], axis=1))
    return element("path", class_=f"line {look}", d=path_data(px, py))


def coloured_path(window: Window, flat: FloatArray, gaps: IntArray, values: FloatArray) -> Markup:
    """Draw a trajectory in the colours of its values: classes 0 to `N_COLOURS` - 1, -1 unknown."""
    px, py = window.place(flat)
    step = max(1, len(flat) // _CORNERS)
    broken = np.zeros(len(flat) + 1, bool)
    broken[gaps] = True
    marks = []
    rows = np.arange(0, len(flat), step)
    for colour in range(-1, N_COLOURS):
        parts = []
        for begin, end in zip(rows, np.minimum(rows + step, len(flat) - 1), strict=True):
            if values[begin] == colour and not broken[begin + 1 : end + 1].any():
                parts.append(f"M{px[begin]:.1f} {py[begin]:.1f}L{px[end]:.1f} {py[end]:.1f}")
        if parts:
            look = f"line path {'e-unknown' if colour < 0 else f'e{colour}'}"
            marks.append(element("path", class_=look, d="".join(parts)))
    return join(*marks)


def colours_of(errors: FloatArray) -> tuple[FloatArray, float]:
    """Classify errors in intervals of equal width.

    Returns
    -------
    classes, largest
        Classes (n,) from 0 to `N_COLOURS` - 1, -1 if the error is unknown; and the largest error.
    """
    known = np.isfinite(errors)
    largest = float(errors[known].max()) if known.any() else 0.0
    classes = np.full(len(errors), -1.0)
    if largest > 0:
        scaled = np.floor(N_COLOURS * errors[known] / largest)
        classes[known] = np.clip(scaled, 0, N_COLOURS - 1)
    else:
        classes[known] = 0
    return classes, largest


def points_mark(window: Window, flat: FloatArray) -> Markup:
    """Draw map points."""
    seen = window.inside(flat)
    seen = seen[:: max(1, -(-len(seen) // _POINTS))]
    return element("path", class_="dots points", d=dots_data(*window.place(seen)))


def dots_mark(window: Window, flat: FloatArray, look: str) -> Markup:
    """Draw dots of a class."""
    return element("path", class_=f"dots {look}", d=dots_data(*window.place(flat)))


def plane(
    window: Window,
    marks: list[Markup],
    view: View,
    unit: str,
    *,
    name: str = "above",
    above: Markup | None = None,
) -> Markup:
    """Put marks into a drawing with axes and a scale bar."""
    size = window.high - window.low
    xs = round_ticks(float(window.low[0]), float(window.high[0]), 6)
    ys = round_ticks(
        float(window.low[1]), float(window.high[1]), max(3, round(6 * size[1] / size[0]))
    )
    px = _WIDTH * (xs - window.low[0]) / size[0]
    py = window.height * (window.high[1] - ys) / size[1]
    grid = [element("path", class_="grid", d=f"M{x:.1f} 0V{window.height:.0f}") for x in px]
    grid += [element("path", class_="grid", d=f"M0 {y:.1f}H{_WIDTH:.0f}") for y in py]
    svg = element(
        "svg",
        *grid,
        *marks,
        viewBox=f"0 0 {_WIDTH:.0f} {window.height:.1f}",
        role="img",
        aria_label=f"Path; right in the picture is {view.right_name}, up is {view.up_name}",
    )
    labels = [
        element("span", text, class_="yt", style=f"top:{100 * y / window.height:.2f}%")
        for text, y in zip(tick_texts(ys), py.tolist(), strict=True)
    ]
    below = [
        element("span", text, class_="xt", style=f"left:{x / _WIDTH * 100:.2f}%")
        for text, x in zip(tick_texts(xs), px.tolist(), strict=True)
    ]
    length = round_down(0.25 * float(size[0]))
    bar = element(
        "span",
        f"{short(length, 1)} {unit}",
        class_="bar",
        style=f"width:{100 * length / float(size[0]):.2f}%",
    )
    corners = [*window.low.tolist(), *window.high.tolist()]
    return element(
        "div",
        element(
            "div",
            *(svg, bar, above, *labels),
            class_="canvas",
            id=name,
            style=f"aspect-ratio:{_WIDTH:.0f}/{window.height:.0f}",
            data_window=",".join(f"{value:.6g}" for value in corners),
            data_axes=f"{view.right},{view.up},{view.up_sign:.0f}",
        ),
        element(
            "div",
            *below,
            element("span", f"{view.right_name} [{unit}]", class_="xl"),
            class_="times",
        ),
        class_="axes",
    )
