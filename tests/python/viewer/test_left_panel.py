# SPDX-License-Identifier: BSD-3-Clause
"""The image of the page: its keypoints, in the colours of what they are matched with."""

from __future__ import annotations

import numpy as np

from orbslam2py import FrameFeatures, Sensor, TrackingState
from orbslam2py._palette import MAPPED, STARTING, UNMATCHED, VISUAL_ODOMETRY
from orbslam2py.viewer import FrameView, QueueState
from orbslam2py.viewer.left_panel import overlaid, status_of
from support.small_sequences import new_system, track


def view(start_lines: np.ndarray | None = None) -> FrameView:
    """Three keypoints: of the map, of visual odometry, of nothing; and one at the edge."""
    with new_system(Sensor.RGBD, deterministic=True) as system:
        record = track(system, 0)
    pixels = np.array([(20, 20), (60, 20), (100, 20), (159, 119)], np.float32)
    features = FrameFeatures(
        keypoints=pixels,
        levels=np.zeros(4, np.int32),
        depths=np.full(4, -1, np.float32),
        map_point_ids=np.array([5, 7, -1, 9]),
        inliers=np.array([True, True, False, True]),
        colours=np.zeros((0, 3), np.uint8),
    )
    return FrameView(
        image=np.full((120, 160), 90, np.uint8),
        record=record,
        earlier=(),
        features=features,
        pixels=pixels,
        visual_odometry=np.array([False, True, False, False]),
        local_points=np.zeros(0, np.int64),
        start_lines=start_lines,
        localization=True,
        queue=QueueState(n_frames=1, frames_per_second=25.0),
    )


def test_keypoints_have_the_colour_of_what_they_are_matched_with() -> None:
    picture = overlaid(view())
    assert picture.shape == (480, 640, 3)
    for x, y, colour in ((20, 20, MAPPED), (60, 20, VISUAL_ODOMETRY), (100, 20, UNMATCHED)):
        around = picture[4 * y - 8 : 4 * y + 12, 4 * x - 8 : 4 * x + 12]
        assert (around == colour).all(axis=2).any(), colour
        others = {MAPPED, VISUAL_ODOMETRY, UNMATCHED} - {colour}
        assert not any((around == other).all(axis=2).any() for other in others)
    assert (picture[-8:, -8:] == MAPPED).all(axis=2).any()  # cut at the edge


def test_while_a_single_camera_starts_its_lines_are_drawn() -> None:
    picture = overlaid(view(np.array([[20.0, 80.0, 120.0, 80.0]])))
    off = np.abs(picture[321:323, 100:460].astype(int) - STARTING).max(axis=2)
    assert (off.min(axis=0) < 80).all()  # smoothed over two rows


def test_the_status_counts_what_is_seen() -> None:
    status = status_of(view(), n_keyframes=3, n_points=100, n_dropped=2)
    assert status.state is TrackingState.OK
    assert (status.n_matches, status.n_visual_odometry) == (2, 1)
    assert str(status).startswith("LOCALIZATION")
    assert "25 frames/s" in str(status)
    assert "2 dropped" in str(status)
