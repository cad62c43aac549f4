# SPDX-License-Identifier: BSD-3-Clause
"""What judges loops of synthetic worlds: where the path begins that it judges."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from benchmarks.loops import quality

from orbslam2py import Sensor, Trajectory


def path(off: float) -> Trajectory:
    """A bent path of twenty images, of which the first ten are off sideways by so much."""
    T_wc = np.tile(np.eye(4), (20, 1, 1))
    T_wc[:, 0, 3] = np.arange(20.0)
    T_wc[:, 1, 3] = np.arange(20.0) ** 2 / 20
    T_wc[:10, 2, 3] = off
    return Trajectory(timestamps=np.arange(20.0), T_wc=T_wc)


class FakeCase:
    """No lap, nothing seen again; the first half of the path is wrong."""

    sensor = Sensor.STEREO
    near = apart = 1.0
    n_revisits = 0

    def sequence(self, seed: int) -> Any:
        return SimpleNamespace(ground_truth=lambda: path(0.0), lap_length=None)

    def run(self, sequence: object, seed: int, **options: bool) -> Any:
        estimate = path(0.5)
        return SimpleNamespace(
            trajectories=[estimate],
            tracked_trajectory=lambda: estimate,
            n_tracked=20,
            error=None,
            loops=[],
        )


def error_from(first_image: int) -> float:
    case: Any = FakeCase()
    task = quality.Task(case, 0, loop_closing=True, deterministic=True, first_image=first_image)
    outcome = quality.carry_out(task)
    assert outcome.failure == ""
    assert outcome.ate is not None
    return outcome.ate


def test_the_path_is_judged_from_the_image_on_that_is_asked_for() -> None:
    assert error_from(0) > 0.05
    assert error_from(10) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("first_image", "said"),
    [("-1", "--first-image must be 0 or more"), ("100000", "two-rooms mono has fewer images")],
)
def test_an_image_that_no_path_has_is_refused(
    first_image: str,
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    options = ["--cases", "two-rooms", "--sensors", "mono", "--first-image", first_image]
    monkeypatch.setattr(sys, "argv", ["quality", *options])
    with pytest.raises(SystemExit) as ended:
        quality.main()
    assert said in f"{ended.value} {capsys.readouterr().err}"
