# SPDX-License-Identifier: BSD-3-Clause
"""Effects between the world and the image: motion blur, jumps of exposure, a hand, noise."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arguments import number_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings import CameraSettings
from orbslam2py.trajectory.rotations import inverse_poses

_MOST_SAMPLES = 33  # along the longest smear
_SMEAR_STEP = 1.5  # pixels between two samples


def smeared(
    grey: ByteArray,
    depth: NDArray[np.float32],
    camera: CameraSettings,
    T_open: FloatArray,
    T_middle: FloatArray,
    T_shut: FloatArray,
) -> NDArray[np.float32]:
    """Blur an image by the camera's motion while the shutter is open.

    Every pixel is averaged along the path of its point in the image, in straight lines from the
    opening to the middle of the exposure and from there to its end. Background that becomes visible
    beside an edge meanwhile is left out: a good approximation for blur that is short relative to
    objects.

    Parameters
    ----------
    grey, depth
        Image in the middle of the exposure, (h, w); depth along z [m], 0 where no surface is hit.
    camera
        Intrinsics.
    T_open, T_middle, T_shut
        Camera to world (4, 4).

    Returns
    -------
    array (h, w)
        Grey levels.
    """
    halves = [_flow(depth, camera, T_middle, T_end) for T_end in (T_open, T_shut)]
    longest = float(max(np.abs(half).max() for half in halves))
    samples = min(_MOST_SAMPLES // 2, math.ceil(longest / _SMEAR_STEP))
    if samples == 0:
        return grey.astype(np.float32)
    height, width = grey.shape
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    image = grey.astype(np.float32)
    total = image.copy()
    for flow in halves:
        for k in range(1, samples + 1):
            share = np.float32(k / samples)
            # Ends count half, as in the trapezium rule.
            weight = np.float32(0.5 if k == samples else 1.0)
            total += weight * cv2.remap(
                image,
                x + share * flow[..., 0],
                y + share * flow[..., 1],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
    return np.asarray(total / np.float32(2 * samples), np.float32)


def _flow(
    depth: NDArray[np.float32], camera: CameraSettings, T_wc: FloatArray, T_wd: FloatArray
) -> NDArray[np.float32]:
    """Return for each pixel of camera c the pixel of its point in camera d, (h, w, 2).

    Pixels of points behind camera d do not move; those without depth are infinitely far.
    """
    T_dc = inverse_poses(T_wd) @ T_wc
    height, width = depth.shape
    y, x = np.indices((height, width), dtype=np.float64)
    rays = np.stack([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)], -1)
    inverse_depth = np.divide(1.0, depth, out=np.zeros(depth.shape), where=depth > 0)
    seen = rays @ T_dc[:3, :3].T + inverse_depth[..., None] * T_dc[:3, 3]
    ahead = seen[..., 2] > 0.05
    z = np.where(ahead, seen[..., 2], 1.0)
    flow = np.stack(
        [
            camera.fx * seen[..., 0] / z + camera.cx - x,
            camera.fy * seen[..., 1] / z + camera.cy - y,
        ],
        axis=-1,
    )
    limit = max(height, width)
    return np.where(ahead[..., None], np.clip(flow, -limit, limit), 0.0).astype(np.float32)


def exposed(
    image: NDArray[np.float32], exposure: float, noise: float, seed: list[int]
) -> ByteArray:
    """Return grey values of the camera, uint8: multiplied, with noise, rounded."""
    values = image * np.float32(exposure)
    if noise > 0:
        random = np.random.default_rng(seed)
        values = values + np.float32(noise) * random.standard_normal(image.shape, np.float32)
    return np.asarray(np.rint(np.clip(values, 0, 255)), np.uint8)


_JUMPS = 997  # drawn at once; then they come again


def exposure_at(seconds: float, limits: tuple[float, float], seed: int) -> float:
    """Return the factor on the grey values at a time: a new one 0.5 to 1.5 s after the last."""
    random = np.random.default_rng([seed, 0xE])
    ends = np.cumsum(random.uniform(0.5, 1.5, _JUMPS))
    factors = np.exp(random.uniform(math.log(limits[0]), math.log(limits[1]), _JUMPS))
    return float(factors[np.searchsorted(ends, seconds % ends[-1], side="right")])


_HAND_SLIDES = 0.15  # seconds until it covers everything


def hand_rows(seconds: float, begin: float, end: float, height: int) -> int:
    """Return how many rows of the image, from below, a moving hand covers at these times."""
    share = min((seconds - begin) / _HAND_SLIDES + 1, (end - seconds) / _HAND_SLIDES + 1)
    return round(height * min(1.0, max(0.0, share)))


def check_cover(begin: float, lasting: float, seconds: FloatArray) -> None:
    """Raise `SettingsError` unless a hand covers some of the images, but not all."""
    if lasting == 0:
        return
    end = begin + lasting
    length = f"the sequence of {number_of(len(seconds), 'image')} ends at {seconds[-1]:g} s"
    if np.all((seconds >= begin) & (seconds <= end)):
        raise SettingsError(
            f"cover is {lasting:g} s, and {length}: it would be dark all the time; give less, or "
            "more frames"
        )
    if not np.any((seconds > begin - _HAND_SLIDES) & (seconds < end + _HAND_SLIDES)):
        raise SettingsError(
            f"cover begins at {begin:g} s and lasts {lasting:g} s, and {length}: no image would be "
            "covered; give another time, or more frames"
        )


def covered(
    image: ByteArray, depth: NDArray[np.float32], rows: int
) -> tuple[ByteArray, NDArray[np.float32]]:
    """Image and depth behind a hand: dark, without details, too close for depth."""
    if rows == 0:
        return image, depth
    height, width = image.shape
    image, depth = image.copy(), depth.copy()
    shade = 18 + 10 * np.linspace(0, 1, width) + 8 * np.linspace(0, 1, rows)[:, None]
    image[height - rows :] = shade.astype(np.uint8)
    depth[height - rows :] = 0
    return image, depth
