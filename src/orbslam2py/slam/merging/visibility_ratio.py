# SPDX-License-Identifier: BSD-3-Clause
"""How much of what a keyframe should see in another map it does see.

``docs/method/several_maps.md``, "Choice".
"""

from __future__ import annotations

import numpy as np

from orbslam2py import _core as core


def explained_share(slam_map: core.Map, loop: core.Loop, view_cosine: float) -> float:
    """The share of points that a keyframe should see at a place in another map, and sees.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The maps.
    loop : Loop
        The place, with the points around it and how many of them the keyframe shows.
    view_cosine : float
        Points are counted that are seen from nearly where they were seen before: cosine of the
        angle between both directions, at least.

    Returns
    -------
    float
        Matches over points that are in the image of the keyframe, within the distances at which
        they can be recognised, and seen from the right side; 0 if there are none.
    """
    try:
        features = slam_map.keyframe_frame(loop.current)
    except KeyError:  # local mapping has just culled it
        return 0.0
    S_cw = np.asarray(loop.S_cw)
    scale = np.cbrt(np.linalg.det(S_cw[:3, :3]))
    # The keyframe's camera in the other map's world and scale.
    T_cw = np.eye(4)
    T_cw[:3] = S_cw[:3] / scale
    camera = core.TrackedFrame(features)
    camera.T_cw = core.Pose.from_matrix(T_cw)
    points = core.gather_points(slam_map, np.unique(loop.loop_points))
    _, cosines, _, visible = core.project_into(camera, points)
    center = -T_cw[:3, :3].T @ T_cw[:3, 3]
    distances = np.linalg.norm(points.positions - center, axis=1)
    near_enough = (distances >= points.min_distances) & (distances <= points.max_distances)
    n_visible = np.count_nonzero(visible & near_enough & (cosines >= view_cosine))
    return loop.n_matches / n_visible if n_visible else 0.0
