# SPDX-License-Identifier: BSD-3-Clause
"""Draw the same run without and with loop closing: the picture of the README.

    python -m benchmarks.loops.picture --case corridor --sensor rgbd --seed 1

The settings are those of benchmarks.loops.quality. Both paths are laid onto the truth at their
start, so that what is gathered on the way shows at the end.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.harness.arguments import SENSORS, add_counts, new_parser
from benchmarks.harness.folders import CHECKOUT
from benchmarks.loops.cases import CASES, Case
from orbslam2py import Sensor, Trajectory
from orbslam2py.evaluation import Similarity, align, lap_error
from orbslam2py.runs import RunResult

Array = npt.NDArray[np.float64]

TRUTH, ESTIMATE, LOOP = "#9a9a9a", "#1f5fa8", "#c8452d"


def run(case: Case, seed: int, *, loop_closing: bool) -> RunResult:
    """Run the case; the same images whether loops are closed or not."""
    result = case.run(case.sequence(seed), seed, loop_closing=loop_closing, deterministic=True)
    if result.error is not None:
        sys.exit(f"the run failed: {result.error}")
    return result


def laid_onto_start(estimate: Trajectory, truth: Trajectory, *, with_scale: bool) -> Array:
    """Positions (n, 3) [m], moved so that the first pose is the true one.

    With a single camera the first tenth of the path gives the scale.
    """
    true = truth.T_wc[np.searchsorted(truth.timestamps, estimate.timestamps - 1e-6)]
    n = max(3, len(estimate) // 10)
    scale = 1.0
    if with_scale:
        scale = align(estimate.positions[:n], true[:n, :3, 3], with_scale=True).scale
    R = true[0, :3, :3] @ estimate.T_wc[0, :3, :3].T
    t = true[0, :3, 3] - scale * R @ estimate.positions[0]
    return Similarity(scale, R, t).apply(estimate.positions)


def draw_paths(axes: Axes, truth: Array, estimate: Array, ends: Array) -> None:
    """Both paths from above, and the line between the two views of one place."""
    axes.plot(truth[:, 0], truth[:, 2], color=TRUTH, linewidth=3, label="ground truth")
    axes.plot(estimate[:, 0], estimate[:, 2], color=ESTIMATE, linewidth=1.2, label="estimate")
    axes.plot(
        *(ends[:, 0], ends[:, 2], "o-"),
        color=LOOP,
        linewidth=1.5,
        markersize=4,
        label="the two keyframes of the loop",
    )
    axes.set_aspect("equal")
    axes.grid(color="#eeeeee", linewidth=0.8)
    axes.set_axisbelow(True)


def add_zoom(axes: Axes, truth: Array, estimate: Array, ends: Array, reach: float) -> None:
    """Draw the surroundings of the loop, larger, into the empty middle of the lap."""
    inset = axes.inset_axes((0.3, 0.3, 0.4, 0.4))
    draw_paths(inset, truth, estimate, ends)
    centre = ends.mean(axis=0)
    inset.set_xlim(centre[0] - reach, centre[0] + reach)
    inset.set_ylim(centre[2] - reach, centre[2] + reach)
    inset.tick_params(labelsize=6)
    axes.indicate_inset_zoom(inset, edgecolor="black")


def draw(case: Case, seed: int, path: Path) -> None:
    """Run twice and draw."""
    single = case.sensor is Sensor.MONOCULAR
    before = run(case, seed, loop_closing=False)
    after = run(case, seed, loop_closing=True)
    if not after.loops:
        sys.exit(f"{case}, seed {seed}: no loop was closed")
    loop = after.loops[0]
    sequence = case.sequence(seed)
    truth = sequence.ground_truth()
    panels = []
    for result in (before, after):
        estimate = result.tracked_trajectory()
        positions = laid_onto_start(estimate, truth, with_scale=single)
        times = (loop.matched_timestamp, loop.current_timestamp)
        ends = positions[[int(np.argmin(np.abs(estimate.timestamps - t))) for t in times]]
        error = lap_error(estimate, truth, sequence.lap_length, with_scale=single)
        panels.append((positions, ends, error))
    reach = 1.5 * max(float(np.ptp(ends[:, [0, 2]], axis=0).max()) for _, ends, _ in panels)
    figure = Figure(figsize=(10, 5.6), dpi=110, layout="constrained")
    FigureCanvasAgg(figure)
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    titles = ("without loop closing", "with loop closing")
    for axes, (positions, ends, error), title in zip(both, panels, titles, strict=True):
        draw_paths(axes, truth.positions, positions, ends)
        add_zoom(axes, truth.positions, positions, ends, reach)
        axes.set_title(
            f"{title}: {error.translation_m:.2f} m off after {error.path_m:.0f} m", fontsize=10
        )
        axes.set_xlabel("x (right) [m]")
    both[0].set_ylabel("z (forward) [m]")
    handles, labels = both[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    """Command line."""
    cases = [case for case in CASES if case.n_revisits]
    parser = new_parser(__doc__)
    names = sorted({case.name for case in cases})
    parser.add_argument("--case", choices=names, default="corridor", help="[corridor]")
    parser.add_argument("--sensor", choices=SENSORS, default="rgbd", help="[rgbd]")
    add_counts(parser, seed=(1, "of the case"))
    output = CHECKOUT / "docs" / "images" / "loop_closing.png"
    parser.add_argument("--output", type=Path, default=output, help="[the picture of the README]")
    arguments = parser.parse_args()
    chosen = [c for c in cases if (c.name, str(c.sensor)) == (arguments.case, arguments.sensor)]
    if not chosen:
        parser.error(f"there is no case {arguments.case} {arguments.sensor}")
    draw(chosen[0], arguments.seed, arguments.output)


if __name__ == "__main__":
    main()
