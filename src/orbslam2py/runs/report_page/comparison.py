# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of several runs: one frame for their trajectories, one table for their figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import DatasetError
from orbslam2py.evaluation import fit_by_time
from orbslam2py.runs.report_page.explained import FIGURES, Figure
from orbslam2py.runs.report_page.run_folder import RunFolder
from orbslam2py.runs.report_page.story import Story

#: Groups of figures that are compared.
GROUPS = ("Accuracy", "Tracking", "Map", "Speed")
#: Figures that describe the compared runs, not their results.
_LEFT_OUT = frozenset(["frames", "seen_frames", "lost_at_end", "matched_of_poses"])


@dataclass(frozen=True)
class Row:
    """A figure of all runs."""

    figure: Figure
    values: list[str]
    best: list[bool]
    """Which runs have the best value; none if all are equal, or the figure has no best value."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Runs, in the order in which they were named."""

    stories: list[Story]
    names: list[str]
    """Names of the runs, all different."""
    paths: list[FloatArray | None]
    """Positions (n, 3) of each run in the frame and unit of the first; None if unknown."""
    warnings: list[str]

    @classmethod
    def of(cls, runs: Sequence[RunFolder]) -> Comparison:
        """Compare runs.

        Raises
        ------
        DatasetError
            If there are fewer than two.
        """
        if len(runs) < 2:
            raise DatasetError(
                "one run cannot be compared; name another, or make the page of this one with "
                "orbslam2py report"
            )
        stories = [Story.of(run) for run in runs]
        warnings = []
        sequences = list(dict.fromkeys(run.name for run in runs))
        if len(sequences) > 1:
            warnings.append(
                f"The runs are of different sequences ({', '.join(sequences)}): their figures are "
                "not those of the same task."
            )
        if len({run.report.get("frames") for run in runs}) > 1 and len(sequences) == 1:
            warnings.append("The runs are of different parts of the sequence.")
        if len({run.report.get("sensor") for run in runs}) > 1:
            warnings.append("The runs are of different sensors.")
        paths = [_in_frame_of(runs[0], run) for run in runs]
        names = _names(runs)
        apart = [name for name, path in zip(names, paths, strict=True) if path is None]
        if apart:
            warnings.append(
                f"Not drawn with the paths, because they have no poses at the times of {names[0]}: "
                f"{', '.join(apart)}."
            )
        return cls(stories, names, paths, warnings)

    @property
    def runs(self) -> list[RunFolder]:
        """The runs."""
        return [story.run for story in self.stories]

    def rows(self) -> dict[str, list[Row]]:
        """Return all figures that at least one run has, group by group."""
        return {
            group: [
                self._row(figure)
                for figure in FIGURES[group]
                if figure.key not in _LEFT_OUT
                and any(run.report.get(figure.key) is not None for run in self.runs)
            ]
            for group in GROUPS
        }

    def _row(self, figure: Figure) -> Row:
        found = [run.report.get(figure.key) for run in self.runs]
        # A run that tracked nothing is best at nothing: it was never lost either.
        numbers = np.array(
            [
                value if isinstance(value, (int, float)) and run.report.get("tracked") else np.nan
                for value, run in zip(found, self.runs, strict=True)
            ],
            np.float64,
        )
        best = np.zeros(len(found), bool)
        known = numbers[np.isfinite(numbers)]
        if figure.best and len(known) > 1 and known.min() < known.max():
            best = numbers == (known.max() if figure.best > 0 else known.min())
        return Row(figure, [figure.value(run.report) for run in self.runs], best.tolist())


def _names(runs: Sequence[RunFolder]) -> list[str]:
    """Return names of the folders, with enough of their paths to be different."""
    parts = [run.folder.resolve().parts for run in runs]
    for n in range(1, max(len(part) for part in parts) + 1):
        names = ["/".join(part[-n:]) for part in parts]
        if len(set(names)) == len(names):
            return names
    return [f"{number}: {'/'.join(part[-1:])}" for number, part in enumerate(parts, 1)]


def _in_frame_of(first: RunFolder, run: RunFolder) -> FloatArray | None:
    """Align the trajectory of a run with that of the first, by the poses at equal times."""
    positions = first.metres * first.path.positions
    if run is first:
        return positions if len(positions) else None
    # By the truth, if both have one: then the picture shows the errors that are plotted.
    own, other = (run.truth, first.truth) if run.truth and first.truth else (run.path, first.path)
    if run.name != first.name:
        return None
    fit = fit_by_time(
        own.timestamps,
        run.metres * own.positions,
        other.timestamps,
        first.metres * other.positions,
        # Where both are in metres, a difference in scale is an error to be seen.
        with_scale=run.unit != "m" or first.unit != "m",
    )
    return None if fit is None else fit.similarity.apply(run.metres * run.path.positions)
