# SPDX-License-Identifier: BSD-3-Clause
"""Plots of the last minute: inliers and time per stage."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._palette import MAPPED, STAGE_COLOURS, TEXT, Colour
from orbslam2py.slam.records import TrackingRecord, TrackingState

if TYPE_CHECKING:
    import viser
    import viser.uplot

#: Seconds that are shown.
SPAN = 60.0
#: Images that are kept; of those beyond, every other one is left out.
_CAPACITY = 4096
#: Around the axes [px]: above, so that the highest number is whole, right, below, left.
_PADDING = (12, 8, 0, 0)
#: Stages of tracking that are shown if there are such.
STAGES = ("extract", "stereo", "predict", "local_map", "keyframe")


class LastMinute:
    """Figures of the images of the last minute."""

    def __init__(self) -> None:
        self._rows: deque[tuple[float, ...]] = deque(maxlen=_CAPACITY)

    def add(self, record: TrackingRecord, now: float | None = None) -> None:
        """Add the figures of an image."""
        inliers = float(record.n_inliers) if record.state is TrackingState.OK else 0.0
        milliseconds = [record.milliseconds.get(stage, 0.0) for stage in STAGES]
        total = record.milliseconds.get("track", sum(milliseconds))
        seen = time.perf_counter() if now is None else now
        self._rows.append((seen, inliers, total, *milliseconds))

    def table(self, now: float | None = None) -> FloatArray:
        """Return figures by image (n, 8): seconds (0 is now), inliers, ms in total, by stage."""
        rows = np.array(self._rows) if self._rows else np.zeros((0, 3 + len(STAGES)))
        rows[:, 0] -= time.perf_counter() if now is None else now
        return rows[rows[:, 0] > -SPAN]


class Plots:
    """The plots of a page.

    Parameters
    ----------
    server : viser.ViserServer
        The page; the plots are put at the present position in it.
    """

    def __init__(self, server: viser.ViserServer) -> None:
        none = np.zeros(0)
        time_axis: viser.uplot.Axis = {"show": True, "label": "", "size": 26}
        scales: dict[str, viser.uplot.Scale] = {
            "x": {"time": False, "range": (-SPAN, 0.0)},
            "y": {"auto": True},
        }
        self._inliers = server.gui.add_uplot(
            (none, none),
            ({"label": "s"}, _series("inliers", MAPPED)),
            title="Inliers",
            padding=_PADDING,
            scales=scales,
            axes=(time_axis, {"size": 52}),
            height=120,
        )
        self._stages = server.gui.add_uplot(
            tuple(none for _ in range(2 + len(STAGES))),
            (
                {"label": "s"},
                _series("all", TEXT),
                *(_series(name.replace("_", " "), STAGE_COLOURS[name]) for name in STAGES),
            ),
            title="Tracking, milliseconds",
            padding=_PADDING,
            scales=scales,
            axes=(time_axis, {"size": 52}),
            height=150,
        )

    def draw(self, table: FloatArray) -> None:
        """Show the figures of `LastMinute.table`."""
        seconds = np.ascontiguousarray(table[:, 0])
        self._inliers.data = (seconds, np.ascontiguousarray(table[:, 1]))
        self._stages.data = (seconds, *(np.ascontiguousarray(column) for column in table[:, 2:].T))


def _series(label: str, colour: Colour) -> viser.uplot.Series:
    return {"label": label, "stroke": "rgb({}, {}, {})".format(*colour), "width": 1.5}
