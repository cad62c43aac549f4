# SPDX-License-Identifier: BSD-3-Clause
"""The verdict on an IMU: what is wrong, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.inertial.check import streams
from orbslam2py.inertial.check.accelerometer import check_gravity, longest_piece
from orbslam2py.inertial.check.rates import (
    CameraRates,
    MeanGyro,
    RateFit,
    axes_text,
    camera_rates,
    fit_rates,
    signed_permutations,
)
from orbslam2py.inertial.check.report import ImuReport
from orbslam2py.inertial.samples import ImuSamples
from orbslam2py.settings import ImuSettings
from orbslam2py.trajectory import Trajectory
from orbslam2py.trajectory.rotations import inverse_poses, rotation_angles

_DEGREE = float(np.pi / 180)
#: Least number of steps of the camera that are compared.
_STEPS = 15
#: Rotation of the camera about its mean [rad/s], root mean square, that is enough to compare.
_TURNING = 0.08
#: Share of the camera's rotation that a gyro that belongs to it explains.
_EXPLAINED = 0.8
#: Time offset [s] and angle [rad] that do no harm.
_SMALL_OFFSET, _SMALL_ANGLE = 5e-3, 3 * _DEGREE
#: Standard deviation of the time offset [s], from which on longer intervals [s] are compared, too.
_SLOW, _LONG = 1.5e-3, 0.2
#: Relative error of a scale, or of gravity, that may be one of the path.
_SMALL_SCALE = 0.1
#: Usual length of the specific force [m/s^2], beyond which its unit is wrong.
_ODD_FORCE = (4.0, 30.0)
#: Norm of the difference of two rotations that are 16 degrees apart.
_SAME_AXES = 0.4
#: Share of the samples at the end of the range, above which an axis is not compared.
_CLIPPED = 0.01
_READINGS = ("gyro", "accelerometer")


def check_imu(
    samples: ImuSamples,
    paths: Sequence[Trajectory],
    settings: ImuSettings | None = None,
    *,
    reach: float = 0.5,
) -> ImuReport:
    """Compare an IMU with the path of the camera.

    Parameters
    ----------
    samples
        Of the IMU.
    paths
        Of the camera, one per map; scales do not matter.
    settings
        Assumed settings of the IMU, for the camera of the paths; None if nothing is.
    reach
        Time offsets [s] that are tried, before and after that of the settings.
    """
    report = ImuReport()
    _describe(report, samples)
    gyro, accel = _checked_streams(report, samples)
    t = samples.timestamps
    believed = 0.0 if settings is None else settings.time_offset
    camera = camera_rates(paths)
    if not len(camera):
        report.open_questions.append(
            "the camera was not tracked, so axes and time offset could not be checked; record 10 s "
            "with turns about all axes and sideways motion"
        )
        return report
    if camera.end[-1] + believed < t[0] - reach or camera.begin[0] + believed > t[-1] + reach:
        report.blame(
            "time_offset",
            f"images ({camera.begin[0]:.3f} s to {camera.end[-1]:.3f} s) and samples ({t[0]:.3f} s "
            f"to {t[-1]:.3f} s) have no time in common: the clocks differ, or the files belong to "
            f"different recordings; if both began together, the time offset is "
            f"{t[0] - camera.begin[0]:.3f} s",
        )
        return report
    rates = _fitted(camera, paths, MeanGyro(t, gyro), believed, reach)
    if rates is None:
        report.open_questions.append(
            f"fewer than {_STEPS} steps of the camera lie inside the samples; record a longer piece"
        )
        return report
    report.rates = rates
    follows = _check_following(report, rates)
    offset = rates.offset if follows else believed
    T_ci = None if settings is None else settings.T_ci
    if follows:
        _check_clock(report, rates, believed)
        _check_scale(report, rates)
        T_ci = _check_axes(report, rates, settings)
    if T_ci is not None:
        check_gravity(report, t, accel, longest_piece(paths), T_ci, offset, settings)
    return report


def _fitted(
    camera: CameraRates,
    paths: Sequence[Trajectory],
    gyro: MeanGyro,
    believed: float,
    reach: float,
) -> RateFit | None:
    """Compare from pose to pose, or over longer intervals if slow motion makes these more exact."""
    rates = fit_rates(camera, gyro, believed, reach, _STEPS)
    if rates is None or rates.offset_deviation < _SLOW:
        return rates
    longer = fit_rates(camera_rates(paths, _LONG), gyro, believed, reach, _STEPS)
    if longer is None or longer.offset_deviation > rates.offset_deviation:
        return rates
    return longer


# ---- the samples alone ---------------------------------------------------------------------------


def _describe(report: ImuReport, samples: ImuSamples) -> None:
    steps = np.diff(samples.timestamps)
    text = f"{len(samples)} samples, {np.sum(steps):.1f} s, {samples.rate:.4g} Hz"
    gaps = steps[steps > max(5 * float(np.median(steps)), 0.03)]
    if len(gaps):
        text += f", {len(gaps)} gaps, the longest {gaps.max() * 1e3:.0f} ms"
    report.notes.append(text)


def _checked_streams(report: ImuReport, samples: ImuSamples) -> tuple[FloatArray, FloatArray]:
    """Check the readings alone; returns the gyro as it is, and the accelerometer in m/s^2."""
    gyro, accel = samples.gyro, samples.accel
    if streams.swapped(samples.timestamps, gyro, accel):
        report.blame(
            "swapped",
            "gyro and accelerometer are exchanged: the gyro's columns hold gravity; exchange the "
            "columns",
        )
        gyro, accel = accel, gyro
    for name, readings in zip(_READINGS, (gyro, accel), strict=True):
        dead = streams.dead_axes(readings)
        if dead:
            report.blame(
                "dead",
                f"axis {', '.join(dead)} of the {name} never changes: it is dead, or its column "
                "is not filled; check wiring, driver and columns",
            )
        for axis, values in zip("xyz", readings.T, strict=True):
            n = int(streams.saturated(values).sum())
            if n:
                top = float(np.abs(values).max())
                report.blame(
                    "saturated",
                    f"axis {axis} of the {name} is saturated at {top:.4g} in {n} samples; choose "
                    "a larger range of the IMU, or move more gently",
                    n / len(values),
                )
    length = streams.usual_length(samples.timestamps, accel)
    if streams.accel_unit(length) == "g":
        report.blame(
            "g",
            f"the accelerometer reads {length:.3g} where gravity is 9.81 m/s^2: it is in g; "
            "multiply by 9.81, or give the table with --imu-samples and --accel-unit g",
        )
        return gyro, accel * streams.GRAVITY
    low, high = _ODD_FORCE
    if not low < length < high:
        report.blame(
            "scale",
            f"the accelerometer usually reads {length:.4g}, but gravity is 9.81 m/s^2; correct its "
            f"unit (a factor of {streams.GRAVITY / max(length, 1e-9):.3g}), or add gravity if "
            "these are accelerations without it",
        )
        if length > 0.5:
            return gyro, accel * (streams.GRAVITY / length)
    else:
        report.notes.append(f"accelerometer: usually {length:.2f} m/s^2 (gravity 9.81)")
    return gyro, accel


# ---- the gyro ------------------------------------------------------------------------------------


def _check_following(report: ImuReport, rates: RateFit) -> bool:
    """Whether the gyro agrees with the camera well enough to determine axes and clock."""
    if rates.explained >= _EXPLAINED and rates.camera_rms > 0.5 * _TURNING:
        return True
    damaged = any(fault.kind in ("dead", "swapped") for fault in report.faults)
    gyro_turns = rates.gyro_rms > 0.15 and rates.gyro_rms > 3 * rates.camera_rms
    camera_turns = rates.camera_rms > 2 * _TURNING
    if camera_turns and rates.gyro_rms < _TURNING and not damaged:
        report.open_questions.append(
            f"the images turn with {rates.camera_rms:.2f} rad/s, but the gyro is at rest: the "
            "scene moves, or the samples are of another recording; record 10 s with turns about "
            "all axes"
        )
        return False
    if camera_turns or gyro_turns:
        if not damaged:
            report.blame(
                "unrelated",
                f"the gyro explains only {100 * rates.explained:.0f} % of the camera's rotation: "
                "the samples may be of another recording, the time offset larger than was tried "
                "(--reach), or the video stabilised; record without stabilisation",
            )
        return False
    report.open_questions.append(
        f"the camera turns too little ({rates.camera_rms:.2f} rad/s) to check axes and time "
        "offset; record 10 s with turns about all axes"
    )
    return False


def _check_clock(report: ImuReport, rates: RateFit, believed: float) -> None:
    late = rates.offset - believed
    report.notes.append(
        f"time offset: {rates.offset * 1e3:+.1f} ms (+/- {rates.offset_deviation * 1e3:.1f}), to "
        "be added to the times of the images"
    )
    if abs(late) > max(_SMALL_OFFSET, 4 * rates.offset_deviation):
        report.blame(
            "time_offset",
            f"the clocks of images and IMU differ by {rates.offset * 1e3:+.1f} ms, but "
            f"{believed * 1e3:g} ms were expected; set the time offset (Kalibr's "
            f"timeshift_cam_imu) to {rates.offset:.4f} s",
        )


def _check_scale(report: ImuReport, rates: RateFit) -> None:
    factor = rates.scale
    if any(fault.kind == "saturated" for fault in report.faults):
        return
    if abs(factor / _DEGREE - 1) < 0.25:
        report.blame(
            "degrees",
            f"the gyro reads {1 / factor:.1f} times the camera's rotation rate: it is in degrees "
            "per second; multiply by 0.0174533, or give the table with --imu-samples and "
            "--gyro-unit deg/s",
        )
    elif abs(factor - 1) > max(_SMALL_SCALE, 4 * rates.scale_deviation):
        report.blame(
            "scale",
            f"the gyro reads {1 / factor:.3g} times the camera's rotation rate; correct its unit "
            "or scale, or the focal length of the camera",
        )
    else:
        report.notes.append(f"gyro: {1 / factor:.3f} times the camera's rotation rate")
    unit = _DEGREE if abs(factor / _DEGREE - 1) < 0.25 else 1.0
    bias = ", ".join(f"{value * unit:.4f}" for value in rates.bias)
    report.notes.append(f"bias of the gyro: {bias} rad/s")


def _check_axes(
    report: ImuReport, rates: RateFit, settings: ImuSettings | None
) -> FloatArray | None:
    """Compare the rotation with that of the settings; returns ``T_ci`` for the accelerometer."""
    if _gyro_is_damaged(report):
        return None if settings is None else settings.T_ci
    mirrored = float(np.linalg.det(rates.M)) < 0 and _worse(rates, rates.R, rates.M)
    best = np.eye(4)
    best[:3, :3] = rates.R
    known = rates.R_deviation < 5 * _DEGREE
    if settings is None:
        if mirrored:
            report.blame(
                "axes",
                "the gyro is mirrored: one or all of its axes have the wrong sign; correct the "
                "sign, or give --imu-settings, which contains the axes",
            )
            return None
        report.notes.append(f"rotation from IMU to camera: {_matrix_text(rates.R)}")
        if not known:
            report.open_questions.append(
                "the camera turned about one axis only, so the rotation to the IMU is not certain"
            )
        return best if known else None
    R = settings.T_ci[:3, :3]
    angle = float(rotation_angles((R.T @ rates.R)[None])[0])
    if not _worse(rates, R, rates.M) or (angle < _SMALL_ANGLE and not mirrored):
        precision = rates.R_deviation / _DEGREE
        report.notes.append(
            f"rotation from IMU to camera: {angle / _DEGREE:.1f} degrees from the settings "
            f"(+/- {precision:.1f})"
        )
        return settings.T_ci
    if not _worse(rates, R.T, rates.M):
        P = min(signed_permutations(), key=lambda P: float(np.linalg.norm(R @ P - R.T)))
        same = np.linalg.norm(R @ P - R.T) < _SAME_AXES
        report.blame(
            "inverse",
            "the rotation between camera and IMU in the settings is the inverse of the right one; "
            "invert the whole matrix (IMU.T_b_c1 is from camera to IMU, T_cam_imu from IMU to "
            "camera)" + (f", or the axes of the samples are wrong: {axes_text(P)}" if same else ""),
        )
        return np.asarray(inverse_poses(settings.T_ci))
    return _other_axes(report, rates, settings, angle)


def _gyro_is_damaged(report: ImuReport) -> bool:
    """Whether the rates of single axes are wrong, so that no rotation fits."""
    return any(
        fault.kind == "dead"
        or (fault.kind == "saturated" and "gyro" in fault.text and fault.share > _CLIPPED)
        for fault in report.faults
    )


def _other_axes(
    report: ImuReport, rates: RateFit, settings: ImuSettings, angle: float
) -> FloatArray | None:
    R = settings.T_ci[:3, :3]
    P = min(signed_permutations(), key=lambda P: rates.misfit(R @ P))
    turned: FloatArray = settings.T_ci.copy()
    turned[:3, :3] = rates.R
    if not np.array_equal(P, np.eye(3)) and np.linalg.norm(R @ P - rates.M) < _SAME_AXES:
        text = (
            f"the axes of the gyro are exchanged or have wrong signs: it fits with {axes_text(P)}"
        )
        if np.linalg.det(P) < 0:
            report.blame("axes", f"{text}; correct these columns of the samples")
            return settings.T_ci
        report.blame(
            "axes",
            f"{text}; correct these columns, or, if the accelerometer has the same axes, give the "
            f"rotation from IMU to camera: {_matrix_text(rates.R)}",
        )
        return turned
    if rates.R_deviation > 5 * _DEGREE:
        report.blame(
            "rotation",
            "the gyro does not turn as the camera with the rotation of the settings; turn about "
            "all axes, so that the right one can be determined",
        )
        return None
    report.blame(
        "rotation",
        f"the rotation between camera and IMU in the settings is {angle / _DEGREE:.0f} degrees "
        f"off; the rotation from IMU to camera that fits is {_matrix_text(rates.R)}",
    )
    return turned


def _worse(rates: RateFit, M: FloatArray, best: FloatArray) -> bool:
    """Whether a matrix fits clearly worse than the best one."""
    a, b = rates.misfit(M), max(rates.misfit(best), 1e-10)
    return a > 1.25 * b and (a - b) / b * rates.n > 30


def _matrix_text(R: FloatArray) -> str:
    rows = ["[" + ", ".join(f"{value:.4f}" for value in row) + "]" for row in R]
    return "[" + ", ".join(rows) + "]"
