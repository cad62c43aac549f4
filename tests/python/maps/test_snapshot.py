# SPDX-License-Identifier: BSD-3-Clause
"""Plain copies of a running system's map."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import MapSnapshot, Sensor
from orbslam2py.maps import snapshot as snapshots
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


def made_up() -> MapSnapshot:
    return MapSnapshot(
        keyframe_ids=np.array([0, 2]),
        keyframe_timestamps=np.array([0.5, 1.5]),
        keyframe_T_wc=np.stack([np.eye(4)] * 2),
        point_ids=np.arange(3),
        point_positions=np.ones((3, 3)),
        loop_edges=np.array([[0, 2]]),
    )


def test_snapshots_are_compared_by_what_is_in_them() -> None:
    snapshot = made_up()
    assert snapshot == made_up()
    assert snapshot != "a map"
    for field in (field for field in dataclasses.fields(MapSnapshot) if field.compare):
        values = getattr(snapshot, field.name).copy()
        values[(0,) * values.ndim] += 1
        other = dataclasses.replace(snapshot, **{field.name: values})
        assert snapshot != other, field.name
        assert snapshot != dataclasses.replace(snapshot, **{field.name: values[:1]}), field.name
    assert snapshot == dataclasses.replace(snapshot, map_index=3), "the same map, of another run"


def test_equal_runs_give_equal_snapshots() -> None:
    snapshots = []
    for n_frames in (12, 12, 25):
        with new_system(Sensor.RGBD, deterministic=True) as system:
            play(system, n_frames)
            snapshots.append(system.map_snapshot())
    assert snapshots[0] == snapshots[1]
    assert snapshots[0] != snapshots[2]


def test_a_snapshot_is_printed_in_one_line() -> None:
    assert repr(made_up()) == "<MapSnapshot: keyframes 2, points 3, loop edges 1>"


def test_keyframes_are_told_in_the_order_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those between the two that begin a single camera's map have later ids than these."""
    T_wc = np.stack([np.eye(4)] * 3)
    T_wc[:, 0, 3] = [1, 3, 2]
    keyframes = SimpleNamespace(timestamps=np.array([0.5, 1.5, 1.0]), T_wc=T_wc)
    monkeypatch.setattr(snapshots.core, "snapshot_keyframes", lambda *_: keyframes)
    nothing: Any = SimpleNamespace(active_map=0, is_upright=lambda _: False)
    path = snapshots.keyframe_trajectory(nothing)
    np.testing.assert_array_equal(path.timestamps, [0.5, 1.0, 1.5])
    np.testing.assert_array_equal(path.T_wc[:, 0, 3], [0, 1, 2])
