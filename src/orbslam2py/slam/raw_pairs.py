# SPDX-License-Identifier: BSD-3-Clause
"""Raw stereo pairs in the front end: rectified before features are detected, or not rectified."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.settings.groups import StereoRectification
from orbslam2py.settings.rectify import core_rectifier
from orbslam2py.settings.settings import Settings

_log = logging.getLogger(__name__)

#: A pair comes rectified if the rows of its points differ by less than this part of the difference
#: after rectification; and the least number of points.
_CLEARLY_LESS, _LEAST_POINTS = 0.7, 50
#: Row difference after rectification that is noise of the keypoints [px].
_NOISE = 0.5
#: Descriptor distance of the same point, and row difference beyond which it is another one [px].
_MOST_BITS, _MOST_ROWS = 50, 15.0
_TEXT = (
    "the pairs come rectified already: the rows of their points differ by {given:.1f} pixels, and "
    "by {rectified:.1f} after rectification by the settings; they are tracked without "
    "rectification. Give the raw images of both cameras, or settings without the calibration of "
    "the raw ones (LEFT.*, RIGHT.*, Camera2.*)"
)

#: Features of both images of a grey pair.
Extract = Callable[[ByteArray, ByteArray], tuple[core.Extraction, core.Extraction]]


class RawPairs:
    """Rectifies the pairs that an application delivers as its cameras take them.

    Parameters
    ----------
    pair : StereoRectification
        Calibration of the raw and of the rectified cameras.
    extract : callable
        Finds the features of a grey pair.

    Attributes
    ----------
    warning : str or None
        The logged text: the first pairs come rectified already.
    """

    def __init__(self, pair: StereoRectification, extract: Extract) -> None:
        self._sides = core_rectifier(pair.left), core_rectifier(pair.right)
        self._rectifier = core.PairRectifier(*self._sides)
        self._extract = extract
        self._undecided = True
        self.warning: str | None = None

    @property
    def rectifier(self) -> core.PairRectifier | None:
        """What rectifies, or None if the pairs come rectified."""
        return None if self.warning else self._rectifier

    def rectify(self, left: ByteArray, right: ByteArray) -> tuple[ByteArray, ByteArray]:
        """Rectify a grey pair (h, w), unless the first pairs came rectified.

        Raises
        ------
        ImageError
            If the images have another size than those of the calibration.
        """
        if self.warning is not None:
            return left, right
        if self._undecided and self._are_rectified(left, right):
            return left, right
        return self._rectifier.rectify(np.ascontiguousarray(left), np.ascontiguousarray(right))

    def rectify_masks(
        self, left: ByteArray | None, right: ByteArray | None
    ) -> tuple[ByteArray | None, ByteArray | None]:
        """Rectify the masks of a raw pair, to the nearest pixel."""
        if self.warning is not None:
            return left, right
        first, second = (
            None if mask is None else side.rectify(np.ascontiguousarray(mask), is_mask=True)
            for side, mask in zip(self._sides, (left, right), strict=True)
        )
        return first, second

    def _are_rectified(self, left: ByteArray, right: ByteArray) -> bool:
        """Compare the rows of the same points before and after, in the first pair with enough."""
        first, second = _same_points(*self._extract(left, right))
        given = np.abs(first[:, 1] - second[:, 1])
        ends = [side.from_raw(p) for side, p in zip(self._sides, (first, second), strict=True)]
        rectified = np.abs(ends[0][:, 1] - ends[1][:, 1])
        near = np.minimum(given, np.nan_to_num(rectified, nan=np.inf)) < _MOST_ROWS
        if np.count_nonzero(near) < _LEAST_POINTS:
            return False  # a dark image does not count
        self._undecided = False
        apart = float(np.median(given[near])), float(np.nanmedian(rectified[near]))
        if apart[0] > _CLEARLY_LESS * apart[1] or apart[1] < _NOISE:
            return False
        self.warning = _TEXT.format(given=apart[0], rectified=apart[1])
        _log.warning("%s", self.warning)
        return True


def _same_points(left: core.Extraction, right: core.Extraction) -> tuple[FloatArray, FloatArray]:
    """Pixels (n, 2) of the keypoints whose descriptors are nearest to each other both ways."""
    bits = [np.unpackbits(one.descriptors, axis=1).astype(np.float32) for one in (left, right)]
    pixels = [np.asarray(one.keypoints, np.float64)[:, :2] for one in (left, right)]
    if not len(bits[0]) or not len(bits[1]):
        return pixels[0][:0], pixels[1][:0]
    sums = [one.sum(axis=1) for one in bits]
    distance = sums[0][:, None] + sums[1][None] - 2 * bits[0] @ bits[1].T
    there, back = distance.argmin(axis=1), distance.argmin(axis=0)
    here = np.arange(len(there))
    same = (back[there] == here) & (distance[here, there] < _MOST_BITS)
    return pixels[0][same], pixels[1][there[same]]


def raw_pairs_of(settings: Settings, extract: Extract) -> RawPairs | None:
    """Make the rectification of an application's pairs; None if they need none."""
    pair = settings.rectification
    if pair is None or pair.applied:
        return None
    return RawPairs(pair, extract)


def wide_pair_of(settings: Settings, camera: core.Camera, size: tuple[int, int]) -> core.WidePair:
    """Make what matches a fisheye pair.

    Parameters
    ----------
    settings : Settings
        With a right camera.
    camera : core.Camera
        The left camera, made with the centre of the right one.
    size : tuple of int
        Width and height of the images [pixels].
    """
    right = settings.right
    assert right is not None
    T = right.T_right_left
    return core.WidePair(
        camera,
        right.camera.camera_model(*size).core,
        np.ascontiguousarray(T[:3, :3]),
        np.ascontiguousarray(T[:3, 3]),
    )
