# SPDX-License-Identifier: BSD-3-Clause
"""Whether the first depth images fit the factor of the settings.

Later results do not show a wrong factor: the map is consistent, but of another size.
"""

from __future__ import annotations

import logging
import math

import numpy as np
import numpy.typing as npt

_log = logging.getLogger(__name__)

#: Images with depth that are checked, and images that are read at most: the first may have none.
N_CHECKED, N_LOOKED_AT = 5, 100
#: Step between the pixels that count. No divisor of a usual width, so that all columns take part.
_STEP = 7
#: Medians of depth images that a camera for which RGB-D is meant may have [m].
_LEAST, _MOST = 0.05, 200.0
#: Factors in use, the commonest first: millimetres, TUM, metres, centimetres, 0.1 mm.
_USUAL = (1000.0, 5000.0, 1.0, 100.0, 10_000.0)
_TUM_FACTOR, _MILLIMETRES = 5000.0, 1000.0
#: Numbers beyond say nothing that these do not.
_SENSIBLE = (1e-100, 1e100)
#: Nearer than this the factor of TUM is doubted in other data [m].
_NEAR = 0.5
#: Where the median of a depth image usually lies [m].
_LIKELY = (0.3, 8.0)
#: The warning.
_TEXT = (
    "depth images do not fit DepthMapFactor %g: their median is %.4g m; "
    "DepthMapFactor: %g would make it %.4g m"
)


class DepthCheck:
    """Warns once if the median of a depth image cannot be right.

    Parameters
    ----------
    factor
        Raw units per metre in the settings.

    Attributes
    ----------
    warning : str or None
        The warning that was logged.
    """

    def __init__(self, factor: float) -> None:
        self._factor = factor
        self._left = N_CHECKED
        self._chances = N_LOOKED_AT
        self.warning: str | None = None
        self._medians: list[float] = []

    @property
    def done(self) -> bool:
        """Whether the check is finished."""
        return self._left == 0 or self._chances == 0

    @property
    def median(self) -> float | None:
        """Median of the medians of the examined images [m]; None if none had depth."""
        return float(np.median(self._medians)) / self._factor if self._medians else None

    def look(self, depth: npt.NDArray[np.generic]) -> None:
        """Check a raw depth image (height, width); one without depth does not count."""
        if self.done:
            return
        self._chances -= 1
        median = _median_of_known(depth.reshape(-1)[::_STEP])
        if median is None:
            return
        self._medians.append(median)
        self._left -= 1
        if _LEAST <= median / self._factor <= _MOST:
            return
        self._left = 0
        better = _fitting_factor(median)
        values = (self._factor, median / self._factor, better, median / better)
        self.warning = _TEXT % values
        _log.warning(_TEXT, *values)


def doubt_of_tum_factor(factor: float, median: float | None) -> str | None:
    """Return a warning that the factor of TUM RGB-D is probably wrong for data of another layout.

    Parameters
    ----------
    factor
        Raw units per metre in the settings.
    median
        Median of the depth by this factor [m]; None if there was no depth.

    Returns
    -------
    str or None
        None if there is no doubt.
    """
    if factor != _TUM_FACTOR or median is None or median >= _NEAR:
        return None
    return (
        f"depth has a median of only {median:.2f} m with DepthMapFactor {factor:g}, which is that "
        f"of TUM RGB-D; if depth is in millimetres, DepthMapFactor: {_MILLIMETRES:g} makes it "
        f"{median * factor / _MILLIMETRES:.2f} m"
    )


def is_known(depth: npt.NDArray[np.generic]) -> npt.NDArray[np.bool_]:
    """Return whether raw depths are positive and finite; the largest integer means unknown, too."""
    known: npt.NDArray[np.bool_] = np.isfinite(depth) & (depth > 0)  # type: ignore[operator]
    if depth.dtype.kind in "ui":
        known &= depth != np.iinfo(depth.dtype).max  # type: ignore[type-var]
    return known


def _median_of_known(depth: npt.NDArray[np.generic]) -> float | None:
    """Median of the known depths [raw]."""
    known = depth[is_known(depth)]
    # Halfway between the largest floats, and the power of ten below the smallest, are none.
    return float(np.median(np.clip(known, *_SENSIBLE, dtype=np.float64))) if len(known) else None


def _fitting_factor(median: float) -> float:
    """Return the most common factor with a likely depth; else a power of ten."""
    for factor in _USUAL:
        if _LIKELY[0] <= median / factor <= _LIKELY[1]:
            return factor
    return float(10.0 ** math.floor(math.log10(median)))
