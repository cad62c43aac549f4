# SPDX-License-Identifier: BSD-3-Clause
"""Draw two maps before and after they met: the picture of the README.

    python -m benchmarks.several_maps.picture --output docs/images/several_maps.png

A camera in a corridor is covered for three seconds and set down elsewhere; then it walks into the
part that it knows.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.harness.arguments import add_counts, new_parser
from benchmarks.harness.folders import CHECKOUT
from benchmarks.several_maps.cases import CASES, FPS
from benchmarks.several_maps.pieces import Pieces
from orbslam2py import Callbacks, MapsMerged, System
from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

LONG = 2.0  # seconds
COLOURS = ("#1f5fa8", "#c8452d", "#3a8f4d")


@dataclass(frozen=True)
class Drawn:
    """Keyframes and points of a map, from above."""

    path: FloatArray
    gaps: IntArray
    """Keyframes before which nothing was seen for long."""
    points: FloatArray


def maps_of(system: System) -> dict[int, Drawn]:
    """What is drawn of every map, each in its own world."""
    drawn = {}
    for there in system.maps:
        snapshot = system.map_snapshot(there.map_index)
        drawn[there.map_index] = Drawn(
            snapshot.keyframe_T_wc[:, [0, 2], 3],
            np.flatnonzero(np.diff(snapshot.keyframe_timestamps) > LONG) + 1,
            snapshot.point_positions[:, [0, 2]],
        )
    return drawn


def draw(axes: Axes, drawn: dict[int, Drawn], title: str) -> None:
    """Draw maps from above, each in its own colour."""
    for number, one in drawn.items():
        colour = COLOURS[number % len(COLOURS)]
        axes.plot(*one.points.T, ",", color=colour, alpha=0.35)
        path = np.insert(one.path, one.gaps, np.nan, axis=0)
        axes.plot(*path.T, ".-", color=colour, linewidth=1, markersize=3, label=f"map {number}")
    middle = np.concatenate([one.path for one in drawn.values()]).mean(axis=0)
    axes.set_xlim(middle[0] - 8, middle[0] + 8)
    axes.set_ylim(middle[1] - 8, middle[1] + 8)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("z [m]")
    axes.set_title(title, fontsize=10)
    axes.legend(loc="upper right", fontsize=8)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    parser = new_parser(__doc__)
    parser.add_argument(
        "--output", type=Path, default=CHECKOUT / "docs" / "images" / "several_maps.png"
    )
    add_counts(parser, seed=(0, "of the wallpaper"))
    given = parser.parse_args(arguments)
    source = SyntheticSequence(
        SyntheticOptions(
            world="corridor", sensor="rgbd", size=(320, 240), pace=2.0, fps=FPS, seed=given.seed
        )
    )
    case = next(case for case in CASES if case.name == "kidnapped")
    order = case.order(len(source), np.random.default_rng(given.seed))
    before: dict[int, Drawn] = {}
    merged: list[MapsMerged] = []
    with System(
        source.settings,
        "rgbd",
        deterministic=True,
        callbacks=Callbacks(on_maps_merged=merged.append),
    ) as system:
        for end in range(1, len(order) + 1):
            piece = Pieces(source, tuple(order), 1 / FPS)
            images = piece.load(end - 1)
            assert images.depth is not None
            system.track_rgbd(images.image, images.depth, (end - 1) / FPS)
            if not merged and len(system.maps) > 1:
                before = maps_of(system)
        after = maps_of(system)
    if not merged:
        print("the maps did not meet; take another seed", file=sys.stderr)
        return 1
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    draw(left, before, "before the merge: each in its own world frame")
    draw(right, after, "after: one map, in the world of the older one")
    figure.savefig(given.output, dpi=110)
    print(f"{given.output} is drawn")
    return 0


if __name__ == "__main__":
    sys.exit(main())
