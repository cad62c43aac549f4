# SPDX-License-Identifier: BSD-3-Clause
"""Check of the accelerometer against the path of the camera."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.inertial.check import streams
from orbslam2py.inertial.check.gravity import GravityFit, fit_gravity
from orbslam2py.inertial.check.rates import axes_text
from orbslam2py.inertial.check.report import ImuReport
from orbslam2py.settings import ImuSettings
from orbslam2py.trajectory import Trajectory

#: Relative error of gravity that may be one of the path.
_SMALL_SCALE = 0.1
#: Share by which the usual reading of the accelerometer then differs from gravity, too.
_UNUSUAL = 0.03
#: Difference of an accelerometer's misfits [m] that may be one of the path.
_SMALL_MISFIT = 5e-3


def longest_piece(paths: Sequence[Trajectory]) -> Trajectory:
    """The longest piece of a path without a gap."""
    best: Trajectory | None = None
    for path in paths:
        good = np.flatnonzero(~path.lost)
        cuts = np.flatnonzero((np.diff(good) > 1) | (np.diff(path.timestamps[good]) > 0.3)) + 1
        for piece in np.split(good, cuts):
            if best is None or len(piece) > len(best):
                best = Trajectory(path.timestamps[piece], path.T_wc[piece])
    assert best is not None
    return best


def check_gravity(
    report: ImuReport,
    t: FloatArray,
    accel: FloatArray,
    path: Trajectory,
    T_ci: FloatArray,
    offset: float,
    settings: ImuSettings | None,
) -> None:
    """Compare the accelerometer with a path, and report notes and faults.

    Parameters
    ----------
    report
        Receives the findings.
    t, accel
        Samples: seconds (n,), and readings in m/s^2 (n, 3).
    path
        Of the camera, without gaps.
    T_ci
        From the IMU to the camera (4, 4), by the gyro.
    offset
        Seconds to add to the clock of the path for that of the IMU.
    settings
        Assumed settings of the IMU.
    """
    if any(fault.kind == "dead" and "accelerometer" in fault.text for fault in report.faults):
        return
    fit = fit_gravity(t, accel, path, T_ci, offset)
    if fit is None:
        report.open_questions.append("the path is too short to compare the accelerometer with it")
        return
    if settings is not None and T_ci is not settings.T_ci:
        # The gyro asks for another rotation than the settings; whose side does gravity take?
        other = fit_gravity(t, accel, path, settings.T_ci, offset)
        if other is not None and other.misfit < 0.5 * fit.misfit:
            report.notes.append("the accelerometer fits the settings: only the gyro differs")
            fit = other
    report.gravity = fit
    if fit.is_negated:
        report.blame(
            "sign",
            "the accelerometer has the wrong sign: at rest it must point up, as a force does; "
            "multiply its columns by -1",
        )
        return
    if _axes_differ(fit):
        report.blame(
            "axes",
            "the axes of the accelerometer are exchanged or have wrong signs: it fits with "
            f"{axes_text(fit.best_axes)}; correct these columns of the samples",
        )
        return
    report.notes.append(
        f"gravity along the path: {fit.magnitude:.2f} m/s^2, {fit.misfit * 1e3:.0f} mm left over; "
        f"one unit of the path is {fit.scale:.3f} m (+/- {fit.scale_deviation:.3f})"
    )
    certain = fit.misfit < 0.05
    off = fit.magnitude / streams.GRAVITY - 1
    if not certain or abs(off) < _SMALL_SCALE:
        return
    usually = streams.usual_length(t, accel) / streams.GRAVITY - 1
    if usually * np.sign(off) > _UNUSUAL:
        report.blame(
            "scale",
            f"gravity comes out as {fit.magnitude:.2f} m/s^2; correct the scale or the bias of the "
            "accelerometer",
        )
        return
    report.open_questions.append(
        f"gravity along the path comes out as {fit.magnitude:.2f} m/s^2, but the accelerometer "
        "usually reads 9.8: the path may be wrong, as where most of the scene moves"
    )


def _axes_differ(fit: GravityFit) -> bool:
    return (
        not np.array_equal(fit.best_axes, np.eye(3))
        and fit.misfit > 2 * fit.best_misfit
        and fit.misfit - fit.best_misfit > _SMALL_MISFIT
    )
