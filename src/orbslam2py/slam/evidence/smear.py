# SPDX-License-Identifier: BSD-3-Clause
"""How far images are smeared by motion; ``docs/method/tracking.md#evidence``."""

from __future__ import annotations

from orbslam2py import _core as core
from orbslam2py.slam.config import AcceptanceConfig


class Smear:
    """Measures motion blur by the fine detail that the camera's sharpest images had.

    Parameters
    ----------
    focal_length : float
        Pixels.
    config : AcceptanceConfig
        Limits.
    """

    def __init__(self, focal_length: float, config: AcceptanceConfig) -> None:
        self._limits = config
        self._longest = self._limits.long_smear * focal_length
        self.reset()

    def reset(self) -> None:
        """No image is known."""
        self._finest = 0.0

    @property
    def knows_images(self) -> bool:
        """Whether there is anything to compare an image with."""
        return self._finest > 0

    def length(self, frame: core.Frame) -> float:
        """How far the image of a frame is smeared [px]; 0 while no image is known.

        Parameters
        ----------
        frame : orbslam2py._core.Frame
            With its keypoints.
        """
        detail = core.fine_detail(frame)
        if detail <= 0 or self._finest <= detail:
            return 0.0
        return self._limits.smear * ((self._finest / detail) ** 2 - 1)

    def is_long(self, length: float) -> bool:
        """Whether an image smeared so far [px] would bend a map that is not firm."""
        return length > self._longest

    def see(self, frame: core.Frame) -> None:
        """Let the next frame be one of those that others are compared with."""
        self._finest = max(core.fine_detail(frame), self._limits.fading * self._finest)
