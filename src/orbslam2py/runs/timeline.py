# SPDX-License-Identifier: BSD-3-Clause
"""Where a run's path has gaps, and what was tracked when."""

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
    """Find the places where too much time passes for a line to be drawn.

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
    """What became of the frames of a run, in seconds since the first of them."""

    seconds: FloatArray
    """(n,) of every frame."""
    n_failed: IntArray
    """(n,) how many frames up to each, itself included, should have a pose and have none."""
    untracked: list[Span]
    """When there was no pose."""
    in_others: dict[int, list[Span]]
    """When there were poses in another map than the main one, by its number."""

    @property
    def duration(self) -> float:
        """Seconds from the first frame to the last; 0 without any.

        Frames that were skipped may go backwards.
        """
        return float(max(self.seconds, default=0.0))

    @classmethod
    def of(
        cls,
        rows: Sequence[FrameRow],
        main_map: int,
        merged_into: Mapping[int, int] | None = None,
    ) -> Timeline:
        """Take it from the rows of a run.

        Parameters
        ----------
        rows
            Of the run.
        main_map
            Number of its main map.
        merged_into
            Maps that have become part of others, by their numbers: poses in them are poses there.
        """
        seconds = np.array([float(row.timestamp) for row in rows])
        seconds = seconds - seconds[:1].sum()
        # What nobody looked at is no failure: tracking went on across it.
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
            Of the frames with a pose among those of the run, ascending, (k,).

        Returns
        -------
        array of bool, (k,)
            Whether tracking failed, or nothing was seen for long, between each and the one before.
        """
        gaps = gaps_in_time(self.seconds[positions])
        gaps[1:] |= np.diff(self.n_failed[positions]) > 0
        return gaps


def _map_of(row: FrameRow, merged_into: Mapping[int, int]) -> int:
    """The map that a frame has a pose in at the end; -1 without one."""
    number = row.record.map_index if row.record is not None and row.state == "OK" else -1
    while number in merged_into:
        number = merged_into[number]
    return number


def _spans(seconds: FloatArray, chosen: npt.NDArray[np.bool_]) -> list[Span]:
    """Stretches of chosen frames, each up to the next frame that is not."""
    if not chosen.any():
        return []
    step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0
    padded = np.concatenate([[False], chosen, [False]]).astype(np.int8)
    begins, ends = np.flatnonzero(np.diff(padded) == 1), np.flatnonzero(np.diff(padded) == -1)
    after = np.append(seconds, seconds[-1] + step)
    return [(float(seconds[b]), float(after[e])) for b, e in zip(begins, ends, strict=True)]
