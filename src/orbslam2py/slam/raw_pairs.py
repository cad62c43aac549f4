# SPDX-License-Identifier: BSD-3-Clause
"""Raw stereo pairs in the front end: rectified before features are found, or as they are."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray
from orbslam2py.settings.groups import StereoRectification
from orbslam2py.settings.rectify import core_rectifier
from orbslam2py.settings.settings import Settings

_log = logging.getLogger(__name__)

#: A pair comes rectified if this factor more keypoints, and at least this number more, have a match
#: before rectification.
_MORE, _LEAST_MORE = 1.5, 50
_TEXT = (
    "the pairs come rectified already: as they are {n_given} keypoints have a match, after "
    "rectification by the settings {n_rectified}; they are tracked as they are. Give the raw "
    "images of both cameras, or settings without the calibration of the raw ones (LEFT.*, RIGHT.*, "
    "Camera2.*)"
)

#: Number of left keypoints with a match in the right image.
CountMatches = Callable[[ByteArray, ByteArray], int]


class RawPairs:
    """Rectifies the pairs that an application delivers as its cameras take them.

    Parameters
    ----------
    pair : StereoRectification
        Calibration of the raw and of the rectified cameras.
    count_matches : callable
        Counts the matches of two grey images as if they were a rectified pair.

    Attributes
    ----------
    warning : str or None
        What was logged: the first pairs come rectified already.
    """

    def __init__(self, pair: StereoRectification, count_matches: CountMatches) -> None:
        self._sides = core_rectifier(pair.left), core_rectifier(pair.right)
        self._rectifier = core.PairRectifier(*self._sides)
        self._count_matches = count_matches
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
        rectified = self._rectifier.rectify(np.ascontiguousarray(left), np.ascontiguousarray(right))
        if self._undecided and self._are_rectified((left, right), rectified):
            return left, right
        return rectified

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

    def _are_rectified(
        self, given: tuple[ByteArray, ByteArray], rectified: tuple[ByteArray, ByteArray]
    ) -> bool:
        """Count matches along rows before and after rectification, in the first pair with some."""
        n_given, n_rectified = self._count_matches(*given), self._count_matches(*rectified)
        if max(n_given, n_rectified) < _LEAST_MORE:
            return False  # a dark image does not count
        self._undecided = False
        if n_given < _MORE * n_rectified or n_given < n_rectified + _LEAST_MORE:
            return False
        self.warning = _TEXT.format(n_given=n_given, n_rectified=n_rectified)
        _log.warning("%s", self.warning)
        return True


def raw_pairs_of(settings: Settings, count_matches: CountMatches) -> RawPairs | None:
    """Make what rectifies the pairs of an application; None if they come as they are tracked."""
    pair = settings.rectification
    if pair is None or pair.applied:
        return None
    return RawPairs(pair, count_matches)


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
