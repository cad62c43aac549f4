# SPDX-License-Identifier: BSD-3-Clause
"""Plots over time as SVG of any width: line widths are constant, and texts are HTML."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.report_page.markup import Markup, element, join
from orbslam2py.runs.report_page.round_numbers import (
    dots_data,
    path_data,
    round_ticks,
    thin,
    tick_texts,
)

#: Of the drawing, before it is stretched.
WIDTH, HEIGHT = 1000.0, 260.0


@dataclass(frozen=True, eq=False)
class Line:
    """Values over time."""

    name: str
    """For the legend; empty for none."""
    x: FloatArray
    """Seconds, ascending, (n,)."""
    y: FloatArray
    """(n,), nan for missing values."""
    look: str
    """Colour class in the page's style."""
    kind: str = "line"
    """``line``, ``dots``, ``steps`` or ``area`` (down to zero)."""

    def draw(self, plot: TimePlot) -> Markup:
        """Make its mark."""
        x, y = (self.x, self.y) if self.kind in ("dots", "steps") else thin(self.x, self.y)
        if self.kind == "dots":
            known = np.isfinite(y)
            x, y = x[known], y[known]
        if self.kind == "steps":
            x, y = np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]
        px, py = plot.across(x), plot.down(y)
        if self.kind == "dots":
            return element("path", class_=f"dots {self.look}", d=dots_data(px, py))
        if self.kind == "area" and len(x):
            px, py = np.append(px, [px[-1], px[0]]), np.append(np.nan_to_num(py), [HEIGHT, HEIGHT])
            return element("path", class_=f"area {self.look}", d=path_data(px, py) + "z")
        return element("path", class_=f"line {self.look}", d=path_data(px, py))


@dataclass(frozen=True)
class Span:
    """A stretch of time."""

    begin: float
    end: float
    look: str
    title: str


@dataclass(frozen=True)
class Mark:
    """A moment with an event."""

    x: float
    look: str
    title: str


@dataclass(frozen=True, eq=False)
class TimePlot:
    """One plot over the time of a run."""

    name: str
    """Id of the plot's element."""
    title: str
    unit: str
    lines: list[Line]
    duration: float
    spans: list[Span] = field(default_factory=list)
    marks: list[Mark] = field(default_factory=list)
    top: float | None = None
    """Highest value; by default that of the lines."""
    note: str | Markup = ""
    """Below the plot."""
    legend: tuple[tuple[str, str], ...] = ()
    """Further classes and names for the legend."""

    @property
    def highest(self) -> float:
        """Value at the upper edge."""
        if self.top is not None:
            return self.top
        tops = [float(np.nanmax(line.y)) for line in self.lines if np.isfinite(line.y).any()]
        largest = max(tops, default=0.0)
        return 1.06 * largest if largest > 0 else 1.0

    def across(self, x: FloatArray) -> FloatArray:
        """Convert seconds to positions in the drawing."""
        return WIDTH * np.asarray(x, np.float64) / (self.duration or 1.0)

    def down(self, y: FloatArray) -> FloatArray:
        """Convert values to positions in the drawing."""
        return HEIGHT * (1 - np.asarray(y, np.float64) / self.highest)

    def figure(self) -> Markup:
        """Return the plot: caption, legend, drawing, axes."""
        legend = [(line.look, line.name) for line in self.lines if line.name]
        keys = [element("span", element("i", class_=look), name) for look, name in
                (*legend, *self.legend)]  # fmt: skip
        caption = element(
            "figcaption",
            element("b", self.title),
            element("small", f" [{self.unit}]") if self.unit else None,
            element("span", *keys, class_="legend") if keys else None,
        )
        return element(
            "figure",
            caption,
            self._canvas(),
            element("p", self.note, class_="note") if self.note else None,
            class_="plot",
            id=self.name,
        )

    def _canvas(self) -> Markup:
        ups = round_ticks(0.0, self.highest, 5)
        svg = element(
            "svg",
            *(element("path", class_="grid", d=f"M0 {y:.1f}H{WIDTH:.0f}") for y in self.down(ups)),
            *(_span(self, span) for span in self.spans),
            *(line.draw(self) for line in self.lines),
            *(_mark(self, mark) for mark in self.marks),
            viewBox=f"0 0 {WIDTH:.0f} {HEIGHT:.0f}",
            preserveAspectRatio="none",
            role="img",
            aria_label=f"{self.title} over time",
        )
        texts = zip(tick_texts(ups), self.down(ups) / HEIGHT, strict=True)
        labels = [
            element("span", text, class_="yt", style=f"top:{100 * at:.2f}%") for text, at in texts
        ]
        return element(
            "div",
            element("div", svg, *labels, class_="canvas", data_time=f"{self.duration:.6f}"),
            time_ticks(self.duration),
            class_="axes",
        )


def time_ticks(duration: float) -> Markup:
    """Return the time axis below a plot."""
    ticks = round_ticks(0.0, duration or 1.0, 6)
    texts = tick_texts(ticks)
    spans = [
        element("span", text, class_="xt", style=f"left:{100 * tick / (duration or 1.0):.2f}%")
        for tick, text in zip(ticks.tolist(), texts, strict=True)
    ]
    return element("div", *spans, element("span", "time [s]", class_="xl"), class_="times")


def strip(
    name: str,
    title: str,
    spans: list[Span],
    ticks: FloatArray,
    marks: list[Mark],
    duration: float,
    legend: list[tuple[str, str]],
) -> Markup:
    """Return a band of states over time, with rows of ticks (keyframes) and of marks below it."""
    plot = TimePlot(name, title, "", [], duration)
    x = plot.across(ticks).tolist()
    svg = element(
        "svg",
        *(_span(plot, span, 0.0, 0.62) for span in spans),
        element("path", class_="tick", d="".join(f"M{at:.1f} {0.7 * HEIGHT:.0f}v60" for at in x)),
        *(_mark(plot, mark) for mark in marks),
        viewBox=f"0 0 {WIDTH:.0f} {HEIGHT:.0f}",
        preserveAspectRatio="none",
        role="img",
        aria_label=f"{title} over time; keyframes are the short lines below",
    )
    keys = [element("span", element("i", class_=look), text) for look, text in legend]
    keys.append(element("span", element("i", class_="tick"), f"keyframes made: {len(ticks)}"))
    return element(
        "figure",
        element("figcaption", element("b", title), element("span", *keys, class_="legend")),
        element(
            "div",
            element("div", svg, class_="canvas", data_time=f"{duration:.6f}"),
            time_ticks(duration),
            class_="axes",
        ),
        class_="plot strip",
        id=name,
    )


def _span(plot: TimePlot, span: Span, top: float = 0.0, bottom: float = 1.0) -> Markup:
    begin, end = plot.across(np.array([span.begin, span.end])).tolist()
    # A single frame of a long run is still to be seen.
    return element(
        "rect",
        element("title", span.title),
        class_=f"span {span.look}",
        x=f"{begin:.2f}",
        y=f"{top * HEIGHT:.0f}",
        width=f"{max(end - begin, 1.5):.2f}",
        height=f"{(bottom - top) * HEIGHT:.0f}",
    )


def _mark(plot: TimePlot, mark: Mark) -> Markup:
    x = float(plot.across(np.array([mark.x]))[0])
    title = element("title", mark.title)
    return element("path", title, class_=f"mark {mark.look}", d=f"M{x:.1f} 0V{HEIGHT:.0f}")


def figures(*plots: TimePlot | None) -> Markup:
    """Join those plots that exist."""
    return join(*(plot.figure() for plot in plots if plot is not None))
