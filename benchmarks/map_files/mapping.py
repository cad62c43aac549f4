# SPDX-License-Identifier: BSD-3-Clause
"""Maps to save: of short synthetic runs, and made up at the size of a large one."""

from __future__ import annotations

import dataclasses

import numpy as np

from orbslam2py import System, load_vocabulary
from orbslam2py.maps import (
    Covisibility,
    Keyframes,
    MapContents,
    Observations,
    Points,
    RemovedKeyframes,
    SavedMap,
)
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence


def corridor(frames: int, size: tuple[int, int] = (320, 240)) -> SyntheticSequence:
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=frames, size=size)
    return SyntheticSequence(options)


def mapped(frames: int, *, images: bool = False) -> SavedMap:
    """The map of a deterministic run."""
    sequence = corridor(frames)
    with System(sequence.settings, "rgbd", deterministic=True, keyframe_images=images) as slam:
        slam.run(sequence)
        return slam.saved_map()


def made_up(like: SavedMap, n_keyframes: int, n_keypoints: int, n_points: int) -> SavedMap:
    """A map of that size with random features, each point seen by six keyframes in a row."""
    rng = np.random.default_rng(1)
    k, n, p, seen_by = n_keyframes, n_keypoints, n_points, 6
    ids = np.arange(k, dtype=np.int64)
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (k, 1))
    keypoints = rng.uniform(0, 200, (k * n, 2)).astype(np.float32)
    keyframes = Keyframes(
        ids=ids,
        frame_ids=10 * ids,
        timestamps=ids * 0.5,
        camera=np.zeros(k, np.int64),
        rotations=rotations,
        translations=np.stack([-0.1 * ids, 0 * ids, 0 * ids], 1).astype(np.float64),
        scale=np.ones(k),
        parent=ids - 1,
        provisional_parent=np.zeros(k, bool),
        processed=np.ones(k, bool),
        has_colours=np.zeros(k, bool),
        offsets=np.arange(k + 1, dtype=np.int64) * n,
        keypoints=keypoints,
        raw_keypoints=np.zeros((0, 2), np.float32),
        octave=rng.integers(0, 8, k * n).astype(np.uint8),
        angle=rng.uniform(0, 360, k * n).astype(np.float32) % np.float32(359),
        response=rng.uniform(0, 100, k * n).astype(np.float32),
        descriptors=rng.integers(0, 256, (k * n, 32)).astype(np.uint8),
        depth=rng.uniform(1, 5, k * n).astype(np.float32),
        right_u=keypoints[:, 0] - 10,
        colours=np.zeros((0, 3), np.uint8),
        words=rng.integers(0, load_vocabulary().n_words, k * n).astype(np.uint32),
    )
    first = np.sort(rng.integers(0, k - seen_by, p))
    order = np.arange(p)
    slot = (order - np.searchsorted(first, first)) + (first % (seen_by + 1)) * (n // (seen_by + 1))
    point = np.repeat(order, seen_by)
    keyframe = (first[:, None] + np.arange(seen_by)).ravel()
    observations = Observations(point, keyframe, np.repeat(slot, seen_by).astype(np.int32))
    steps = [(a, a + step) for a in range(k) for step in range(1, seen_by) if a + step < k]
    a, b = np.array(steps, np.int64).T
    contents = MapContents(
        map_index=0,
        next_keyframe=k,
        next_point=p,
        cameras=like.contents.cameras,
        keyframes=keyframes,
        removed_keyframes=RemovedKeyframes(
            *(np.zeros(0, np.int64) for _ in range(2)),
            np.zeros((0, 4)),
            np.zeros((0, 3)),
            np.zeros(0),
            np.zeros(0),
        ),
        points=Points(
            ids=order,
            positions=rng.normal(0, 5, (p, 3)),
            mean_directions=np.tile([0.0, 0.0, 1.0], (p, 1)),
            min_distance=np.full(p, 1.0),
            max_distance=np.full(p, 4.0),
            descriptors=rng.integers(0, 256, (p, 32)).astype(np.uint8),
            n_visible=np.full(p, 20, np.int32),
            n_found=np.full(p, 15, np.int32),
            reference_keyframe=first,
            first_keyframe=first,
            first_frame=10 * first,
        ),
        observations=observations,
        covisibility=Covisibility(a, b, np.full(len(a), 80, np.int32)),
        loop_edges=np.zeros((0, 2), np.int64),
    )
    return dataclasses.replace(like, contents=contents, runs=(), images={})
