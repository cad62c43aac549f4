# SPDX-License-Identifier: BSD-3-Clause
"""States of an IMU for made-up maps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from orbslam2py.maps import ImuStates, MapContents

#: Samples from one keyframe to the next, both ends included.
SAMPLES = 11


def with_states(
    contents: MapContents, *, but: tuple[int, ...] = (1,), seed: int = 5
) -> MapContents:
    """A map with states at all keyframes but some; nothing joins that of row 4 to that of row 3.

    Parameters
    ----------
    contents
        The map.
    but
        Rows of the keyframes without a state.
    seed
        Of the numbers.
    """
    random = np.random.default_rng(seed)
    rows = np.setdiff1d(np.arange(len(contents.keyframes)), but)
    times = contents.keyframes.timestamps[rows]
    parts: list[np.ndarray] = [np.zeros((0, 7))]
    for row, begin, end in zip(rows[1:].tolist(), times[:-1], times[1:], strict=True):
        t = np.linspace(begin, end, SAMPLES if row != 4 else 0)
        parts.append(np.column_stack([t, random.normal(size=(len(t), 6))]))
        parts[-1][-1:, 1:] = np.arange(1, 7)  # a reading that two entries share
        parts[-1][:1, 1:] = np.arange(1, 7)
    m = len(rows)
    states = ImuStates(
        ids=contents.keyframes.ids[rows],
        velocity=random.normal(size=(m, 3)),
        scale=np.linspace(1.0, 0.9, m),
        bias=random.normal(scale=0.1, size=(m, 6)),
        offsets=np.cumsum([0, *(len(part) for part in parts)]).astype(np.int64),
        samples=np.concatenate(parts),
    )
    return replace(contents, imu_states=states)


def velocities(contents: MapContents) -> np.ndarray:
    """Of all states in the world (m, 3), in the present units of the map."""
    states, keyframes = contents.imu_states, contents.keyframes
    rows = np.searchsorted(keyframes.ids, states.ids)
    factor = keyframes.scale[rows] / states.scale
    in_world = np.einsum("kij,kj->ki", keyframes.T_wc[rows, :3, :3], states.velocity)
    return np.asarray(factor[:, None] * in_world)
