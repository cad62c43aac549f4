# SPDX-License-Identifier: BSD-3-Clause
"""Which of the frames before a single camera's map began are given a pose in it."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py.slam.initialization import earlier_frames
from orbslam2py.slam.initialization.earlier_frames import EarlierFrames
from orbslam2py.slam.records import PoseEstimate, Verdict
from orbslam2py.slam.state import Motion

N, FIRST = 12, 8
EXACT, VAGUE = 0.5, 1.2  # standard deviation of the rotation, degrees


class Frame(SimpleNamespace):
    reference_keyframe = 0
    T_cw: Any = "somewhere"

    def clear_associations(self) -> None: ...
    def discard_outliers(self) -> None: ...


def estimate(degrees: float, verdict: Verdict = Verdict.STRONG) -> PoseEstimate:
    covariance = np.zeros((6, 6))
    covariance[1, 1] = np.radians(degrees) ** 2
    evidence: Any = SimpleNamespace(verdict=verdict)
    return PoseEstimate(covariance=covariance, evidence=evidence)


@pytest.fixture(autouse=True)
def map_at_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Motion, "following", lambda motion, slam_map: motion)
    monkeypatch.setattr(earlier_frames.core, "velocity_between", lambda last, frame: None)


def tracked(judge: Callable[[int], PoseEstimate]) -> list[int]:
    """The frames that are given poses when the first view was frame 8 of 12."""
    slam_map = SimpleNamespace(living=lambda keyframe: keyframe)
    search: Any = SimpleNamespace(
        map=slam_map,
        by_motion_model=lambda frame, state: judge(frame.id),
    )
    acceptance: Any = SimpleNamespace(refine=lambda frame, first, state: (judge(frame.id), state))
    earlier = EarlierFrames(search, acceptance)
    frames: list[Any] = [Frame(id=i) for i in range(N)]
    earlier.track(frames, frames[FIRST])
    return [frame.id for frame in earlier.take()]


def test_poses_that_are_known_well_are_taken() -> None:
    assert tracked(lambda i: estimate(EXACT)) == list(range(N - 1)), "the last began the map"


def test_one_that_is_not_costs_itself() -> None:
    assert tracked(lambda i: estimate(VAGUE if i == 4 else EXACT)) == [0, 1, 2, 3, *range(5, N - 1)]
    weak = tracked(lambda i: estimate(EXACT, Verdict.WEAK if i == 4 else Verdict.STRONG))
    assert 4 not in weak
    assert len(weak) == N - 2


def test_where_the_map_ends_the_path_does() -> None:
    """Frames that see less and less of the map are left alone after six in a row."""
    assert tracked(lambda i: estimate(VAGUE if 1 <= i <= 6 else EXACT)) == list(range(7, N - 1))
    assert 0 in tracked(lambda i: estimate(VAGUE if 1 <= i <= 5 else EXACT))


def test_without_a_covariance_nothing_is_taken() -> None:
    unknown = PoseEstimate(evidence=estimate(EXACT).evidence)
    assert tracked(lambda i: unknown) == [FIRST]
