# SPDX-License-Identifier: BSD-3-Clause
"""Whether two calibrations can be those of one camera."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.settings.builtin import BUILTIN_DATA
from orbslam2py.settings.fisheye import PINHOLE
from orbslam2py.settings.fit import FitThresholds, Misfit, known_camera
from orbslam2py.settings.groups import DISTORTION_FIELDS, CameraSettings
from orbslam2py.settings.projection import distorted
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.settings import Settings


def compare_calibrations(
    settings: Settings,
    data: Settings,
    size: tuple[int, int],
    thresholds: FitThresholds | None = None,
) -> Misfit | None:
    """Compare a calibration with the one that comes with the images.

    Parameters
    ----------
    settings : Settings
        The calibration that is used.
    data : Settings
        The one that comes with the images, of the same sensor.
    size : tuple of int
        Width and height of the tracked images, pixels.
    thresholds : FitThresholds, optional
        The limits.

    Returns
    -------
    Misfit or None
        None if both can be calibrations of one camera.
    """
    limits = thresholds or FitThresholds()
    seen = _differences(settings, data, size, limits)
    if not seen:
        return None
    used, right = known_camera(settings.camera, limits), known_camera(data.camera, limits)
    whose = BUILTIN_DATA[used] if used else "another camera, or an earlier calibration"
    images = f" for images of {BUILTIN_DATA[right]}" if right and right != used else ""
    return Misfit(
        "; ".join(seen),
        f"settings of {whose}{images}",
        "leave the settings out to use those of the images"
        + (f", or give {right}" if right and right != used else ""),
    )


def _differences(
    settings: Settings, data: Settings, size: tuple[int, int], limits: FitThresholds
) -> list[str]:
    seen = []
    ours, theirs = _raw_cameras(settings), _raw_cameras(data)
    if len(ours) != len(theirs):
        if len(ours) < len(theirs):
            return ["what comes with the images is a raw pair's, the settings do not rectify"]
        return ["what comes with the images is a rectified pair's, the settings rectify once more"]
    for one, other in zip(ours, theirs, strict=True):
        distance = calibration_distance(one, other, size)
        if distance > limits.displacement * size[0]:
            seen.append(
                f"the settings have {_numbers(one)}, what comes with the images "
                f"{_numbers(other)}, {distance:.0f} pixels apart"
            )
            break
    stereo = settings.sensor is Sensor.STEREO and data.sensor is Sensor.STEREO
    if stereo and abs(settings.baseline / data.baseline - 1) > limits.baseline:
        seen.append(f"the baseline is {settings.baseline:.4g} m instead of {data.baseline:.4g} m")
    factors = settings.depth_factor, data.depth_factor
    if settings.sensor is Sensor.RGBD and abs(factors[0] / factors[1] - 1) > limits.baseline:
        seen.append(f"DepthMapFactor is {factors[0]:g} instead of {factors[1]:g}")
    return seen


def _raw_cameras(settings: Settings) -> list[CameraSettings]:
    """The cameras of the images on disk: two if the settings rectify them."""
    pair = settings.rectification
    if settings.right is not None:
        return [settings.camera, settings.right.camera]
    if pair is None:
        return [settings.camera]
    cameras = []
    for side in (pair.left, pair.right):
        fx, fy, cx, cy = side.K[0, 0], side.K[1, 1], side.K[0, 2], side.K[1, 2]
        lens: dict[str, Any] = {"model": side.model, "lens": tuple(side.D.tolist())}
        if side.model == PINHOLE:
            lens = dict(zip(DISTORTION_FIELDS, side.D.tolist(), strict=False))
        cameras.append(CameraSettings(fx, fy, cx, cy, **lens))
    return cameras


def calibration_distance(
    one: CameraSettings, other: CameraSettings, size: tuple[int, int]
) -> float:
    """Median distance at which two calibrations see the same directions, pixels.

    Parameters
    ----------
    one, other : CameraSettings
        The calibrations; the directions are those of a grid over the image by the second.
    size : tuple of int
        Width and height of the images, pixels.
    """
    u, v = np.meshgrid(np.linspace(0, size[0] - 1, 12), np.linspace(0, size[1] - 1, 9))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    if one.is_fisheye or other.is_fisheye:
        rays = other.camera_model(*size).unproject(pixels)
        shown = ~np.isnan(rays[:, 0])
        apart = one.project(rays[shown]) - pixels[shown]
        # Directions that only one of them shows are infinitely far apart.
        distances = np.nan_to_num(np.hypot(apart[:, 0], apart[:, 1]), nan=math.inf, posinf=math.inf)
        return float(np.median(distances)) if len(distances) else math.inf
    plane = (pixels - (other.cx, other.cy)) / (other.fx, other.fy)
    apart = _project(one, plane) - _project(other, plane)
    return float(np.median(np.hypot(apart[:, 0], apart[:, 1])))


def _project(camera: CameraSettings, plane: FloatArray) -> FloatArray:
    """Pixels (n, 2) of points on the plane at distance 1 before the camera (n, 2)."""
    return distorted(plane, camera.distortion) * (camera.fx, camera.fy) + (camera.cx, camera.cy)


def _numbers(camera: CameraSettings) -> str:
    text = f"fx {camera.fx:.4g}, fy {camera.fy:.4g}, cx {camera.cx:.4g}, cy {camera.cy:.4g}"
    if camera.is_fisheye:
        return f"{text}, {camera.model} {', '.join(f'{value:.3g}' for value in camera.lens)}"
    return f"{text}, k1 {camera.k1:.3g}" if camera.is_distorted else text
