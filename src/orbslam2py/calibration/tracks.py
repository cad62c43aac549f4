# SPDX-License-Identifier: BSD-3-Clause
"""Points followed from image to image, without any calibration."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import ByteArray, FloatArray

#: Size of the window in which a point is followed [pixels], and how often images are halved.
_WINDOW, _HALVINGS = (15, 15), 3
#: Points that come back farther from their beginning than this are dropped [pixels].
_THERE_AND_BACK = 0.5
#: Images over which points are tracked back to check them, and the largest distance then [pixels].
_CHECK_EVERY, _BACK_OVER_SOME = 2, 0.75
#: Parts of an image per row and column in which corners are searched, so that one object with
#: much texture does not get them all; least quality relative to the best of a part; distance.
_N_PARTS, _QUALITY, _APART = 4, 0.05, 7


@dataclass(frozen=True)
class TrackedPair:
    """The same points in two images.

    Attributes
    ----------
    first, second
        Pixels in the images, float64 (n, 2), with the lens' distortion.
    frames
        Numbers of the two images.
    """

    first: FloatArray
    second: FloatArray
    frames: tuple[int, int]

    def __len__(self) -> int:
        return len(self.first)


def find_corners(grey: ByteArray, n_points: int, mask: ByteArray | None = None) -> FloatArray:
    """Find corners that lie all over an image, as many in every one of 16 parts.

    Parameters
    ----------
    grey : array of uint8, (h, w)
        The image.
    n_points : int
        Points wanted; there are fewer where there is no texture.
    mask : array of uint8, (h, w), optional
        No corner lies where it is 0.

    Returns
    -------
    array, (n, 2)
        Pixels.
    """
    height, width = grey.shape
    ys, xs = (np.linspace(0, size, _N_PARTS + 1).astype(int) for size in (height, width))
    found: list[FloatArray] = [np.zeros((0, 2))]
    for top, bottom in itertools.pairwise(ys.tolist()):
        for left, right in itertools.pairwise(xs.tolist()):
            part = slice(top, bottom), slice(left, right)
            corners = cv2.goodFeaturesToTrack(
                np.ascontiguousarray(grey[part]),
                -(-n_points // _N_PARTS**2),
                _QUALITY,
                _APART,
                mask=None if mask is None else np.ascontiguousarray(mask[part]),
            )
            if corners is not None:
                corner = np.array([left, top], np.float64)
                found.append(np.asarray(corners.reshape(-1, 2) + corner, np.float64))
    return np.concatenate(found)


def follow_points(
    before: ByteArray, after: ByteArray, points: FloatArray, *, halvings: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Find points (n, 2) of one image in another one, and back again.

    Parameters
    ----------
    before, after : array of uint8, (h, w)
        Grey images.
    points : array, (n, 2)
        Pixels in the first image.
    halvings : int
        How often the images are halved: a point is found over some 8 pixels at the top level.

    Returns
    -------
    points, found
        Pixels (n, 2), and which of them lead back to where they came from, (n,).
    """
    if not len(points):
        return np.zeros((0, 2)), np.zeros(0, np.bool_)
    begin = points.astype(np.float32)
    there, found = _flow(before, after, begin, begin, halvings)
    return there.astype(np.float64), found & _lead_back(
        before, after, begin, there, _THERE_AND_BACK
    )


def _lead_back(
    before: ByteArray,
    after: ByteArray,
    begin: NDArray[np.float32],
    there: NDArray[np.float32],
    within: float,
) -> NDArray[np.bool_]:
    """Which points (n, 2) of the later image lead back to where they were in the earlier one."""
    # From where it began, halved once: what is right stays there. Through all halvings the way is
    # found again, which takes three times as long and tells the same.
    back, found = _flow(after, before, there, begin, 1)
    same: NDArray[np.bool_] = found & (np.abs(back - begin).max(axis=1) < within)
    return same


def _flow(
    before: ByteArray,
    after: ByteArray,
    points: NDArray[np.float32],
    guess: NDArray[np.float32],
    halvings: int,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    there, found, _ = cv2.calcOpticalFlowPyrLK(
        before,
        after,
        points,
        guess.copy(),
        winSize=_WINDOW,
        maxLevel=halvings,
        flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
    )
    return np.asarray(there, np.float32), np.asarray(found).ravel() == 1


@dataclass
class _Points:
    frame: int
    start: FloatArray
    checked: NDArray[np.float32]
    """Where they were in the image that was checked last."""
    now: NDArray[np.float32]

    def keep(self, good: NDArray[np.bool_]) -> None:
        self.start, self.checked, self.now = self.start[good], self.checked[good], self.now[good]


class PointTracker:
    """Follows corners through the first images (Lucas and Kanade's method, in a pyramid).

    Bouguet, Pyramidal implementation of the Lucas Kanade feature tracker, 2001; Shi and Tomasi,
    Good features to track, 1994.

    Parameters
    ----------
    every : int
        Number of images after which new points are searched, and between the images of a pair.
    spans : int
        Number of these distances over which points are followed.
    n_points : int
        Points looked for.
    least : int
        Least number of points of a pair.
    """

    def __init__(
        self, *, every: int = 8, spans: int = 3, n_points: int = 200, least: int = 60
    ) -> None:
        self._every, self._spans = every, spans
        self._n_points, self._least = n_points, least
        self._previous: ByteArray | None = None
        self._checked: ByteArray | None = None
        self._sets: list[_Points] = []
        self._frame = 0

    def add(self, grey: ByteArray, mask: ByteArray | None = None) -> list[TrackedPair]:
        """Take the next image.

        Parameters
        ----------
        grey : array of uint8, (h, w)
            The image.
        mask : array of uint8, (h, w), optional
            No point begins where it is 0.

        Returns
        -------
        list of TrackedPair
            Pairs that end with this image.
        """
        if self._previous is not None and self._sets:
            self._follow(self._previous, grey)
        # Also where points begin and pairs are made.
        if self._frame % self._every % _CHECK_EVERY == 0:
            if self._checked is not None and self._sets:
                self._check(self._checked, grey)
            self._checked = grey
        pairs = list(self._pairs())
        if self._frame % self._every == 0:
            start = find_corners(grey, self._n_points, mask)
            if len(start):
                begin = start.astype(np.float32)
                self._sets.append(_Points(self._frame, start, begin, begin))
        self._previous = grey
        self._frame += 1
        return pairs

    def _follow(self, before: ByteArray, grey: ByteArray) -> None:
        now = np.concatenate([points.now for points in self._sets])
        there, found = _flow(before, grey, now, now, _HALVINGS)
        for points, part in self._parts():
            points.now = there[part]
            points.keep(found[part])
        self._drop_small_sets()

    def _check(self, before: ByteArray, grey: ByteArray) -> None:
        begin = np.concatenate([points.checked for points in self._sets])
        now = np.concatenate([points.now for points in self._sets])
        good = _lead_back(before, grey, begin, now, _BACK_OVER_SOME)
        for points, part in self._parts():
            points.keep(good[part])
            points.checked = points.now
        self._drop_small_sets()

    def _parts(self) -> list[tuple[_Points, slice]]:
        """Each set, and where its points lie among those of all."""
        ends = np.cumsum([len(points.now) for points in self._sets]).tolist()
        begins = [0, *ends[:-1]]
        return [(p, slice(a, b)) for p, a, b in zip(self._sets, begins, ends, strict=True)]

    def _drop_small_sets(self) -> None:
        self._sets = [points for points in self._sets if len(points.now) >= self._least]

    def _pairs(self) -> Iterator[TrackedPair]:
        for points in list(self._sets):
            age = self._frame - points.frame
            if age and age % self._every == 0:
                now = points.now.astype(np.float64)
                yield TrackedPair(points.start, now, (points.frame, self._frame))
            if age == self._every * self._spans:
                self._sets.remove(points)
