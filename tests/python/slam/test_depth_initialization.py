# SPDX-License-Identifier: BSD-3-Clause
"""How a map begins where depth is known, with the verbs of the core replaced."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orbslam2py import Reason, _core
from orbslam2py.slam import initialization
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.initialization import from_depth
from support.tracking_scene import (
    FakeCore,
    FakeFrame,
    FakeMap,
    FakeMapping,
)


@pytest.mark.parametrize(
    ("size", "n_depths", "reason"),
    [
        (500, 500, Reason.TOO_FEW_KEYPOINTS),
        (501, 99, Reason.TOO_FEW_DEPTHS),
        (501, 100, Reason.NONE),
    ],
)
def test_depth_initializer(
    monkeypatch: pytest.MonkeyPatch, size: int, n_depths: int, reason: Reason
) -> None:
    """The original begins a map with 500 keypoints even if none has depth (OD-68)."""
    inserted: list[dict[str, Any]] = []

    def insert(_map: FakeMap, frame: FakeFrame, **options: Any) -> int:
        assert frame.features.described
        frame.reference_keyframe = 0
        inserted.append(options)
        return 0

    fakes = FakeCore()
    fake = SimpleNamespace(
        Pose=_core.Pose,
        describe=fakes.describe,
        insert_keyframe=insert,
        TrackedFrame=fakes.TrackedFrame,
    )
    monkeypatch.setattr(from_depth, "core", fake)
    mapping = FakeMapping()
    frame = FakeFrame(0)
    depth = np.full(size, -1, np.float32)
    depth[:n_depths] = 2.0
    frame.features = SimpleNamespace(size=size, depth=depth, described=False, frame_id=0)
    initializer = initialization.DepthInitializer(
        FakeMap(),  # type: ignore[arg-type]
        "vocabulary",  # type: ignore[arg-type]
        mapping,  # type: ignore[arg-type]
        n_features=1000,
        config=InitializationConfig(),
    )
    assert initializer.try_initialize(frame) is reason  # type: ignore[arg-type]
    if reason is Reason.NONE:
        assert mapping.inserted == [0]
        assert frame.T_cw is not None
        np.testing.assert_array_equal(frame.T_cw.matrix, np.eye(4))
        assert frame.reference_keyframe == 0
        assert inserted[0]["create_points"]
        assert inserted[0]["n_minimum"] >= size, "a point for every depth"
    else:
        assert mapping.inserted == []
        assert frame.T_cw is None
