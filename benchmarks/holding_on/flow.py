# SPDX-License-Identifier: BSD-3-Clause
"""How far views of a recorded sequence are apart, by optical flow: nothing of this package."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.holding_on.scene import OVERLAP, Floats, median_angle
from orbslam2py.settings import CameraSettings

_CORNERS = 400
_FEWEST = 30
_ASTRAY = 1.0  # pixels, there and back again
_OFF_LINE = 1.0  # pixels from the epipolar line
_Grey = NDArray[np.uint8]
_Pixels = NDArray[np.float32]


class FlowParallax:
    """Corners of an image are followed through all images up to another one.

    The rotation between the two is that of their essential matrix.

    Parameters
    ----------
    image
        Gives the grey image of a place in the sequence.
    camera
        Of the images.
    """

    def __init__(self, image: Callable[[int], _Grey], camera: CameraSettings) -> None:
        self._image = image
        self._camera = camera
        self._followed: dict[int, _Corners] = {}

    def between(self, first: int, second: int) -> float:
        """Median angle [rad] at which both see common points; 0 if too few are seen by both."""
        corners = self._followed.get(first)
        if corners is None or not corners.lies_before(second):
            corners = self._followed[first] = _Corners(first, self._image)
        corners.follow_to(second)
        before, now = corners.pairs()
        if len(now) < max(_FEWEST, OVERLAP * corners.n):
            return 0.0
        camera = self._camera
        rays = [
            cv2.undistortPoints(pixels, camera.matrix, camera.distortion)[:, 0]
            for pixels in (before, now)
        ]
        limit = _OFF_LINE / camera.fx
        E, inliers = cv2.findEssentialMat(*rays, np.eye(3), cv2.RANSAC, 0.999, limit)
        if E is None or E.shape != (3, 3):
            return 0.0
        # However far they are.
        n, R, _, inliers, _ = cv2.recoverPose(E, *rays, np.eye(3), distanceThresh=1e6, mask=inliers)
        if n < _FEWEST:
            return 0.0
        seen = inliers.ravel() > 0
        first_rays, second_rays = (cv2.convertPointsToHomogeneous(r[seen])[:, 0] for r in rays)
        turned: Floats = first_rays.astype(np.float64) @ R.T
        return median_angle(turned, second_rays.astype(np.float64))


class _Corners:
    """Corners of one image, and where they are in another."""

    def __init__(self, first: int, image: Callable[[int], _Grey]) -> None:
        self._image = image
        self._first = self._at = first
        grey = image(first)
        found = cv2.goodFeaturesToTrack(grey, _CORNERS, 0.01, grey.shape[1] / 80)
        self._begin: _Pixels = np.zeros((0, 1, 2), np.float32) if found is None else found
        self._now = self._begin
        self.n = len(self._begin)

    def lies_before(self, place: int) -> bool:
        """Whether they can be followed on to this place."""
        return abs(place - self._first) >= abs(self._at - self._first)

    def pairs(self) -> tuple[_Pixels, _Pixels]:
        """Pixels (m, 1, 2) in the first image and in the present one."""
        return self._begin, self._now

    def follow_to(self, place: int) -> None:
        """Let go of those that are lost on the way."""
        while self._at != place and len(self._now) > 0:
            following = self._at + (1 if place > self._at else -1)
            images = self._image(self._at), self._image(following)
            there, seen, _ = cv2.calcOpticalFlowPyrLK(*images, self._now, None)  # type: ignore[call-overload]
            back, back_seen, _ = cv2.calcOpticalFlowPyrLK(*images[::-1], there, None)  # type: ignore[call-overload]
            astray = np.linalg.norm(back - self._now, axis=2).ravel()
            kept = (seen.ravel() > 0) & (back_seen.ravel() > 0) & (astray < _ASTRAY)
            self._begin, self._now, self._at = self._begin[kept], there[kept], following
