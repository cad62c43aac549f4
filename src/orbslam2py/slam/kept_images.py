# SPDX-License-Identifier: BSD-3-Clause
"""Which frames keep their images for alignment; ``docs/method/alignment.md#images``."""

from __future__ import annotations

from collections import deque

from orbslam2py import _core as core

#: The newest keyframes keep their images: new points are aligned in these.
_KEYFRAMES = 10
#: Frames before a map begins: some of them may become keyframes.
_WAITING = 30
#: Frames that are aligned again when they are matched with the settled map once more.
_MATCHED_AGAIN = 100


class KeptImages:
    """Releases the images of all frames but the newest keyframes.

    An image pyramid takes three times the memory of its image.

    Parameters
    ----------
    every_frame : bool
        Every frame is matched with the map again later, and keeps its images until then.
    """

    def __init__(self, *, every_frame: bool = False) -> None:
        # Frames that are matched again are aligned again.
        self._most_waiting = _MATCHED_AGAIN if every_frame else _WAITING
        self._every_frame = every_frame
        self._keyframes: deque[core.Frame] = deque()
        self._waiting: deque[core.Frame] = deque()

    def note(self, frame: core.Frame, *, is_keyframe: bool, waiting: bool) -> None:
        """Add a tracked frame, and release images that are no longer needed.

        Parameters
        ----------
        frame : Frame
            The frame.
        is_keyframe : bool
            It has become a keyframe.
        waiting : bool
            No map has begun, or the frame may become a keyframe later.
        """
        if is_keyframe:
            self._keyframes.append(frame)
            if len(self._keyframes) > _KEYFRAMES:
                core.release_images(self._keyframes.popleft())
                if not self._every_frame:
                    # The frames that began the map are older than this one.
                    self._release_waiting(0)
        elif waiting or self._every_frame:
            self._waiting.append(frame)
            self._release_waiting(self._most_waiting)
        else:
            core.release_images(frame)

    def _release_waiting(self, n_kept: int) -> None:
        while len(self._waiting) > n_kept:
            core.release_images(self._waiting.popleft())
