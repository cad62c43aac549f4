# SPDX-License-Identifier: BSD-3-Clause
"""Two rooms that look alike, both in the map: a lost camera is not found in the wrong one."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from benchmarks.accuracy.mapped_world import MappedWorld, beside

from orbslam2py import Reason, Sensor, TrackingState
from orbslam2py import _core as core
from orbslam2py.evaluation import PoseError
from orbslam2py.slam.relocalization.ambiguity_check import AmbiguityCheck
from orbslam2py.slam.relocalization.relocalizer import Relocalization, Relocalizer
from orbslam2py.slam.state import LostSearch
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

pytestmark = pytest.mark.watchdog(120)

N_VIEWS = 40
#: Metres: farther away is the other room.
WRONG = 1.0


@lru_cache
def mapped() -> MappedWorld:
    options = SyntheticOptions(world="two-rooms", sensor=Sensor.RGBD, size=(320, 240), noise=2)
    sequence = SyntheticSequence(options)
    world = MappedWorld(sequence, range(0, len(sequence) - 1, 2))
    world.system.localization_mode = True
    return world


def shown_beside_the_path(seed: int) -> tuple[list[PoseError], set[Reason]]:
    """Errors of the views that are found, and why others are not."""
    world, rng = mapped(), np.random.default_rng(seed)
    errors, reasons = [], set()
    for number in range(N_VIEWS):
        world.lose()
        T_wc = beside(world.sequence.T_wc(int(rng.integers(len(world.sequence) - 1))), rng, 0.5, 20)
        record = world.show(world.sequence.view(T_wc, 10_000 + number))
        if record.state is TrackingState.OK:
            errors.append(world.error(record, T_wc))
        else:
            reasons.add(record.reason)
    return errors, reasons


def n_wrong(errors: list[PoseError]) -> int:
    return sum(error.translation_m > WRONG for error in errors)


def test_nobody_is_found_in_the_other_room(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(AmbiguityCheck, "choose", lambda _self, frame, *_: frame)
        assert n_wrong(shown_beside_the_path(0)[0]) > 0, "the first place that fits"
    errors, reasons = shown_beside_the_path(0)
    assert n_wrong(errors) == 0
    assert len(errors) >= 0.75 * N_VIEWS
    assert Reason.SEVERAL_PLACES in reasons
    assert reasons <= {Reason.SEVERAL_PLACES, Reason.NOT_FOUND_IN_MAP, Reason.FEW_INLIERS_LOCAL_MAP}


def test_what_is_not_decided_has_neither_pose_nor_matches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AmbiguityCheck, "choose", lambda *_: None)
    world = mapped()
    seen = []
    relocalize = Relocalizer.relocalize

    def watched(
        self: Relocalizer, frame: core.TrackedFrame, lost: LostSearch
    ) -> tuple[Relocalization, LostSearch]:
        found, lost = relocalize(self, frame, lost)
        seen.append((found.n_inliers, frame.T_cw, frame.n_associated(), found.is_ambiguous))
        return found, lost

    monkeypatch.setattr(Relocalizer, "relocalize", watched)
    world.lose()
    record = world.show(world.sequence.load(100))
    assert record.reason is Reason.SEVERAL_PLACES
    assert seen[-1] == (0, None, 0, True)
    world.lose()
    assert seen[-1] == (0, None, 0, False)
