# SPDX-License-Identifier: BSD-3-Clause
"""Which frames a run takes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError, OrbSlamError, Sensor
from orbslam2py.runs import RunOptions, SystemOptions

pytestmark = pytest.mark.watchdog(20)


@pytest.mark.parametrize(
    ("options", "indices"),
    [
        ({}, [0, 1, 2, 3, 4]),
        ({"start": 4}, [4]),
        ({"stride": 2}, [0, 2, 4]),
        ({"start": 1, "stride": 3, "max_frames": 1}, [1]),
        ({"max_frames": 99}, [0, 1, 2, 3, 4]),
    ],
)
def test_indices(options: dict[str, int], indices: list[int]) -> None:
    assert RunOptions(Sensor.RGBD, **options).indices(5) == indices  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options",
    [
        {"start": 5},
        {"start": -1},
        {"stride": 0},
        {"max_frames": 0},
        {"localize_after": -1},
        {"system": SystemOptions(deterministic=True), "realtime": True},
    ],
)
def test_options_that_make_no_sense(options: dict[str, Any]) -> None:
    with pytest.raises(DatasetError, match="--"):
        RunOptions(Sensor.RGBD, **options).indices(5)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": -1}, r"start \(--start\) is -1; give a whole number of frames, 0 or more"),
        ({"stride": 0}, r"stride \(--stride\) is 0; .* 1 or more"),
        ({"max_frames": 0}, r"max_frames \(--max-frames\) is 0; .* 1 or more"),
        ({"localize_after": -1}, r"localize_after \(--localize\) is -1; .* 0 or more"),
        ({"final_adjustment": "no"}, "final_adjustment is 'no'; give True or False"),
        ({"allow_other_setup": "no"}, "allow_other_setup is 'no'; give True or False"),
        ({"save_map": "m.orbmap", "autosave": "a"}, r"autosave \(--autosave\) is 'a'; .*seconds"),
    ],
)
def test_a_wrong_value_is_told_when_the_options_are_made(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(OrbSlamError, match=message):
        RunOptions(Sensor.RGBD, **options)


def test_numbers_of_numpy_become_those_that_a_report_can_hold() -> None:
    assert type(RunOptions(Sensor.RGBD, max_frames=np.int64(3)).max_frames) is int  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options",
    [
        {"full_adjustment": False, "full_adjustment_time_limit": 3},
        {"loop_closing": False, "full_adjustment_time_limit": 3},
        {"several_maps": False, "new_map_after": 3},
    ],
)
def test_options_may_be_combined_with_every_switch(options: dict[str, Any]) -> None:
    """A sweep compares on with off, and `System.optimize` has the limit as well."""
    assert SystemOptions(**options) == replace(SystemOptions(), **options)


@pytest.mark.parametrize("switch", ["full_adjustment", "loop_closing", "several_maps"])
def test_what_is_left_as_it_is_does_no_harm(switch: str) -> None:
    options = SystemOptions(**{switch: False})  # type: ignore[arg-type]
    assert options.new_map_after == 2.0
    assert replace(options, seed=3).seed == 3
