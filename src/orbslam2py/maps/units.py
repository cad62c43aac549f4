# SPDX-License-Identifier: BSD-3-Clause
"""The unit of length of a map."""

from __future__ import annotations

import numpy as np

from orbslam2py.maps.contents import MapContents


def sees_metres(contents: MapContents) -> bool:
    """Return whether the camera measures metres: a stereo pair, or depth images."""
    return bool((contents.cameras.bf > 0).any())


def unit_of(contents: MapContents, root: int | None = None) -> str:
    """Return the unit of length.

    Parameters
    ----------
    contents
        The map or maps.
    root
        First keyframe of the map; all maps by default.

    Returns
    -------
    str
        ``m``, or ``units`` for a single camera's map whose unit was not set to metres.
    """
    if sees_metres(contents):
        return "m"
    keyframes = contents.keyframes
    roots = keyframes.ids[keyframes.parent < 0] if root is None else np.array([root])
    metric = np.isin(roots, np.array(contents.metric_roots, np.int64))
    return "m" if len(roots) and metric.all() else "units"
