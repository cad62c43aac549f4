# SPDX-License-Identifier: BSD-3-Clause
"""Camera trajectories: poses over time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of a camera over time.

    Attributes
    ----------
    timestamps
        Seconds, float64 (n,).
    T_wc
        Camera to world, float64 (n, 4, 4); translations in metres (one camera: arbitrary unit).
    lost
        Which poses only repeat an earlier one because tracking was lost, bool (n,).
    indices
        Frame that each pose belongs to, int64 (n,): its place, from 0, among the frames that were
        fed; 0, 1, ... if nothing else is said.
    """

    timestamps: FloatArray
    T_wc: FloatArray
    lost: NDArray[np.bool_] = None  # type: ignore[assignment]  # filled in below
    indices: IntArray = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        n = len(self.timestamps)
        fields: dict[str, NDArray[Any]] = {
            "timestamps": np.asarray(self.timestamps, dtype=np.float64),
            "T_wc": np.asarray(self.T_wc, dtype=np.float64).reshape(-1, 4, 4),
            "lost": np.zeros(n, bool) if self.lost is None else np.asarray(self.lost, bool),
            "indices": np.arange(n, dtype=np.int64)
            if self.indices is None
            else np.asarray(self.indices, np.int64),
        }
        for name, value in fields.items():
            if len(value) != n:
                raise ValueError(f"{n} timestamps, but {len(value)} {name}")
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.timestamps)

    @property
    def positions(self) -> FloatArray:
        """Camera centres in the world, float64 (n, 3), in the unit of `T_wc`."""
        return self.T_wc[:, :3, 3]

    def select(self, which: NDArray[Any]) -> Trajectory:
        """Return the poses chosen by a mask or by indices into the arrays."""
        return Trajectory(
            self.timestamps[which], self.T_wc[which], self.lost[which], self.indices[which]
        )

    def shifted(self, seconds: float) -> Trajectory:
        """Return the same poses at time stamps that are later by so many seconds."""
        return Trajectory(self.timestamps + seconds, self.T_wc, self.lost, self.indices)
