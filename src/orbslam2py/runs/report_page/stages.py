# SPDX-License-Identifier: BSD-3-Clause
"""Times of the stages: their distributions, and how many frames were in time."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.runs.latency import LATENCY_STAGES
from orbslam2py.runs.report_page.explained import STAGES, STAGES_BESIDE
from orbslam2py.runs.report_page.markup import Markup, element, join, table
from orbslam2py.runs.report_page.round_numbers import round_ticks, short, tick_texts
from orbslam2py.runs.report_page.run_folder import Frames

_BINS = 60
_HEIGHT = 200.0


def stage_table(frames: Frames) -> Markup:
    """Return the distribution of every stage of tracking: quartiles, median, and figures."""
    rows = {name: frames.milliseconds.get(name) for name in (*STAGES, "track")}
    times = {
        name: ms[np.isfinite(ms)]
        for name, ms in rows.items()
        if ms is not None and np.nan_to_num(ms).any()
    }
    if not times:
        return Markup("")
    most = max(float(np.quantile(ms, 0.99)) for ms in times.values()) or 1.0
    lines: list[list[str | Markup]] = []
    for name, ms in times.items():
        number = list(STAGES).index(name) if name in STAGES else "-all"
        text = STAGES.get(name, "all of the call, without waiting for mapping")
        label = join(element("b", name), element("small", text))
        figures = (np.median(ms), np.mean(ms), np.quantile(ms, 0.99), np.max(ms))
        lines.append([label, _box(ms, most, f"stage{number}"), *(short(float(f)) for f in figures)])
    head = [
        "stage of tracking",
        f"0 to {short(most)} ms",
        "median",
        "mean",
        "99 % within",
        "largest",
    ]
    note = (
        "Times in ms. The box holds the middle half of all frames, the bar in it is the median, "
        "the line reaches from 1 % to 99 %."
    )
    return join(table(head, lines, class_="stages"), element("p", note, class_="note"))


def _box(ms: FloatArray, most: float, look: str) -> Markup:
    low, first, median, third, high = (
        100 * np.quantile(ms, [0.01, 0.25, 0.5, 0.75, 0.99]) / most
    ).tolist()
    return element(
        "svg",
        element("path", class_="whisker", d=f"M{low:.2f} 10H{high:.2f}"),
        element("rect", class_=f"box {look}", x=f"{first:.2f}", y=3,
                width=f"{max(third - first, 0.4):.2f}", height=14),
        element("path", class_="median", d=f"M{median:.2f} 1V19"),
        class_="boxplot",
        viewBox="0 0 100 20",
        preserveAspectRatio="none",
        role="img",
        aria_label=f"distribution with the median {short(float(np.median(ms)))} ms",
    )  # fmt: skip


def background_table(report: dict[str, Any]) -> Markup | None:
    """Times of what runs beside tracking, from report.json; None without any."""
    named = ("mapping", "loop", "adjustment")
    return _figures_of(report, named, STAGES_BESIDE, "stage beside tracking")


def latency_table(report: dict[str, Any]) -> Markup | None:
    """Times from the exposure of a live image to its pose, from report.json; None without any."""
    return _figures_of(report, ("latency",), LATENCY_STAGES, "from exposure to pose")


def _figures_of(
    report: dict[str, Any], named: tuple[str, ...], told: dict[str, str], title: str
) -> Markup | None:
    rows: list[list[str | Markup]] = [
        [join(element("b", name), element("small", told.get(name, ""))),
         *(short(float(numbers[key])) for key in ("median", "mean", "p99")),
         str(numbers["count"])]
        for name, numbers in report.get("milliseconds", {}).items()
        if name.startswith(named)
    ]  # fmt: skip
    if not rows:
        return None
    head = [title, "median [ms]", "mean [ms]", "99 % within [ms]", "how often"]
    return table(head, rows, class_="numbers")


def histogram(frames: Frames) -> Markup | None:
    """Return the duration of track calls, and the share within the time between images."""
    ms = frames.milliseconds.get("track", np.zeros(0))
    ms = ms[np.isfinite(ms)]
    if not len(ms) or not ms.any():
        return None
    right = 1.1 * float(np.quantile(ms, 0.99))
    steps = np.diff(frames.timestamps)
    interval = 1e3 * float(np.median(steps)) if len(steps) else 0.0
    if interval < 3 * right:
        right = max(right, 1.05 * interval)
    counts, _ = np.histogram(np.minimum(ms, right), _BINS, (0.0, right))
    most = max(1, int(counts.max()))
    width = 1000.0 / _BINS
    bars = "".join(
        f"M{k * width:.1f} {_HEIGHT:.0f}v{-_HEIGHT * count / most:.1f}h{width:.1f}V{_HEIGHT:.0f}z"
        for k, count in enumerate(counts.tolist())
        if count
    )
    ticks = round_ticks(0.0, right, 6)
    texts = [
        element("span", text, class_="xt", style=f"left:{100 * tick / right:.2f}%")
        for tick, text in zip(ticks.tolist(), tick_texts(ticks), strict=True)
    ]
    in_time = float(np.mean(ms <= interval)) if interval > 0 else 0.0
    note = f"{100 * in_time:.1f} % of the calls ended within the {short(interval)} ms between two "
    note += "images of the recording (the dashed line)."
    line = element("path", class_="mark m-interval", d=f"M{1000 * interval / right:.1f} 0V200")
    svg = element(
        "svg",
        element("path", class_="bars", d=bars),
        line if 0 < interval <= right else None,
        viewBox=f"0 0 1000 {_HEIGHT:.0f}",
        preserveAspectRatio="none",
        role="img",
        aria_label="How many track calls took how long",
    )
    return element(
        "figure",
        element("figcaption", element("b", "Time of the track calls"), element("small", " [ms]")),
        element("div", element("div", svg, element("span", str(most), class_="yt", style="top:0%"),
                               class_="canvas"),
                element("div", *texts, element("span", "track call [ms]", class_="xl"),
                        class_="times"), class_="axes"),
        element("p", note, class_="note") if interval > 0 else None,
        class_="plot",
        id="plot-histogram",
    )  # fmt: skip
