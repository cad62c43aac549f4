# SPDX-License-Identifier: BSD-3-Clause
"""Gaps of a run's trajectory, and its periods of tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.runs.result import FrameRow

#: A path has a gap where it has no pose for longer than this time [s] and number of frames.
_LONG_SECONDS, _LONG_FRAMES = 1.0, 5.0

#: A stretch of time: its beginning and its end [s].
Span = tuple[float, float]


def gaps_in_time(seconds: FloatArray) -> npt.NDArray[np.bool_]:
    """Find long pauses, at which a line is interrupted.

    Parameters
    ----------
    seconds
        Ascending, (n,).

    Returns
    -------
    array of bool, (n,)
        Whether there is a gap before each moment; never before the first.
    """
    gaps = np.zeros(len(seconds), bool)
    steps = np.diff(seconds)
    if len(steps):
        gaps[1:] = steps > max(_LONG_SECONDS, _LONG_FRAMES * float(np.median(steps)))
    return gaps


@dataclass(frozen=True)
class Timeline:
    """The results of the frames of a run, in seconds since the first of them."""

    seconds: FloatArray
    """(n,) of every frame."""
    n_failed: IntArray
    """(n,) number of frames up to each one that should have a pose but have none."""
    untracked: list[Span]
    """Periods without a pose."""
    in_others: dict[int, list[Span]]
    """Periods with poses in another map than the main one, by its number."""

    @property
    def duration(self) -> float:
        """Return seconds from the first frame to the last; 0 without any.

        Times of skipped frames may decrease.
        """
        return float(max(self.seconds, default=0.0))

    @classmethod
    def of(
        cls,
        rows: Sequence[FrameRow],
        main_map: int,
        merged_into: Mapping[int, int] | None = None,
    ) -> Timeline:
        """Make it from the rows of a run.

        Parameters
        ----------
        rows
            Of the run.
        main_map
            Number of its main map.
        merged_into
            Merged maps and the maps that contain them, by their numbers.
        """
        seconds = np.array([float(row.timestamp) for row in rows])
        seconds = seconds - seconds[:1].sum()
        # Frames without a check do not count as failures: tracking went on across it.
        failed = np.array([row.state not in ("OK", "DROPPED") for row in rows], bool)
        parts = merged_into or {}
        maps = np.array([_map_of(row, parts) for row in rows], np.int64)
        others = set(maps.tolist()) - {-1, main_map}
        return cls(
            seconds,
            np.cumsum(failed),
            _spans(seconds, failed),
            {number: _spans(seconds, maps == number) for number in sorted(others)},
        )

    def gaps_before(self, positions: IntArray) -> npt.NDArray[np.bool_]:
        """Find gaps between poses.

        Parameters
        ----------
        positions
            Positions of the frames with a pose among those of the run, ascending, (k,).

        Returns
        -------
        array of bool, (k,)
            Return whether there is a loss or a long pause between each frame and the one before.
        """
        gaps = gaps_in_time(self.seconds[positions])
        gaps[1:] |= np.diff(self.n_failed[positions]) > 0
        return gaps


def _map_of(row: FrameRow, merged_into: Mapping[int, int]) -> int:
    """Return the final map of a frame's pose; -1 without a pose."""
    number = row.record.map_index if row.record is not None and row.state == "OK" else -1
    while number in merged_into:
        number = merged_into[number]
    return number


def _spans(seconds: FloatArray, chosen: npt.NDArray[np.bool_]) -> list[Span]:
    """Return the periods of selected frames, each up to the next frame that is not selected."""
    if not chosen.any():
        return []
    step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    padded = np.concatenate([[False], chosen, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
    after = np.append(seconds, seconds[-1] + step)
    return [(float(seconds[b]), float(after[e])) for b, e in zip(begins, ends, strict=True)]
