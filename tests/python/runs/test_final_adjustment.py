# SPDX-License-Identifier: BSD-3-Clause
"""The finished map refined as a whole."""

from __future__ import annotations

import threading
from functools import lru_cache

import numpy as np
import pytest

from orbslam2py import DatasetError, FullAdjustmentRecord, Sensor, System
from orbslam2py.cli.display import report_table
from orbslam2py.runs import RunOptions, RunResult, SequenceRunner, SystemOptions
from orbslam2py.runs.report import adjustment_entry, make_report
from orbslam2py.runs.result import FrameRow
from support.small_sequences import sequence

pytestmark = pytest.mark.watchdog(120)
N = 25


def run(options: RunOptions, stop: threading.Event | None = None) -> RunResult:
    images = sequence(options.sensor, N)
    result = SequenceRunner(images, images.settings, None, options).run(stop=stop)
    assert result.error is None
    return result


@lru_cache
def with_and_without(*, deterministic: bool) -> tuple[RunResult, RunResult]:
    system = SystemOptions(deterministic=deterministic)
    with_it = RunOptions(Sensor.STEREO, system, max_frames=N, final_adjustment=True)
    return run(with_it), run(RunOptions(Sensor.STEREO, system, max_frames=N))


@pytest.mark.parametrize("deterministic", [False, True])
def test_it_lowers_the_cost_and_moves_the_path(deterministic: bool) -> None:
    adjusted, plain = with_and_without(deterministic=deterministic)
    record = adjusted.final_adjustment
    assert record is not None
    assert record.used
    assert record.final_cost < record.initial_cost
    assert record.n_keyframes == len(adjusted.keyframes)
    assert adjusted.full_adjustments[-1] == record
    assert plain.final_adjustment is None
    assert plain.full_adjustments == []


def test_only_the_end_differs() -> None:
    adjusted, plain = with_and_without(deterministic=True)
    online = [result.online_trajectory().T_wc for result in (adjusted, plain)]
    np.testing.assert_array_equal(*online)
    final = [result.tracked_trajectory().T_wc for result in (adjusted, plain)]
    assert not np.array_equal(*final)
    np.testing.assert_allclose(*final, atol=0.05)


def test_report_and_table_tell_it() -> None:
    adjusted, plain = with_and_without(deterministic=True)
    report = make_report(adjusted, None)
    assert adjusted.final_adjustment is not None
    assert report["final_adjustment"] == adjustment_entry(adjusted.final_adjustment)
    assert report["final_adjustment"] == report["full_adjustments"][-1]
    assert report["final_adjustment"]["milliseconds"]["solve"] > 0
    assert make_report(plain, None)["final_adjustment"] is None
    rows = dict(zip(*(column._cells for column in report_table(report).columns), strict=True))
    before, after = (report["final_adjustment"][f"{name}_cost"] for name in ("initial", "final"))
    assert str(rows["final adjustment"]).startswith(f"cost {before:.0f} to {after:.0f}, ")


def test_a_run_that_is_stopped_is_not_adjusted() -> None:
    stop = threading.Event()

    def at_frame_10(row: FrameRow, _: System) -> None:
        if row.index == 10:
            stop.set()

    images = sequence(Sensor.STEREO, N)
    options = RunOptions(Sensor.STEREO, max_frames=N, final_adjustment=True)
    result = SequenceRunner(images, images.settings, None, options).run(at_frame_10, stop)
    assert result.interrupted
    assert result.final_adjustment is None


def test_ctrl_c_gives_it_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """The event is set while it is at work: the map stays as it was, and the results are there."""
    stop = threading.Event()
    original = System.optimize

    def optimize(
        self: System, *, stop: threading.Event | None = None, map_index: int | None = None
    ) -> FullAdjustmentRecord:
        assert stop is not None
        stop.set()
        return original(self, stop=stop, map_index=map_index)

    monkeypatch.setattr(System, "optimize", optimize)
    result = run(RunOptions(Sensor.STEREO, max_frames=N, final_adjustment=True), stop)
    assert result.interrupted
    assert result.final_adjustment is not None
    assert not result.final_adjustment.used
    assert len(result.tracked_trajectory()) == N


def test_a_map_that_is_to_stay_as_it_is() -> None:
    with pytest.raises(DatasetError, match=r"--final-adjustment changes the map.*--localize"):
        RunOptions(Sensor.STEREO, localize_after=5, final_adjustment=True)


def test_without_a_map() -> None:
    result = run(RunOptions(Sensor.MONOCULAR, max_frames=1, final_adjustment=True))
    assert result.final_adjustment is None
