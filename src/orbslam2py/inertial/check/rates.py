# SPDX-License-Identifier: BSD-3-Clause
"""The gyro beside the rotation rate of the camera: rotation, scale, bias and time offset."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.trajectory import Trajectory

#: Seconds between two poses, beyond which they give no rate.
_LONGEST_STEP = 0.3
#: Steps of the coarse and of the fine search for the time offset [s]; the best is refined.
_COARSE, _STEP = 1e-2, 2e-3
#: Standard deviations from the expected time offset, from which on another one must fit clearly
#: better: by this share of the variance, and by this sum of squares in units of the variance.
_DEVIATIONS, _GAIN, _CERTAIN = 4.0, 0.3, 30.0


@dataclass(frozen=True)
class CameraRates:
    """Mean rotation rate of the camera between neighbouring poses.

    Attributes
    ----------
    begin, end
        Seconds on the clock of the camera, (n,).
    rates
        In the frame of the camera [rad/s], (n, 3).
    overlap
        Number of intervals that share each moment.
    """

    begin: FloatArray
    end: FloatArray
    rates: FloatArray
    overlap: float = 1.0

    def __len__(self) -> int:
        return len(self.begin)


def camera_rates(paths: Iterable[Trajectory], span: float = 0.0) -> CameraRates:
    """Rotation rates of paths; each is in its own world frame.

    Parameters
    ----------
    paths
        Poses of the camera.
    span
        Least length of an interval [s], within poses that follow each other.
    """
    rows: list[FloatArray] = []
    lengths: list[int] = []
    for path in paths:
        t, T, good = path.timestamps, path.T_wc, ~path.lost
        # Pieces without a gap; in each, the first pose that is far enough ends the interval.
        apart = ~(good[:-1] & good[1:]) | (np.diff(t) > _LONGEST_STEP) | (np.diff(t) <= 0)
        piece = np.concatenate([[0], np.cumsum(apart)])
        ends = np.searchsorted(t, t + span - 1e-6, side="left") if span else np.arange(len(t)) + 1
        for i, j in enumerate(ends.tolist()):
            if i < j < len(t) and piece[i] == piece[j]:
                step = t[j] - t[i]
                turn = cv2.Rodrigues(T[i, :3, :3].T @ T[j, :3, :3])[0].ravel()
                rows.append(np.array([t[i], t[j], *(turn / step)]))
                lengths.append(j - i)
    table = np.array(rows).reshape(-1, 5)
    overlap = float(np.mean(lengths)) if lengths else 1.0
    return CameraRates(table[:, 0], table[:, 1], table[:, 2:], overlap)


class MeanGyro:
    """Mean readings of a gyro over intervals of time."""

    def __init__(self, t: FloatArray, gyro: FloatArray) -> None:
        self._t = t
        steps = 0.5 * np.diff(t)[:, None] * (gyro[1:] + gyro[:-1])
        self._integral = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])

    def over(self, begin: FloatArray, end: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Mean rates (n, 3) over intervals, and which of these lie inside the samples."""
        inside = (begin >= self._t[0]) & (end <= self._t[-1])
        first, last = (
            np.column_stack([np.interp(at, self._t, one) for one in self._integral.T])
            for at in (begin, end)
        )
        return (last - first) / (end - begin)[:, None], inside


@dataclass(frozen=True)
class RateFit:
    """How the rates of the camera follow from those of the gyro: `scale R (gyro - bias)`.

    Attributes
    ----------
    offset, offset_deviation
        Seconds to add to the clock of the camera for that of the IMU.
    M
        The orthogonal matrix (3, 3), also a reflection, that fits best.
    R
        The rotation (3, 3) that fits best.
    scale, scale_deviation
        Of the camera's rate to that of the gyro.
    explained
        Share of the camera's rotation that `M` explains, 0 to 1.
    bias
        Of the gyro, in its units, with `R`.
    deviation
        Of one component of a rate, about the fit with `M` [rad/s].
    R_deviation
        Largest standard deviation of `R` [rad] about any axis.
    camera_rms, gyro_rms
        Root mean square of the rates about their mean, in rad/s and in the units of the gyro.
    camera, gyro
        The rates that were compared, (n, 3).
    at
        Middle of each interval on the clock of the camera [s].
    overlap
        Number of intervals that share each moment.
    """

    offset: float
    offset_deviation: float
    M: FloatArray
    R: FloatArray
    scale: float
    scale_deviation: float
    explained: float
    bias: FloatArray
    deviation: float
    R_deviation: float
    camera_rms: float
    gyro_rms: float
    camera: FloatArray
    gyro: FloatArray
    at: FloatArray
    overlap: float = 1.0

    @property
    def n(self) -> float:
        """Number of independent components of rates that were compared."""
        return self.camera.size / self.overlap

    def misfit(self, M: FloatArray) -> float:
        """Mean square residual [(rad/s)^2] with another matrix (3, 3) and the best scale."""
        c, g = _centred(self.camera), _centred(self.gyro) @ M.T
        scale = max(0.0, float((c * g).sum() / max((g * g).sum(), 1e-12)))
        return float(((c - scale * g) ** 2).mean())


def fit_rates(
    camera: CameraRates, gyro: MeanGyro, around: float, reach: float, least: int
) -> RateFit | None:
    """Find rotation, scale, bias and time offset.

    Parameters
    ----------
    camera, gyro
        The compared rates.
    around, reach
        Middle and half width of the search for the time offset [s].
    least
        Number of intervals that must lie inside the samples.

    Returns
    -------
    RateFit or None
        None if too few intervals lie inside the samples.
    """
    kept = np.ones(len(camera), dtype=bool)

    def shares_at(offsets: FloatArray) -> FloatArray:
        return _shares(camera, gyro, offsets, kept, least)

    coarse = around + np.arange(-reach, reach + _COARSE / 2, _COARSE)
    shares = shares_at(coarse)
    if not np.isfinite(shares).any():
        return None
    best = float(coarse[np.nanargmax(shares)])
    for _ in range(2):  # with outliers of the camera, then without
        fine = best + np.arange(-_COARSE, _COARSE + _STEP / 2, _STEP)
        shares = shares_at(fine)
        if not np.isfinite(shares).any():
            return None
        best = _peak(fine, shares)
        means, inside = gyro.over(camera.begin + best, camera.end + best)
        use = kept & inside
        if use.sum() < least:
            return None
        c, g = _centred(camera.rates[use]), _centred(means[use])
        M, _, scale = _best(c, g)
        left = np.linalg.norm(c - scale * g @ M.T, axis=1)
        kept = kept.copy()
        kept[np.flatnonzero(use)[left > 5 * max(float(np.median(left)), 1e-6)]] = False
    found = _finished(camera, gyro, best, kept)
    if abs(best - around) < _DEVIATIONS * found.offset_deviation:
        return found
    # Slow motion fits nearly as well at another time: then the expected offset stands.
    _, inside = gyro.over(camera.begin + around, camera.end + around)
    if (kept & inside).sum() < least:
        return found
    expected = _finished(camera, gyro, around, kept)
    gain = expected.deviation**2 / max(found.deviation**2, 1e-12) - 1
    is_better = gain > _GAIN and gain * found.n > _CERTAIN
    return found if is_better else expected


def _finished(
    camera: CameraRates, gyro: MeanGyro, offset: float, kept: NDArray[np.bool_]
) -> RateFit:
    means, inside = gyro.over(camera.begin + offset, camera.end + offset)
    use = kept & inside
    w_c, w_g = camera.rates[use], means[use]
    c, g = _centred(w_c), _centred(w_g)
    M, R, scale = _best(c, g)
    left = c - scale * g @ M.T
    n = max(1, left.size - 8)
    deviation = float(np.sqrt((left**2).sum() / n))
    turning = scale * g
    information = (turning**2).sum() * np.eye(3) - turning.T @ turning
    weakest = max(float(np.linalg.eigvalsh(information)[0]), 1e-12)
    # Overlapping intervals are not independent.
    certain = deviation * float(np.sqrt(camera.overlap))
    step = 1e-3
    late = gyro.over(camera.begin + offset + step, camera.end + offset + step)[0][use]
    slope = scale * (late - w_g) / step
    return RateFit(
        offset=float(offset),
        offset_deviation=certain / float(np.sqrt(max((slope**2).sum(), 1e-12))),
        M=M,
        R=R,
        scale=scale,
        scale_deviation=certain / float(np.sqrt(max((g**2).sum(), 1e-12))),
        explained=max(0.0, 1.0 - float((left**2).sum() / max((c**2).sum(), 1e-12))),
        bias=w_g.mean(axis=0) - R.T @ w_c.mean(axis=0) / max(scale, 1e-9),
        deviation=deviation,
        R_deviation=certain / float(np.sqrt(weakest)),
        camera_rms=float(np.sqrt((c**2).sum() / len(c))),
        gyro_rms=float(np.sqrt((g**2).sum() / len(g))),
        camera=w_c,
        gyro=w_g,
        at=0.5 * (camera.begin + camera.end)[use],
        overlap=camera.overlap,
    )


def _shares(
    camera: CameraRates,
    gyro: MeanGyro,
    offsets: FloatArray,
    kept: NDArray[np.bool_],
    least: int,
) -> FloatArray:
    """Share of the camera's rotation that the best orthogonal matrix explains, by offset (m,)."""
    shape = (len(offsets), len(camera))
    begin, end = ((at[None] + offsets[:, None]).ravel() for at in (camera.begin, camera.end))
    means, inside = gyro.over(begin, end)
    use = (inside.reshape(shape) & kept).astype(float)[..., None]
    n = use.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        g = means.reshape(*shape, 3)
        g = (g - (g * use).sum(axis=1, keepdims=True) / n) * use
        c = (camera.rates - (camera.rates * use).sum(axis=1, keepdims=True) / n) * use
    enough = n[:, 0, 0] >= least
    g, c = g[enough], c[enough]
    shares = np.full(len(offsets), np.nan)
    trace = np.linalg.svd(c.transpose(0, 2, 1) @ g, compute_uv=False).sum(axis=1)
    sizes = (c**2).sum(axis=(1, 2)) * (g**2).sum(axis=(1, 2))
    shares[enough] = trace**2 / np.maximum(sizes, 1e-18)
    return shares


def _peak(offsets: FloatArray, shares: FloatArray) -> float:
    """The offset of the largest share, refined by a parabola."""
    k = int(np.nanargmax(shares))
    if 0 < k < len(shares) - 1 and np.isfinite(shares[k - 1 : k + 2]).all():
        a, b, c = shares[k - 1 : k + 2]
        bend = a - 2 * b + c
        if bend < 0:
            return float(offsets[k] + 0.5 * (a - c) / bend * _STEP)
    return float(offsets[k])


def _best(c: FloatArray, g: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The best orthogonal matrix, the best rotation, and the scale of the former (Umeyama 1991)."""
    U, S, Vt = np.linalg.svd(c.T @ g)
    M = U @ Vt
    R = U @ np.diag([1.0, 1.0, np.linalg.det(M)]) @ Vt
    return M, R, float(S.sum() / max((g**2).sum(), 1e-12))


def _centred(rates: FloatArray) -> FloatArray:
    return np.asarray(rates - rates.mean(axis=0))


def signed_permutations() -> list[FloatArray]:
    """All 48 exchanges of axes with their signs, (3, 3), the identity first."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            P = np.zeros((3, 3))
            P[range(3), order] = signs
            found.append(P)
    return found


def axes_text(P: FloatArray) -> str:
    """Describe an exchange of axes in words: ``x = -y, y = x, z = z``."""
    parts = []
    for name, row in zip("xyz", P, strict=True):
        k = int(np.abs(row).argmax())
        parts.append(f"{name} = {'-' if row[k] < 0 else ''}{'xyz'[k]}")
    return ", ".join(parts)
