# SPDX-License-Identifier: BSD-3-Clause
"""Full bundle adjustment of a map without a running system."""

from __future__ import annotations

from dataclasses import replace

from orbslam2py._worker import Worker
from orbslam2py.maps.contents import MapContents, restore_contents, take_contents
from orbslam2py.maps.units import unit_of
from orbslam2py.slam.full_bundle_adjustment import FullAdjustmentRecord, FullBundleAdjustment


def optimize_map(
    contents: MapContents, *, time_limit: float | None = None
) -> tuple[MapContents, FullAdjustmentRecord]:
    """Refine all keyframes and points of a map together, as `System.optimize` does.

    Keyframe 0 stays where it is. Without a time limit the same map gives the same bytes.

    Parameters
    ----------
    contents
        The map, as from `load_map`.
    time_limit
        Seconds after which it ends; what was reached by then is used.

    Returns
    -------
    contents
        The refined map.
    record
        Size, cost before and after.

    Raises
    ------
    MapFileError
        If the contents are impossible.
    """
    slam_map = restore_contents(contents)
    nobody: Worker[int] = Worker("local mapping", lambda _: None, threaded=False)
    adjustment = FullBundleAdjustment(
        slam_map,
        nobody,
        time_limit=time_limit,
        monocular=unit_of(contents) != "m",
        threaded=False,
        on_done=lambda _: None,
    )
    record = adjustment.run()
    return replace(take_contents(slam_map), map_index=contents.map_index), record
