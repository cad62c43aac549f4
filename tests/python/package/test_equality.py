# SPDX-License-Identifier: BSD-3-Clause
"""Records that hold arrays can be compared and put into sets."""

from __future__ import annotations

import copy
import dataclasses
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.datasets import Frame, Images, LiveFrame

T = np.eye(4)
IMAGES = Images(np.zeros((4, 6), np.uint8), depth=np.full((4, 6), np.nan))
FEATURES = orb.FrameFeatures(
    *(np.zeros((2, 2), np.float32), np.zeros(2, np.int32), np.ones(2, np.float32)),
    *(np.arange(2), np.ones(2, bool), np.zeros((0, 3), np.uint8)),
)

#: Records with arrays, and a field of each with another value.
RECORDS: dict[str, tuple[Any, dict[str, Any]]] = {
    "tracking": (
        orb.TrackingRecord(
            *(0, 0.0, 0, orb.TrackingState.OK, orb.Reason.NONE, T, np.eye(6), 9, 8, True, 0),
            milliseconds={"track": 1.0},
            features=FEATURES,
        ),
        {"T_cw": 2 * T},
    ),
    "lost": (
        orb.TrackingRecord(
            *(
                1,
                0.1,
                0,
                orb.TrackingState.LOST,
                orb.Reason.NOT_FOUND_IN_MAP,
                None,
                None,
                0,
                0,
                False,
                -1,
            )
        ),
        {"T_cw": T},
    ),
    "features": (FEATURES, {"levels": np.ones(2, np.int32)}),
    "keyframe": (orb.KeyframeAdded(0, 1, 2.0, T, 3, 4), {"T_wc": 2 * T}),
    "relocalized": (orb.Relocalized(0, 1, 2.0, T), {"T_wc": T[:3]}),
    "loop": (
        orb.LoopClosed(0, 9, 1, 2.0, 1.0, 30, 40, 50, 1.0, T, 0.1, 2.0, {"detect": 1.0}),
        {"milliseconds": {}},
    ),
    "merged": (
        orb.MapsMerged(0, 1, 9, 2, 2.0, 1.0, 30, 40, 50, 6, 7, T, 1.0),
        {"S_km": 2 * T},
    ),
    "images": (IMAGES, {"image": np.ones((4, 6), np.uint8)}),
    "frame": (Frame(0, 0.0, "0", IMAGES), {"images": Images(IMAGES.image)}),
    "live": (LiveFrame(0.0, "0", IMAGES), {"text": "0.0"}),
    "trajectory": (orb.Trajectory(np.arange(2.0), np.stack([T, T])), {"lost": [True, False]}),
}


@pytest.mark.parametrize("name", RECORDS)
def test_records_are_equal_if_all_their_numbers_are(name: str) -> None:
    record, changed = RECORDS[name]
    same, other = copy.deepcopy(record), dataclasses.replace(record, **changed)
    assert record == same
    assert record != other
    assert record != "something else"
    assert hash(record) == hash(same)
    assert len({record, same, other}) == 2


def test_records_of_other_kinds_differ() -> None:
    added = RECORDS["keyframe"][0]
    assert added != RECORDS["relocalized"][0]
