# SPDX-License-Identifier: BSD-3-Clause
"""Evidence of images against a calibration, and its likely cause."""

from __future__ import annotations

import math

import numpy as np

from orbslam2py.calibration.pair_rows import PairRows
from orbslam2py.calibration.self_calibration import CalibrationGains, Change, calibration_gains
from orbslam2py.calibration.two_views import PointPair
from orbslam2py.settings import CameraSettings
from orbslam2py.settings.fit import MEASURE, FitThresholds, Misfit


def find_pair_misfit(
    rows: list[PairRows], limits: FitThresholds, *, fisheye: bool = False
) -> Misfit | None:
    """Judge a rectified pair by the rows and disparities of its first images, or a fisheye pair.

    Parameters
    ----------
    rows : list of PairRows
        The measurements, one entry or more.
    limits : FitThresholds
        The limits; more than half of the images must be beyond them.
    fisheye : bool
        Whether `rows` are distances from epipolar curves.
    """
    difference = float(np.median([one.row_difference for one in rows]))
    wrong = float(np.median([one.wrong_sign for one in rows]))
    if fisheye and (difference > limits.rows or wrong > limits.wrong_sign):
        seen = f"lie {difference:.1f} pixels beside their epipolar curves in the right image"
        if wrong > limits.wrong_sign:
            seen += f", and {100 * wrong:.0f} % of them on the wrong side of infinity"
        return Misfit(
            f"points of the left image {seen}",
            "left and right image are swapped or not taken at one time, or Stereo.T_c1_c2 is of "
            "another pair, or inverse",
            "exchange left and right, synchronise the cameras, or calibrate this pair",
        )
    if difference > limits.rows:
        return Misfit(
            f"the rows of the same points in left and right image differ by {difference:.1f} "
            f"pixels (at most {limits.rows:g} can be matched)",
            "a pair that is not rectified, or by another calibration",
            "rectify the images (LEFT.* and RIGHT.* in the settings) with the calibration of this "
            "pair",
        )
    if wrong > limits.wrong_sign:
        return Misfit(
            f"{100 * wrong:.0f} % of the points lie farther right in the right image than in the "
            "left one",
            "left and right image are swapped, or a pair rectified with different principal points",
            "exchange left and right, or rectify to zero disparity at infinity",
        )
    return None


def find_data_misfit(
    camera: CameraSettings,
    pairs: list[PointPair],
    whole: CalibrationGains | None,
    limits: FitThresholds,
) -> Misfit | None:
    """Judge a calibration by points that were followed from image to image.

    Parameters
    ----------
    camera : CameraSettings
        The calibration.
    pairs : list of PointPair
        All with depths or all without.
    whole : CalibrationGains, optional
        `calibration_gains` of all pairs.
    limits : FitThresholds
        The limits. A finding of all pairs counts if each half of the pairs has it, too.
    """
    if whole is None or whole.n_pairs < limits.least_pairs:
        return None
    with_depth = pairs[0].depths is not None
    found = _candidates(whole, limits, with_depth)
    if not found:
        return None
    halves = [calibration_gains(camera, pairs[i::2]) for i in (0, 1)]
    sure = [
        name
        for name in found
        if all(half is not None and _agrees(name, whole, half, limits) for half in halves)
    ]
    if not sure:
        return None
    best = max(sure, key=lambda name: _change_of(whole, name).gain)
    return _explain(camera, whole, best)


def _change_of(gains: CalibrationGains, name: str) -> Change:
    return {"focal": gains.focal, "centre": gains.centre, "radial": gains.radial}[name]


def _least_gain(name: str, limits: FitThresholds, with_depth: bool) -> float:
    if name == "radial":
        return limits.gain_of_distortion
    return limits.gain_with_depth if with_depth else limits.gain


def _least_size(name: str, limits: FitThresholds) -> float:
    return {"focal": limits.focal, "centre": limits.centre, "radial": limits.radial}[name]


def _candidates(gains: CalibrationGains, limits: FitThresholds, with_depth: bool) -> list[str]:
    # Epipolar lines alone hardly determine the principal point: motions explain it away.
    names = ("focal", "centre", "radial") if with_depth else ("focal", "radial")
    return [
        name
        for name in names
        if (change := _change_of(gains, name)).gain > _least_gain(name, limits, with_depth)
        and float(np.linalg.norm(change.values)) > _least_size(name, limits)
        and change.significance > limits.significance
        and (with_depth or change.gain > limits.clearer * _rival(gains, name))
        and gains.residual / math.sqrt(change.gain) < limits.explained
    ]


def _rival(gains: CalibrationGains, name: str) -> float:
    """Gain of the best other change; epipolar lines alone may take one for the other."""
    others = {"focal", "centre", "radial"} - {name}
    return max(_change_of(gains, other).gain for other in others)


def _agrees(
    name: str, whole: CalibrationGains, half: CalibrationGains, limits: FitThresholds
) -> bool:
    all_say, it_says = _change_of(whole, name).values, _change_of(half, name).values
    size = float(np.linalg.norm(all_say))
    along = float(it_says @ all_say) / size
    return along > _least_size(name, limits) / 2


def _explain(camera: CameraSettings, gains: CalibrationGains, name: str) -> Misfit:
    change = _change_of(gains, name)
    before, after = gains.residual, gains.residual / math.sqrt(change.gain)
    told = f"clearly better (residuals {after:.2f} instead of {before:.2f} pixels)"
    if name == "focal":
        fx = camera.fx * math.exp(change.values[0])
        return Misfit(
            f"the motion of the first images fits fx of about {fx:.0f} {told}, not {camera.fx:.0f}",
            "a wrong focal length, or settings of another camera or image size",
            MEASURE,
        )
    if name == "centre":
        cx, cy = np.array([camera.cx, camera.cy]) + change.values * (camera.fx, camera.fy)
        return Misfit(
            f"the motion of the first images fits a principal point of about ({cx:.0f}, {cy:.0f}) "
            f"{told}, not ({camera.cx:.0f}, {camera.cy:.0f})",
            "images that were cut or scaled after the calibration, or another camera's settings",
            MEASURE,
        )
    kind = "images that are undistorted already, or another lens'" if camera.is_distorted else ""
    return Misfit(
        f"the motion of the first images fits another lens distortion {told}",
        f"distortion (k1, k2, p1, p2, k3) of {kind} settings"
        if kind
        else "images of a lens that distorts, with settings that say it does not",
        MEASURE,
    )
