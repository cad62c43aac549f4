# SPDX-License-Identifier: BSD-3-Clause
"""Whole sequences with loops: closed where there is one, refused where places only look alike."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
import pytest

from orbslam2py import (
    Callbacks,
    FullAdjustmentRecord,
    LoopClosed,
    MapChanged,
    Sensor,
    System,
    Trajectory,
)
from orbslam2py.datasets import Images
from orbslam2py.evaluation import lap_error, scale_drift
from orbslam2py.slam import pending_loop
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support.feeding import feed

pytestmark = pytest.mark.watchdog(300)

#: Far enough behind the start to see it again.
LAPS = 1.2


@lru_cache
def sequence(world: str, sensor: Sensor, laps: float | None = LAPS) -> SyntheticSequence:
    """Few pixels and noise, so that a lap ends beside its start."""
    monocular = sensor is Sensor.MONOCULAR
    return SyntheticSequence(
        SyntheticOptions(
            world=world,
            sensor=sensor,
            laps=laps,
            seed=1,
            fps=12.0 if monocular else 10.0,
            speed=0.7 if laps is None else 0.8 if monocular else 1.0,
            size=(400, 300) if monocular else (360, 270),
            noise=8.0 if monocular else 12.0,
            depth_noise=0.03 if sensor is Sensor.RGBD else 0.0,
        )
    )


@lru_cache(maxsize=1000)
def images(world: str, sensor: Sensor, laps: float | None, index: int) -> Images:
    return sequence(world, sensor, laps).load(index)


@dataclass
class Run:
    """What a run left behind."""

    trajectory: Trajectory
    map_hash: int
    loops: list[LoopClosed]
    adjustments: list[FullAdjustmentRecord]
    loop_edges: list[list[int]]
    changes: list[MapChanged] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    """Violated invariants after any change of the map as a whole."""


def run(world: str, sensor: Sensor, laps: float | None = LAPS, **options: object) -> Run:
    made = sequence(world, sensor, laps)
    settings = made.settings
    n_features = 1000 if sensor is Sensor.MONOCULAR else 600
    settings = replace(settings, orb=replace(settings.orb, n_features=n_features))
    changes: list[MapChanged] = []
    problems: list[str] = []

    def check(change: MapChanged) -> None:
        changes.append(change)
        problems.extend(f"after {change.cause}: {p}" for p in system.check_map())

    system = System(
        settings,
        sensor,
        callbacks=Callbacks(on_map_change=check),
        wait_for_mapping=not options.get("deterministic", False),
        **options,  # type: ignore[arg-type]
    )
    with system:
        for index, timestamp in enumerate(made.timestamps):
            feed(system, images(world, sensor, laps, index), float(timestamp))
        system.wait_until_idle()
    problems += system.check_map()
    return Run(
        trajectory=system.trajectory(),
        map_hash=system.map_hash(),
        loops=system.loops,
        adjustments=system.full_adjustments,
        loop_edges=system.map_snapshot().loop_edges.tolist(),
        changes=changes,
        problems=problems,
    )


@lru_cache
def corridor(sensor: Sensor, *, loop_closing: bool = True) -> Run:
    """With threads for stereo pairs: both ways are tried, each with a sensor."""
    deterministic = sensor is not Sensor.STEREO
    return run("corridor", sensor, deterministic=deterministic, loop_closing=loop_closing)


def end_error(made: SyntheticSequence, trajectory: Trajectory) -> float:
    """Error of the motion from the start of the lap to its end, in percent of its length."""
    monocular = made.sensor is Sensor.MONOCULAR
    error = lap_error(trajectory, made.ground_truth(), made.lap_length, with_scale=monocular)
    return error.percent


@pytest.mark.parametrize("sensor", [Sensor.STEREO, Sensor.RGBD])
def test_the_end_of_a_lap_meets_its_start(sensor: Sensor) -> None:
    made = sequence("corridor", sensor)
    with_loops = corridor(sensor)
    without = corridor(sensor, loop_closing=False)
    assert without.loops == []
    assert end_error(made, without.trajectory) > 0.1, "there is a drift to take out"
    assert len(with_loops.loops) == 1
    assert end_error(made, with_loops.trajectory) < 0.3
    (loop,) = with_loops.loops
    assert loop.scale == 1.0
    assert loop.translation > 0.05
    assert with_loops.loop_edges == [[loop.matched_keyframe, loop.current_keyframe]]
    assert [a.used for a in with_loops.adjustments] == [True]
    assert [str(change.cause) for change in with_loops.changes] == ["loop", "full adjustment"]
    assert with_loops.problems == []


def test_the_scale_of_a_single_camera_does_not_drift_over_a_lap() -> None:
    made = sequence("corridor", Sensor.MONOCULAR)
    with_loops = corridor(Sensor.MONOCULAR)
    assert len(with_loops.loops) == 1
    assert with_loops.loops[0].scale != 1.0
    drift = scale_drift(with_loops.trajectory, made.ground_truth(), made.lap_length)
    assert abs(drift) < 0.015  # seeds differ by as much
    assert end_error(made, with_loops.trajectory) < 0.3
    assert with_loops.problems == []


def test_loops_are_the_same_bytes_in_every_run() -> None:
    first = corridor(Sensor.RGBD)
    second = run("corridor", Sensor.RGBD, deterministic=True)
    assert second.map_hash == first.map_hash
    np.testing.assert_array_equal(second.trajectory.T_wc, first.trajectory.T_wc)
    assert [(a.iterations, a.final_cost) for a in second.adjustments] == [
        (a.iterations, a.final_cost) for a in first.adjustments
    ]


def test_without_full_adjustment_the_loop_alone_is_corrected() -> None:
    made = sequence("corridor", Sensor.STEREO)
    result = run("corridor", Sensor.STEREO, deterministic=True, full_adjustment=False)
    assert len(result.loops) == 1
    assert result.adjustments == []
    assert end_error(made, result.trajectory) < 0.3
    assert result.problems == []


def test_walls_that_repeat_their_pictures_close_true_loops_only() -> None:
    made = sequence("repeating-corridor", Sensor.STEREO)
    result = run("repeating-corridor", Sensor.STEREO, deterministic=True)
    (loop,) = result.loops
    assert loop.translation < 1.0, "a false one would be off by four metres or more"
    assert end_error(made, result.trajectory) < 0.3
    assert result.problems == []


def test_a_loop_that_still_waits_is_closed_when_all_is_waited_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pending_loop, "_PATIENCE", 10**6)
    never = {"loops.firm_matches": 10**6}
    made = sequence("corridor", Sensor.RGBD)
    settings = replace(made.settings, orb=replace(made.settings.orb, n_features=600))
    with System(settings, Sensor.RGBD, deterministic=True, config=never) as system:
        for index, timestamp in enumerate(made.timestamps):
            feed(system, images("corridor", Sensor.RGBD, LAPS, index), float(timestamp))
        assert system.loops == []
        system.localization_mode = True
        assert system.wait_until_idle()
        assert system.loops == [], "the map stays as it is in localization mode"
        system.localization_mode = False
        assert system.wait_until_idle()
        assert len(system.loops) == 1
        assert [record.used for record in system.full_adjustments] == [True]
        assert system.check_map() == []
    assert len(system.loops) == 1


def test_two_rooms_that_look_alike_are_not_one() -> None:
    result = run("two-rooms", Sensor.RGBD, laps=None, deterministic=True)
    assert result.loops == []
    assert result.problems == []


def test_optimize_on_demand_lowers_the_cost() -> None:
    made = sequence("corridor", Sensor.RGBD)
    settings = replace(made.settings, orb=replace(made.settings.orb, n_features=600))
    with System(settings, Sensor.RGBD, loop_closing=False, wait_for_mapping=True) as system:
        for index in range(120):
            shown = images("corridor", Sensor.RGBD, LAPS, index)
            feed(system, shown, float(made.timestamps[index]))
        system.wait_until_idle()
        record = system.optimize()
        assert record.used
        assert record.final_cost < record.initial_cost
        assert record.n_keyframes == system.n_keyframes
        assert system.check_map() == []
    before = system.map_hash()
    again = system.optimize()  # also after the end
    assert again.final_cost <= record.final_cost * 1.001
    assert system.full_adjustments == [record, again]
    assert (system.map_hash() != before) == again.used
