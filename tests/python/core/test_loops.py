# SPDX-License-Identifier: BSD-3-Clause
"""Detection, verification and choice of loops as Python sees them."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import _core as core
from support.block_wall import DEPTH, HEIGHT, WIDTH, context, ten_words, texture

SHIFT = 4  # centimetres between the two keyframes
DRIFT = 0.03  # metres that the map puts the second one too far


@pytest.fixture(scope="module")
def world() -> core.Map:
    """Two keyframes of one wall, each with points of its own: 0, and 1 which has drifted."""
    world, recent, words = core.Map(), core.RecentPoints(), ten_words()
    for shift, x in ((0, 0.0), (SHIFT, SHIFT / 100 + DRIFT)):
        extraction = core.OrbExtractor(core.OrbOptions(n_features=400)).extract(texture(shift))
        metres = np.full((HEIGHT, WIDTH), DEPTH, dtype=np.float32)
        frame = core.build_rgbd_frame(context(), shift, shift / 10.0, extraction, metres)
        core.describe(frame, words)
        tracked = core.TrackedFrame(frame)
        tracked.T_cw = core.Pose(np.array([0, 0, 0, 1.0]), np.array([-x, 0, 0]))
        core.process_new_keyframe(world, int(core.insert_keyframe(world, tracked, True)), recent)
    return world


@pytest.fixture(scope="module")
def loop(world: core.Map) -> core.Loop:
    options = core.LoopVerificationOptions(fix_scale=True, seed=3)
    found = core.verify_loop_candidate(world, 1, 0, options)
    assert found is not None
    return found


def test_options() -> None:
    options = core.LoopVerificationOptions()
    assert not options.fix_scale
    assert (options.seed, options.min_word_matches) == (0, 20)
    assert (options.min_inliers, options.min_matches) == (20, 40)
    options = core.LoopVerificationOptions(fix_scale=True, seed=2**64 - 1, min_matches=50)
    assert options.fix_scale
    assert (options.seed, options.min_matches) == (2**64 - 1, 50)


def test_verification(world: core.Map, loop: core.Loop) -> None:
    assert (loop.current, loop.matched) == (1, 0)
    assert loop.scale == 1.0
    expected = np.eye(4)
    expected[0, 3] = -SHIFT / 100
    for S in (loop.S_cm, loop.S_cw):
        assert S.shape == (4, 4)
        assert S.dtype == np.float64
        np.testing.assert_allclose(S, expected, atol=0.01)
    assert loop.matches.dtype == loop.loop_points.dtype == np.int64
    matched = loop.matches[loop.matches >= 0]
    assert loop.n_matches == len(matched) >= loop.n_inliers > 100
    assert np.isin(matched, loop.loop_points).all()
    assert len(np.unique(loop.loop_points)) == len(loop.loop_points)


def test_refused_candidates(world: core.Map) -> None:
    options = core.LoopVerificationOptions(fix_scale=True)
    assert core.verify_loop_candidate(world, 1, 7, options) is None
    assert core.verify_loop_candidate(world, 1, 1, options) is None
    options.min_matches = 10_000
    assert core.verify_loop_candidate(world, 1, 0, options) is None


def test_drift(world: core.Map, loop: core.Loop) -> None:
    drift = core.assess_drift(world, loop, fix_scale=True)
    assert drift.path == pytest.approx(SHIFT / 100 + DRIFT)
    assert drift.reach == pytest.approx(drift.path)
    assert drift.turned == pytest.approx(0)
    assert drift.scene_depth == pytest.approx(DEPTH)
    assert drift.translation == pytest.approx(DRIFT, abs=0.01)
    assert drift.rotation < 0.01
    assert drift.scale == 1.0
    assert drift.translation < drift.max_translation < DEPTH / 5
    assert drift.rotation < drift.max_rotation < 0.2
    assert drift.max_log_scale == 0.0
    assert drift.plausible()
    assert core.assess_drift(world, loop, fix_scale=False).max_log_scale > 0.4


def test_choice(world: core.Map, loop: core.Loop) -> None:
    chosen = core.choose_loop(world, [loop, loop], fix_scale=True)
    assert chosen is not None
    np.testing.assert_array_equal(chosen.matches, loop.matches)
    assert core.choose_loop(world, [], fix_scale=True) is None
    other = core.verify_loop_candidate(world, 0, 1, core.LoopVerificationOptions(fix_scale=True))
    with pytest.raises(ValueError, match="same keyframe"):
        core.choose_loop(world, [loop, other], fix_scale=True)


def test_consistency(world: core.Map) -> None:
    consistency = core.LoopConsistency()
    assert consistency.NEEDED == 3
    for _ in range(2):
        for _ in range(consistency.NEEDED):
            assert consistency.update(world, [0]) == []
        assert consistency.update(world, np.array([0, 9])) == [0]
        consistency.clear()
