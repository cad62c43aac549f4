# SPDX-License-Identifier: BSD-3-Clause
"""Check that the two images of the first stereo pairs differ.

One image given twice looks infinitely far away, and the map would be wrong.
"""

from __future__ import annotations

import logging

from orbslam2py._arrays import ByteArray

_log = logging.getLogger(__name__)

#: Number of pairs that are checked, not counting those without texture: a camera may begin dark.
N_CHECKED, N_LOOKED_AT = 3, 100
_TEXT = (
    "the left and the right image of a pair are the same one, which shows no depth: give the "
    "images of both cameras, the left one first"
)


class PairCheck:
    """Warns once if both images of a pair are the same.

    Attributes
    ----------
    warning : str or None
        The warning that was logged.
    """

    def __init__(self) -> None:
        self._left = N_CHECKED
        self._chances = N_LOOKED_AT
        self.warning: str | None = None

    @property
    def done(self) -> bool:
        """Whether the check is finished."""
        return self._left == 0 or self._chances == 0

    def look(self, left: ByteArray, right: ByteArray) -> None:
        """Check a pair of equal shape; a pair without texture does not count."""
        if self.done:
            return
        self._chances -= 1
        if left.min() == left.max():
            return
        self._left -= 1
        if (left != right).any():
            return
        self._left = 0
        self.warning = _TEXT
        _log.warning("%s", _TEXT)
