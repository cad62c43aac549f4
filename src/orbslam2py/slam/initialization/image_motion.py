# SPDX-License-Identifier: BSD-3-Clause
"""Motion of an image from one frame to the next, as a smooth function of the position in it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import FloatArray

Pixels = npt.NDArray[np.float32]

_ROUNDS = 5
_FEWEST = 12  # matches that the six coefficients are fitted to
_LEAST_SPREAD = 1.0  # pixels: rounder than that no keypoint is


class ImageMotion:
    """Displacements that are a quadratic function of the position: rotation, approach, slope.

    Parameters
    ----------
    centre, extent
        Of the image, (2,) pixels: positions are relative to the centre, in units of the extent.
    """

    def __init__(self, centre: FloatArray, extent: FloatArray) -> None:
        self._centre, self._extent = centre, extent
        self._coefficients = np.zeros((6, 2))
        #: Typical distance of a match from the function [pixels]; None before there was a fit.
        self.spread: float | None = None

    @property
    def frame(self) -> tuple[FloatArray, FloatArray]:
        """Centre and extent, for another motion of the same image."""
        return self._centre, self._extent

    def at(self, places: Pixels) -> Pixels:
        """Return displacements (n, 2) of positions (n, 2), pixels."""
        return np.asarray(self._basis(places) @ self._coefficients, np.float32)

    def fit(self, places: Pixels, displacements: Pixels) -> None:
        """Fit the function to matches, (n, 2) and (n, 2) pixels, most of which are correct.

        Iterated weighted least squares with Cauchy's weights, begun at the median (Hartley and
        Zisserman, appendix 6.8). With too few matches the function is unchanged.
        """
        if len(places) < _FEWEST:
            return
        basis = self._basis(places)
        coefficients = np.zeros((6, 2))
        coefficients[0] = np.median(displacements, axis=0)
        distance = np.linalg.norm(displacements - basis @ coefficients, axis=1)
        for _ in range(_ROUNDS):
            spread = max(_LEAST_SPREAD, float(np.median(distance)))
            weights = 1 / (1 + (distance / (1.5 * spread)) ** 2)
            weighted = basis * weights[:, None]
            # A little is added to the diagonal: matches in one corner do not fix all six.
            normal = weighted.T @ basis + 1e-3 * weights.sum() * np.eye(6)
            normal[0, 0] -= 1e-3 * weights.sum()
            coefficients = np.linalg.solve(normal, weighted.T @ displacements)
            distance = np.linalg.norm(displacements - basis @ coefficients, axis=1)
        self._coefficients = coefficients
        self.spread = max(_LEAST_SPREAD, float(np.median(distance)))

    def _basis(self, places: Pixels) -> FloatArray:
        x, y = ((places - self._centre) / self._extent).T
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1).astype(np.float64)
