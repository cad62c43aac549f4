# SPDX-License-Identifier: BSD-3-Clause
"""What the lengths of a map are in."""

from __future__ import annotations

from orbslam2py.maps.contents import MapContents


def unit_of(contents: MapContents) -> str:
    """Return ``m``, or ``units`` for the map of a single camera, whose unit is its own."""
    return "m" if (contents.cameras.bf > 0).any() else "units"
