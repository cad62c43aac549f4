# SPDX-License-Identifier: BSD-3-Clause
"""Blurred frames, told by the frames before them; ``docs/method/relocalization.md#blurred-frames``.

How much fine detail an image has depends on the scene more than on anything else, so a frame is
compared with the ones right before it, and with nothing that was decided beforehand.
"""

from __future__ import annotations

import statistics
from collections import deque

from orbslam2py import _core as core
from orbslam2py.slam.config import BlurConfig


class BlurWatch:
    """Tells frames that have lost the fine detail that those before them had, more than the coarse.

    Parameters
    ----------
    n_features : int
        How many keypoints a frame usually has; one that was extracted with more is not sharper.
    config : BlurConfig
        Limits.
    """

    def __init__(self, n_features: int, config: BlurConfig) -> None:
        self._n_features = n_features
        self._limits = config
        # Sharpness and fine detail.
        self._recent: deque[tuple[float, float]] = deque(maxlen=self._limits.frames)

    def reset(self) -> None:
        """Forget the frames before, of another camera."""
        self._recent.clear()

    def is_blurred(self, frame: core.Frame) -> bool:
        """Judge the next frame; every frame is to be shown once.

        A frame that is judged blurred counts among those before the next ones all the same: what
        lasts, as a wall without texture does, is what is usual there after half of the frames that
        are remembered. A frame without keypoints says nothing.

        Parameters
        ----------
        frame : orbslam2py._core.Frame
            With its keypoints.
        """
        sharpness = core.sharpness(frame, self._n_features)
        if sharpness <= 0:
            return False
        detail = core.fine_detail(frame)
        recent = list(self._recent)
        self._recent.append((sharpness, detail))
        limits = self._limits
        if len(recent) < limits.fewest:
            return False
        usual_sharpness = statistics.median(known for known, _ in recent)
        if sharpness >= limits.share * usual_sharpness:
            return False
        # In a dark image all corners are weak, the coarse ones as much as the fine ones. Without
        # coarse levels nothing is known of that.
        usual_detail = statistics.median(known for _, known in recent)
        return usual_detail <= 0 or detail < limits.detail_share * usual_detail
