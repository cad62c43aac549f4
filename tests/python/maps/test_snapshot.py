# SPDX-License-Identifier: BSD-3-Clause
"""Plain copies of a running system's map."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import Sensor
from support.small_sequences import new_system, play

pytestmark = pytest.mark.watchdog(30)


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_snapshot(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 40)
        snapshot = system.map_snapshot()
        k, p = system.n_keyframes, system.n_map_points
    assert snapshot.keyframe_ids.shape == snapshot.keyframe_timestamps.shape == (k,)
    assert snapshot.keyframe_T_wc.shape == (k, 4, 4)
    assert snapshot.point_ids.shape == (p,)
    assert snapshot.point_positions.shape == (p, 3)
    assert np.all(np.diff(snapshot.keyframe_ids) > 0)
    assert np.all(np.diff(snapshot.point_ids) > 0)
    assert np.isfinite(snapshot.point_positions).all()
    keyframes = system.keyframe_trajectory()
    assert len(keyframes) == k
    np.testing.assert_allclose(keyframes.T_wc[0], np.eye(4), atol=1e-12)
    # A keyframe's pose is that of its frame.
    frames = system.trajectory()
    positions = {t: T[:3, 3] for t, T in zip(frames.timestamps, frames.T_wc, strict=True)}
    for t, T_wc in zip(keyframes.timestamps, keyframes.T_wc, strict=True):
        np.testing.assert_allclose(positions[t], T_wc[:3, 3], atol=0.02)
