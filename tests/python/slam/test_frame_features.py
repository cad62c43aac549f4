# SPDX-License-Identifier: BSD-3-Clause
"""What a record says about the keypoints of its frame, on request."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import Sensor, TrackingRecord
from orbslam2py.settings.sensor import WITHOUT_RIG
from support.small_sequences import new_system, track

pytestmark = pytest.mark.watchdog(30)


@pytest.mark.parametrize("sensor", WITHOUT_RIG)
def test_inliers_are_those_of_the_pose(sensor: Sensor) -> None:
    """Neither the points that a keyframe makes nor temporary ones change what was accepted."""
    records: list[TrackingRecord] = []
    with new_system(sensor, deterministic=True) as system:
        for i in range(26):
            system.localization_mode = i >= 18
            records.append(track(system, i, details=True))
    assert any(record.is_keyframe for record in records[1:])
    for record in records:
        features = record.features
        assert features is not None
        assert int(np.count_nonzero(features.inliers)) == record.n_inliers, record.frame_id
        assert len(features.inliers) == len(features.keypoints)
