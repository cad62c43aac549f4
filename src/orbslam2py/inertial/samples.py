# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU: their array, and their faults."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import shown
from orbslam2py._arrays import EqualByValue, FloatArray
from orbslam2py.errors import DatasetError

_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class ImuSamples(EqualByValue):
    """Readings of a gyro and an accelerometer, in the frame of the IMU.

    Attributes
    ----------
    source
        Where they are from, for messages.
    data
        Rows ``[t, gx, gy, gz, ax, ay, az]``, float64 (n, 7), read-only: seconds, growing; angular
        rate [rad/s]; specific force [m/s^2], which points up at rest.
    doubts
        Changes made to them, one sentence each; these were logged as warnings.
    """

    source: str
    data: FloatArray
    doubts: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.data)

    @property
    def timestamps(self) -> FloatArray:
        """Time of every sample in seconds, float64 (n,)."""
        return self.data[:, 0]

    @property
    def gyro(self) -> FloatArray:
        """Angular rate in rad/s, float64 (n, 3)."""
        return self.data[:, 1:4]

    @property
    def accel(self) -> FloatArray:
        """Specific force in m/s^2, float64 (n, 3)."""
        return self.data[:, 4:]

    @property
    def rate(self) -> float:
        """Samples per second by the usual step."""
        return float(1.0 / np.median(np.diff(self.timestamps)))

    def between(self, begin: float, end: float) -> FloatArray:
        """Return the rows of an interval [s], with one sample beyond each end if there is one."""
        first = max(0, int(np.searchsorted(self.timestamps, begin, side="right")) - 1)
        last = int(np.searchsorted(self.timestamps, end, side="left")) + 1
        return self.data[first:last]

    def since(self, before: float | None, until: float) -> FloatArray:
        """Return the rows that come with an image.

        Given image after image, these are all samples, each once.

        Parameters
        ----------
        before
            Time of the image before on the clock of the IMU [s]; None for the first image.
        until
            Time of the image on the clock of the IMU [s].

        Returns
        -------
        array (n, 7)
            The samples after those of the image before, up to the first one that is not before the
            image. For the first image: from the last one that is not after the image.
        """
        first, last = (
            int(np.searchsorted(self.timestamps, at, side="left")) + 1
            for at in (until if before is None else before, until)
        )
        if before is None:
            first = max(0, int(np.searchsorted(self.timestamps, until, side="right")) - 1)
        return self.data[first:last]


def imu_rows(samples: object) -> FloatArray:
    """Take samples of an IMU as a caller gives them.

    Parameters
    ----------
    samples
        `ImuSamples`, or rows ``[t, gx, gy, gz, ax, ay, az]`` (n, 7); one row may be (7,).

    Raises
    ------
    DatasetError
        If they have another shape or hold no numbers.
    """
    if isinstance(samples, ImuSamples):
        return samples.data
    try:
        rows = np.asarray(samples, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.zeros(())
    if rows.ndim == 1 and len(rows) in (0, 7):
        rows = rows.reshape(-1, 7)
    if rows.ndim != 2 or rows.shape[1] != 7:
        given = f"an array of shape {np.shape(rows)}" if np.ndim(rows) else shown(samples)
        raise DatasetError(
            f"the samples of the IMU are {given}; give float64 (n, 7) with the columns time [s], "
            "gyro x, y, z [rad/s], accelerometer x, y, z [m/s^2]"
        )
    return rows


@dataclass(frozen=True)
class Cleaned:
    """Rows of samples in order of time, and how many were left out or moved.

    Attributes
    ----------
    rows
        Finite, with growing times, float64 (n, 7).
    n_not_finite, n_unsorted, n_repeated
        Samples left out because a number is not finite, earlier than their predecessor, and left
        out because another one has the same time.
    """

    rows: FloatArray
    n_not_finite: int
    n_unsorted: int
    n_repeated: int


def clean_rows(data: FloatArray) -> Cleaned:
    """Sort rows of samples (n, 7) by time and leave out those that cannot be used."""
    finite = np.isfinite(data).all(axis=1)
    rows = data[finite]
    backwards = int((np.diff(rows[:, 0]) < 0).sum())
    if backwards:
        rows = rows[np.argsort(rows[:, 0], kind="stable")]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = np.diff(rows[:, 0]) > 0
    return Cleaned(
        np.ascontiguousarray(rows[new]), int((~finite).sum()), backwards, int((~new).sum())
    )


def make_samples(source: str, data: FloatArray) -> ImuSamples:
    """Sort samples, leave out those that are not finite or repeated, and log their number.

    Parameters
    ----------
    source
        Where they are from, for messages.
    data
        Rows as `ImuSamples` has them, float64 (n, 7), in any order.

    Raises
    ------
    DatasetError
        If fewer than two samples are left.
    """
    doubts: list[str] = []

    def say(count: int, text: str) -> None:
        if count:
            doubts.append(f"{source}: {count} of {len(data)} samples {text}")

    cleaned = clean_rows(data)
    rows = cleaned.rows
    say(cleaned.n_not_finite, "of the IMU are not finite and were left out")
    say(cleaned.n_unsorted, "of the IMU come before their predecessor in time; they were sorted")
    say(cleaned.n_repeated, "of the IMU repeat the time of another; the first of each was kept")
    if len(rows) < 2:
        raise DatasetError(
            f"{source} holds {len(rows)} usable samples of the IMU; give a file with its samples, "
            "or take it away"
        )
    for doubt in doubts:
        _log.warning("%s", doubt)
    rows.setflags(write=False)
    return ImuSamples(source, rows, tuple(doubts))


def joined_streams(source: str, gyro: FloatArray, accel: FloatArray) -> ImuSamples:
    """Put two streams together: the accelerometer is interpolated at the times of the gyro.

    Parameters
    ----------
    source
        Where they are from, for messages.
    gyro, accel
        Rows of time [s] and reading, float64 (n, 4). Samples of the gyro that no two of the
        accelerometer enclose are left out.

    Raises
    ------
    DatasetError
        If the streams have no time in common.
    """
    streams = []
    for name, stream in (("gyro", gyro), ("accelerometer", accel)):
        padded = np.zeros((len(stream), 7))
        padded[:, :4] = stream
        streams.append(make_samples(f"{source} ({name})", padded).data[:, :4])
    (t, g), (t_a, a) = ((rows[:, 0], rows[:, 1:]) for rows in streams)
    inside = (t >= t_a[0]) & (t <= t_a[-1])
    if inside.sum() < 2:
        raise DatasetError(
            f"{source}: gyro ({t[0]:.3f} s to {t[-1]:.3f} s) and accelerometer ({t_a[0]:.3f} s to "
            f"{t_a[-1]:.3f} s) have no time in common; give streams of one recording"
        )
    at = np.column_stack([np.interp(t[inside], t_a, a[:, k]) for k in range(3)])
    return make_samples(source, np.column_stack([t[inside], g[inside], at]))
