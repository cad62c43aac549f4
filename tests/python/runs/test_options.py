# SPDX-License-Identifier: BSD-3-Clause
"""Which frames a run takes."""

from __future__ import annotations

from typing import Any

import pytest

from orbslam2py import DatasetError, Sensor
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
        {"system": SystemOptions(deterministic=True), "realtime": True},
    ],
)
def test_options_that_make_no_sense(options: dict[str, Any]) -> None:
    with pytest.raises(DatasetError, match="--"):
        RunOptions(Sensor.RGBD, **options).indices(5)
