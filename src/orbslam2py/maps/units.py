# SPDX-License-Identifier: BSD-3-Clause
"""What the lengths of a map are in."""

from __future__ import annotations

import numpy as np

from orbslam2py.maps.contents import MapContents


def sees_metres(contents: MapContents) -> bool:
    """Whether the camera itself tells metres: a stereo pair, or depth images."""
    return bool((contents.cameras.bf > 0).any())


def unit_of(contents: MapContents, root: int | None = None) -> str:
    """Tell the unit of lengths.

    Parameters
    ----------
    contents
        The map or maps.
    root
        First keyframe of the one that is asked about; all of them by default.

    Returns
    -------
    str
        ``m``, or ``units`` for the map of a single camera, whose unit is its own unless it was
        given metres.
    """
    if sees_metres(contents):
        return "m"
    keyframes = contents.keyframes
    roots = keyframes.ids[keyframes.parent < 0] if root is None else np.array([root])
    metric = np.isin(roots, np.array(contents.metric_roots, np.int64))
    return "m" if len(roots) and metric.all() else "units"
