# SPDX-License-Identifier: BSD-3-Clause
"""Whether a calibration fits images of a size, or the calibration beside them.

A wrong calibration gives a distorted map without any error message. This check needs only the size
of the images; checks of the images are in `orbslam2py.runs`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.builtin import BUILTIN_DATA, BUILTIN_NAMES, builtin_sensors
from orbslam2py.settings.groups import CameraSettings
from orbslam2py.settings.settings import Settings, builtin_settings


@dataclass(frozen=True)
class FitThresholds:
    """Largest usual deviations of a correct calibration.

    Right, but odd cameras lie within: phones held upright, wide-angle lenses, images cut at one
    side, pixels that are not square. ``docs/method/calibration.md`` has the measurements.
    """

    principal_point: float = 0.4
    """Most distance of the principal point from the image's middle, in widths and heights."""
    least_field_of_view: float = 20.0
    """Horizontal field of view, degrees ..."""
    most_field_of_view: float = 150.0
    """... that a pinhole camera can have."""
    most_fisheye_view: float = 280.0
    """Horizontal field of view, degrees, that a fisheye camera can have."""
    focal_ratio: float = 1.5
    """Most fx by fy, or fy by fx."""
    scaled: float = 1.5
    """Twice the principal point by the image's size, or its reciprocal: beyond this factor, in both
    directions alike, the calibration is of images of another size ..."""
    scaled_alike: float = 0.1
    """... and alike means up to this difference of the logarithms."""
    turned: float = 0.05
    """With x and y exchanged the principal point lies so near to the middle: turned images ..."""
    turned_before: float = 0.1
    """... if it was farther away than this before."""
    named_size: float = 0.03
    """Most difference of an image from the size that the settings name, of that size. The published
    settings of KITTI name one size for images of three."""
    displacement: float = 0.005
    """Most median distance of pixels by two calibrations of one camera, in image widths."""
    known: float = 1e-4
    """Numbers so near to those of a known data set, relatively, are its numbers."""
    baseline: float = 0.02
    """Most difference of two baselines of one stereo pair, or factors of one depth camera."""
    cut: float = 0.12
    """Images of a known data set may be smaller than it has them by this part of width and height:
    cut at the right and below for a network, they keep their calibration."""
    rows: float = 2.0
    """Most median difference of the rows of a rectified pair's points, pixels: stereo matching
    looks no farther."""
    wrong_sign: float = 0.5
    """Most part of them that lies farther right in the right image than in the left."""
    gain: float = 2.5
    """A changed focal length that divides the robust cost of epipolar distances by this is
    certainly better: a rolling shutter looks like another one, too ..."""
    clearer: float = 1.1
    """... if what it gains is by this factor more than what another change gains ..."""
    gain_with_depth: float = 1.25
    """... and, or a changed principal point, by this that of points with depth ..."""
    gain_of_distortion: float = 1.6
    """... and another lens distortion must do as well as this at least."""
    explained: float = 1.5
    """Most residual that the changed calibration may leave, pixels: where things move on their own
    no calibration explains the points."""
    significance: float = 5.0
    """Fewest standard deviations of such a change ..."""
    focal: float = 0.15
    """... and its least size, in logarithms of the focal length ..."""
    centre: float = 0.12
    """... in shifts of the principal point by the focal length ..."""
    radial: float = 0.1
    """... and in the first radial coefficient."""
    least_pairs: int = 4
    """Fewest pairs of images that decide; each half of them must say the same."""


@dataclass(frozen=True)
class Misfit:
    """Why a calibration and images do not belong together.

    Attributes
    ----------
    seen
        The finding.
    cause
        Its likely cause.
    remedy
        What to do.
    """

    seen: str
    cause: str
    remedy: str

    def __str__(self) -> str:
        return (
            f"the calibration does not fit the images: {self.seen}; likely cause: {self.cause}; "
            f"{self.remedy}"
        )


#: Sizes of the images that the built-in settings are for, as the data sets have them.
_SIZES = {
    "tum1": (640, 480),
    "tum2": (640, 480),
    "tum3": (640, 480),
    "kitti00-02": (1241, 376),
    "kitti03": (1242, 375),
    "kitti04-12": (1226, 370),
    "euroc": (752, 480),
}

#: What to do about a calibration that belongs to no known data set.
MEASURE = "calibrate the camera at the size of these images (orbslam2py calibrate)"


def builtin_for_size(size: tuple[int, int]) -> tuple[str, ...]:
    """Name the built-in settings for images of this width and height [pixels]."""
    return tuple(name for name, its_size in _SIZES.items() if its_size == size)


@lru_cache(maxsize=1)
def _known_cameras() -> tuple[tuple[str, CameraSettings], ...]:
    return tuple(
        (name, builtin_settings(name, sensor).camera)
        for name in BUILTIN_NAMES
        for sensor in builtin_sensors(name)
    )


def known_camera(camera: CameraSettings, thresholds: FitThresholds | None = None) -> str | None:
    """Name the built-in settings that have these numbers (fx, fy, cx, cy); None if none has."""
    if camera.is_fisheye:
        return None
    limit = (thresholds or FitThresholds()).known
    numbers = _intrinsics(camera)
    for name, known in _known_cameras():
        if np.allclose(_intrinsics(known), numbers, rtol=limit, atol=0):
            return name
    return None


def _intrinsics(camera: CameraSettings) -> FloatArray:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


def find_misfit(
    settings: Settings, size: tuple[int, int], thresholds: FitThresholds | None = None
) -> Misfit | None:
    """Judge a calibration by the size of the images.

    Parameters
    ----------
    settings : Settings
        The calibration (of the rectified images for a pair).
    size : tuple of int
        Width and height of the tracked images, pixels.
    thresholds : FitThresholds, optional
        The limits.

    Returns
    -------
    Misfit or None
        The likeliest cause of what does not fit; None if everything does.
    """
    limits = thresholds or FitThresholds()
    camera = settings.camera
    checks = (_another_data_set, _turned, _scaled, _named_size, _off_the_middle, _field, _ratio)
    for check in checks:
        misfit = check(camera, size, limits)
        if misfit is not None:
            return misfit
    return None


def _another_data_set(
    camera: CameraSettings, size: tuple[int, int], limits: FitThresholds
) -> Misfit | None:
    name = known_camera(camera, limits)
    if name is None or _SIZES[name] == size:
        return None
    theirs = _SIZES[name]
    others = [other for other, known in _SIZES.items() if known == size]
    if not others and all(
        t * (1 - limits.cut) <= s <= t for s, t in zip(size, theirs, strict=True)
    ):
        return None
    return Misfit(
        f"the images are {_text(size)}, those of {BUILTIN_DATA[name]} {_text(theirs)}",
        f"settings of {name} for {_whose(others)}",
        f"give {' or '.join(others)}, or the settings of this camera" if others else MEASURE,
    )


def _whose(names: list[str]) -> str:
    return f"images as {' or '.join(names)} has them" if names else "images of another camera"


def _turned(camera: CameraSettings, size: tuple[int, int], limits: FitThresholds) -> Misfit | None:
    width, height = size
    before = max(abs(camera.cx / width - 0.5), abs(camera.cy / height - 0.5))
    after = max(abs(camera.cy / width - 0.5), abs(camera.cx / height - 0.5))
    if before <= limits.turned_before or after > limits.turned:
        return None
    return Misfit(
        _principal_point(camera, size),
        "a calibration of images turned by 90 degrees, upright instead of lying or the reverse",
        "exchange fx and fy, cx and cy, or turn the images",
    )


def _scaled(camera: CameraSettings, size: tuple[int, int], limits: FitThresholds) -> Misfit | None:
    factors = 2 * camera.cx / size[0], 2 * camera.cy / size[1]
    if min(factors) <= 0:
        return None
    x, y = (math.log(factor) for factor in factors)
    if min(abs(x), abs(y)) <= math.log(limits.scaled) or abs(x - y) > limits.scaled_alike:
        return None
    factor = math.exp((x + y) / 2)
    about = round(size[0] * factor), round(size[1] * factor)
    return Misfit(
        _principal_point(camera, size),
        f"a calibration of larger or smaller images, of about {_text(about)}",
        f"multiply fx, fy, cx, cy of the file by {1 / factor:.3g}, or give images of the "
        "calibrated size",
    )


def _named_size(
    camera: CameraSettings, size: tuple[int, int], limits: FitThresholds
) -> Misfit | None:
    if camera.width is None or camera.height is None:
        return None
    named = camera.width, camera.height
    if all(abs(s - n) <= limits.named_size * n for s, n in zip(size, named, strict=True)):
        return None
    return Misfit(
        f"the images are {_text(size)}, the settings are for {_text(named)} (Camera.width, "
        "Camera.height)",
        "images that were scaled or cut after the calibration, or another camera's settings",
        MEASURE,
    )


def _off_the_middle(
    camera: CameraSettings, size: tuple[int, int], limits: FitThresholds
) -> Misfit | None:
    off = abs(camera.cx / size[0] - 0.5), abs(camera.cy / size[1] - 0.5)
    if max(off) <= limits.principal_point:
        return None
    return Misfit(
        _principal_point(camera, size),
        "another camera's settings, or images that were scaled or cut after the calibration",
        MEASURE,
    )


def _field(camera: CameraSettings, size: tuple[int, int], limits: FitThresholds) -> Misfit | None:
    most = limits.most_fisheye_view if camera.is_fisheye else limits.most_field_of_view
    try:
        degrees = _degrees_wide(camera, size)
    except SettingsError as error:
        cause = "a focal length in another unit, or of another image size"
        return Misfit(str(error), cause, MEASURE)
    if limits.least_field_of_view <= degrees <= most:
        return None
    return Misfit(
        f"fx {camera.fx:g} makes images of width {size[0]} {degrees:.0f} degrees wide",
        "a focal length in another unit (millimetres, image widths) or of another image size",
        f"give fx and fy in pixels, usually {size[0] * 0.5:.0f} to {size[0] * 1.5:.0f} here",
    )


def _degrees_wide(camera: CameraSettings, size: tuple[int, int]) -> float:
    """Horizontal angle of view, degrees; of a pinhole without its distortion."""
    if camera.is_fisheye:
        return math.degrees(camera.camera_model(*size).angle_of_view().horizontal)
    return math.degrees(2 * math.atan(size[0] / (2 * camera.fx)))


def _ratio(camera: CameraSettings, size: tuple[int, int], limits: FitThresholds) -> Misfit | None:
    ratio = max(camera.fx / camera.fy, camera.fy / camera.fx)
    if ratio <= limits.focal_ratio:
        return None
    return Misfit(
        f"fx {camera.fx:g} and fy {camera.fy:g} differ by a factor of {ratio:.1f}",
        "numbers in another order (fx, fy, cx, cy), or images that were scaled in one direction",
        "look at Camera.fx, Camera.fy, Camera.cx, Camera.cy",
    )


def _principal_point(camera: CameraSettings, size: tuple[int, int]) -> str:
    middle = (size[0] - 1) / 2, (size[1] - 1) / 2
    return (
        f"the principal point (cx {camera.cx:g}, cy {camera.cy:g}) is far from the middle "
        f"({middle[0]:g}, {middle[1]:g}) of {_text(size)} images"
    )


def _text(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
