# SPDX-License-Identifier: BSD-3-Clause
"""A single camera's first map that comes to nothing is a reason, and no reset."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from orbslam2py import Reason, Sensor, TrackingRecord, TrackingState, _core
from support.small_sequences import new_system, track

pytestmark = pytest.mark.watchdog(30)


def test_failed_starts_are_not_counted_as_resets(monkeypatch: pytest.MonkeyPatch) -> None:
    original, left = _core.create_monocular_map, 1

    def create(*arguments: Any) -> Any:
        nonlocal left
        left -= 1
        return SimpleNamespace(ok=False) if left >= 0 else original(*arguments)

    monkeypatch.setattr(_core, "create_monocular_map", create)
    with new_system(Sensor.MONOCULAR, deterministic=True) as system:
        records: list[TrackingRecord] = []
        index = 0
        for i in range(20):
            records.append(track(system, index, timestamp=i / 20))
            # After the failure from the beginning again.
            index = 0 if records[-1].reason is Reason.INITIAL_MAP_FAILED else index + 1
        assert [r.reason for r in records].count(Reason.INITIAL_MAP_FAILED) == 1
        assert records[-1].state is TrackingState.OK
        assert system.n_resets == 0
        assert [len(t) > 0 for t in system.trajectories()] == [False, True]
        assert records[-1].map_index == 1
        system.reset()
        track(system, 20)
        assert system.n_resets == 1
