# SPDX-License-Identifier: BSD-3-Clause
"""Maps that show the same place; ``docs/method/several_maps.md``."""

from orbslam2py.slam.merging.map_merging import MapMerging

__all__ = ["MapMerging"]
