# SPDX-License-Identifier: BSD-3-Clause
"""Camera trajectories: poses over time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import array_of, finite_number, shown
from orbslam2py._arrays import EqualByValue, FloatArray, IntArray, MadeAgainByCopies
from orbslam2py.errors import DatasetError
from orbslam2py.trajectory.rotations import inverse_poses, quaternions_from_rotations
from orbslam2py.trajectory.writers import TrajectoryFormat, write_kitti, write_tum

#: From here on, floats are no int64 any more.
_LARGEST_INDEX = 2.0**63


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(EqualByValue, MadeAgainByCopies):
    """Poses of a camera over time; two are equal if all their arrays are equal.

    The arrays are read-only copies; ``trajectory.T_wc.copy()`` may be changed.

    Attributes
    ----------
    timestamps
        Seconds, float64 (n,).
    T_wc
        Camera to world, float64 (n, 4, 4); translations in metres (one camera: arbitrary unit).
    lost
        Which poses only repeat an earlier one because tracking was lost, bool (n,).
    indices
        Number of each pose's frame, int64 (n,): its position, from 0, among the input frames; by
        default 0, 1, ...

    Raises
    ------
    DatasetError
        If an argument is no array of numbers, a time stamp is not finite, indices are no whole
        numbers, or lengths differ.
    """

    timestamps: FloatArray
    T_wc: FloatArray
    lost: NDArray[np.bool_] = None  # type: ignore[assignment]  # filled in below
    indices: IntArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        timestamps = array_of(self.timestamps, "timestamps", (-1,))
        n = len(timestamps)
        fields: dict[str, NDArray[Any]] = {
            "timestamps": timestamps,
            "T_wc": array_of(self.T_wc, "T_wc", (-1, 4, 4), finite=False),
            "lost": _mask(self.lost, n),
            "indices": _indices(self.indices, n),
        }
        for name, value in fields.items():
            if len(value) != n:
                raise DatasetError(f"{n} timestamps, but {len(value)} {name}; give one per pose")
            value.setflags(write=False)
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.timestamps)

    def __repr__(self) -> str:
        if not len(self):
            return "<Trajectory: no poses>"
        n_lost = int(self.lost.sum())
        lost = f" ({n_lost} lost)" if n_lost else ""
        length = lengths_along(self.positions[~self.lost])[-1:].sum()
        return (
            f"<Trajectory: {len(self)} poses{lost}, {self.timestamps[0]:.3f} s to "
            f"{self.timestamps[-1]:.3f} s, path length {length:.3f}>"
        )

    @property
    def positions(self) -> FloatArray:
        """Camera centres in the world, float64 (n, 3), in the unit of `T_wc`; read-only."""
        return self.T_wc[:, :3, 3]

    @property
    def T_cw(self) -> FloatArray:
        """World to camera, the inverse of `T_wc`, float64 (n, 4, 4)."""
        return inverse_poses(self.T_wc)

    @property
    def quaternions(self) -> FloatArray:
        """Rotations of `T_wc` as unit quaternions in the order x, y, z, w, float64 (n, 4)."""
        return quaternions_from_rotations(self.T_wc[:, :3, :3])

    def select(self, which: NDArray[Any] | slice) -> Trajectory:
        """Return the poses chosen by a mask, by indices into the arrays, or by a slice.

        Raises
        ------
        DatasetError
            If it is none of these, or has another length.
        """
        if not isinstance(which, slice):
            which = _selection(which, len(self))
        return Trajectory(
            self.timestamps[which], self.T_wc[which], self.lost[which], self.indices[which]
        )

    def shifted(self, seconds: float) -> Trajectory:
        """Return the same poses at time stamps that are later by `seconds`."""
        seconds = finite_number(seconds, "the shift", "a number of seconds", DatasetError)
        return Trajectory(self.timestamps + seconds, self.T_wc, self.lost, self.indices)

    def save(self, path: str | Path, format: TrajectoryFormat | str = TrajectoryFormat.TUM) -> None:  # noqa: A002
        """Write the poses to a file.

        Parameters
        ----------
        path
            The file; replaced only after everything is written.
        format
            ``"tum"``: time, position and quaternion of every pose that is not lost. ``"kitti"``:
            the upper three rows of ``T_wc``, one line per frame; the identity before the first
            pose, and the previous pose for frames without one.

        Raises
        ------
        OSError
            If the file cannot be written; an existing file is kept then.
        DatasetError
            For another format, frame numbers that do not increase (``"kitti"``), or invalid poses:
            not finite, or without a rotation.
        """
        chosen = TrajectoryFormat.of(format)
        if chosen is TrajectoryFormat.TUM:
            write_tum(path, self)
        elif chosen is TrajectoryFormat.KITTI:
            write_kitti(path, self)
        else:
            raise DatasetError(f"trajectories are not saved as '{chosen}'; give tum or kitti")


def lengths_along(positions: FloatArray) -> FloatArray:
    """Measure a path: return the distance along it from its start to each position.

    Parameters
    ----------
    positions
        In the order of the path, float64 (n, 3).

    Returns
    -------
    FloatArray
        (n,), 0 for the first, in the unit of the positions.
    """
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])[: len(positions)]


def _mask(lost: Any, n: int) -> NDArray[np.bool_]:
    if lost is None:
        return np.zeros(n, bool)
    mask = np.asarray(lost)
    if mask.ndim != 1 or (mask.dtype != np.bool_ and mask.size):
        raise DatasetError(f"lost is {shown(lost)}; give True or False per pose, or None")
    return mask.astype(bool)


def _indices(indices: Any, n: int) -> IntArray:
    if indices is None:
        return np.arange(n, dtype=np.int64)
    given = np.asarray(indices)
    if given.dtype.kind == "i" and given.ndim == 1:  # not through floats, which round large ones
        return given.astype(np.int64)
    numbers = array_of(indices, "indices", (-1,))
    if (numbers != np.rint(numbers)).any() or (np.abs(numbers) >= _LARGEST_INDEX).any():
        raise DatasetError(
            "indices are no whole numbers; give the place of each pose's frame, from 0"
        )
    return numbers.astype(np.int64)


def _selection(which: Any, n: int) -> NDArray[Any]:
    chosen = np.asarray(which)
    if chosen.size == 0 and chosen.ndim == 1 and chosen.dtype != np.bool_:
        return np.zeros(0, np.int64)
    is_mask = chosen.dtype == np.bool_ and chosen.shape == (n,)
    is_list = chosen.dtype.kind in "iu" and chosen.ndim == 1
    if not is_mask and not (is_list and chosen.min() >= -n and chosen.max() < n):
        raise DatasetError(
            f"poses are chosen by {shown(which)}; give a mask of bool ({n},), indices from 0 to "
            f"{n - 1}, or a slice"
        )
    return chosen
