# SPDX-License-Identifier: BSD-3-Clause
"""A map that is made of its contents in parts."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest

from orbslam2py import MapFileError, StateError
from orbslam2py import _core as core
from support.block_wall import some_frame
from support.slow_arrays import SlowArray


@pytest.fixture
def contents() -> dict[str, Any]:
    slam_map = core.Map()
    slam_map.publish(slam_map.add_keyframe(some_frame(), core.Pose()))
    return core.map_contents(slam_map)


def restorer_of(contents: dict[str, Any]) -> core.MapRestorer:
    return core.MapRestorer(contents, len(contents["keyframes.keypoints"]))


def test_a_second_thread_is_refused_while_a_part_is_read(contents: dict[str, Any]) -> None:
    restorer = restorer_of(contents)
    slow = SlowArray(contents["keyframes.depth"])
    thread = threading.Thread(target=lambda: restorer.add({**contents, "keyframes.depth": slow}, 1))
    thread.start()
    assert slow.is_read.wait(30)
    try:
        with pytest.raises(StateError, match="another thread"):
            restorer.add(contents, 1)
        with pytest.raises(StateError, match="another thread"):
            restorer.finish(core.Map())
    finally:
        slow.go_on.set()
        thread.join()
    restored = core.Map()
    restorer.finish(restored)
    np.testing.assert_array_equal(restored.keyframe_ids(), [0])


def test_a_refused_part_does_not_keep_the_restorer(contents: dict[str, Any]) -> None:
    restorer = restorer_of(contents)
    with pytest.raises(MapFileError, match="depth"):
        restorer.add({**contents, "keyframes.depth": np.zeros(3, np.float32)}, 1)
    restorer.add(contents, 1)
    restorer.finish(core.Map())
