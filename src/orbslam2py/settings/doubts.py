# SPDX-License-Identifier: BSD-3-Clause
"""Values that settings allow, but that are probably wrong."""

from __future__ import annotations

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings.fisheye import PINHOLE
from orbslam2py.settings.groups import CameraSettings, DepthSettings
from orbslam2py.settings.pair_views import MOST_BASELINE, is_likely_baseline
from orbslam2py.settings.projection import distorted, largest_radius
from orbslam2py.settings.right_camera import SettingsGroups
from orbslam2py.settings.sensor import Sensor

#: Most tangential distortion. Lenses have up to some 0.005.
_MOST_TANGENTIAL = 0.015
#: Most by which rectification changes a focal length, as a factor. Usual are 0.7 to 1.3.
_MOST_ZOOM = 3.0
_INTRINSICS = ((0, 0), (1, 1), (0, 2), (1, 2))


def find_doubts(sensor: Sensor, groups: SettingsGroups) -> list[str]:
    """Return values that are allowed but probably wrong, one sentence each.

    Parameters
    ----------
    sensor
        The sensor of the settings.
    groups
        The settings.
    """
    camera, orb = groups["camera"], groups["orb"]
    found = []
    if camera.width is not None and not 0 <= camera.cx < camera.width:
        found.append(f"Camera.cx {camera.cx:g} lies outside the image ({camera.width} wide)")
    if camera.height is not None and not 0 <= camera.cy < camera.height:
        found.append(f"Camera.cy {camera.cy:g} lies outside the image ({camera.height} high)")
    if orb.n_features < 200:
        found.append(f"ORBextractor.nFeatures {orb.n_features} is very few")
    if sensor is Sensor.STEREO and camera.is_distorted and groups["right"] is None:
        found.append("stereo input must be rectified; distortion must be zero")
    size = camera.width, camera.height
    if camera.is_fisheye:
        found += _doubts_of_fisheye(camera, size)
    else:
        found += _doubts_of_lens("Camera", camera.matrix, camera.distortion, size)
    if sensor.has_depth:
        found += _doubts_of_depth(camera, groups["depth"])
    right = groups["right"]
    if right is not None and right.camera.is_fisheye:
        wrong = _doubts_of_fisheye(right.camera, size)
        found += [one.replace("Camera:", "Camera2:", 1) for one in wrong]
    return found + _doubts_of_rectification(groups)


def _doubts_of_rectification(groups: SettingsGroups) -> list[str]:
    camera, rectification = groups["camera"], groups["rectification"]
    if rectification is None:
        return []
    found = []
    expected = np.array([rectification.left.P[place] for place in _INTRINSICS])
    given = np.array([camera.matrix[place] for place in _INTRINSICS])
    if np.abs(expected - given).max() > 1e-3:
        found.append("Camera.fx, fy, cx, cy differ from LEFT.P")
    if abs(camera.bf + rectification.right.P[0, 3]) > 1e-3:
        found.append("Camera.bf differs from -RIGHT.P[0,3]")
    for name, raw in (("LEFT", rectification.left), ("RIGHT", rectification.right)):
        zoom = raw.P[0, 0] / raw.K[0, 0]
        if not 1 / _MOST_ZOOM < zoom < _MOST_ZOOM:
            found.append(
                f"{name}: rectification changes the focal length from {raw.K[0, 0]:.6g} to "
                f"{raw.P[0, 0]:.6g} pixels: is the camera matrix of the same image size "
                f"({raw.width} x {raw.height}) as the rectification?"
            )
        if raw.model == PINHOLE:
            found += _doubts_of_lens(name, raw.K, raw.D, (raw.width, raw.height))
    return found


def _doubts_of_depth(camera: CameraSettings, depth: DepthSettings | None) -> list[str]:
    found = []
    baseline = camera.bf / camera.pixels_per_radian
    if not is_likely_baseline(baseline):
        likely = (
            "is the calibration in millimetres? Then all lengths become 1000 times too long; "
            "divide its translation, or bf, by 1000"
            if baseline > MOST_BASELINE
            else "bf is in pixel metres, the baseline in metres times fx"
        )
        found.append(
            f"Camera.bf {camera.bf:g} by Camera.fx is a baseline of {baseline:.3g} m, usual are "
            f"0.1 mm to 10 m; {likely}"
        )
    if depth is not None and depth.close_factor < 1:
        found.append(f"ThDepth {depth.close_factor:g} is very little; it counts baselines")
    return found


def _doubts_of_lens(
    name: str, K: FloatArray, D: FloatArray, size: tuple[int | None, int | None]
) -> list[str]:
    """Check a distortion; an unknown image size is assumed to be twice the principal point."""
    found = []
    p1, p2 = D[2:4]
    if max(abs(p1), abs(p2)) > _MOST_TANGENTIAL:
        found.append(
            f"{name}: the tangential distortion p1 {p1:g}, p2 {p2:g} is more than any lens has "
            f"(at most some {_MOST_TANGENTIAL:g}): are these k3, k4 of a fisheye lens, or "
            "coefficients in another order than OpenCV's k1, k2, p1, p2, k3?"
        )
    fx, fy, cx, cy = (float(K[place]) for place in _INTRINSICS)
    fold = _fold_of(D)
    width, height = size[0] or 2 * cx, size[1] or 2 * cy
    corner = np.hypot(max(cx, width - 1 - cx) / fx, max(cy, height - 1 - cy) / fy)
    if fold < corner:
        found.append(
            f"{name}: the radial distortion is impossible near the image border: the distorted "
            f"radius grows only up to {fold * fx:.0f} pixels, but the image corner is "
            f"{corner * fx:.0f} pixels from the principal point; check order, signs and size of "
            "the coefficients (OpenCV's k1, k2, p1, p2, k3), or calibrate with views that reach "
            "into the corners"
        )
    return found


def _doubts_of_fisheye(camera: CameraSettings, size: tuple[int | None, int | None]) -> list[str]:
    """Check a fisheye lens by the part of the image inside the domain of its model.

    The corners, and the left and right border, of a fisheye image may be dark: but the model must
    be valid up to half of the distance to the nearest border.
    """
    width, height = (
        max(1, round(one or 2 * c)) for one, c in zip(size, (camera.cx, camera.cy), strict=True)
    )
    nearest = min(camera.cx, camera.cy, width - 1 - camera.cx, height - 1 - camera.cy)
    if nearest <= 0:
        return []  # the principal point is doubted
    ends = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]])
    pixels = (camera.cx, camera.cy) + ends * nearest / 2
    if np.isfinite(camera.camera_model(width, height).unproject(pixels)).all():
        return []
    return [
        f"Camera: the {camera.model} lens shows nothing {nearest / 2:.0f} pixels from the "
        f"principal point, though the nearest border of the image is {nearest:.0f} pixels from "
        "it; check order, signs and image size of the lens parameters"
    ]


def _fold_of(D: FloatArray) -> float:
    """Return the largest radius of a lens, on the plane at distance 1."""
    radius = largest_radius(D)
    if not np.isfinite(radius):
        return float("inf")
    radial = np.array(D, dtype=np.float64)
    radial[2:4] = 0
    # A pole is not reached, and before it the distance grows without limit.
    with np.errstate(all="ignore"):
        return float(distorted(np.array([[radius * (1 - 1e-6), 0.0]]), radial)[0, 0])
