# SPDX-License-Identifier: BSD-3-Clause
"""Maps without images: cameras on a way past points, exact projections, all that follows."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py.maps import (
    Cameras,
    Covisibility,
    Keyframes,
    MapContents,
    Observations,
    Points,
    RemovedKeyframes,
)
from orbslam2py.trajectory.rotations import (
    inverse_poses,
    poses_from,
    quaternions_from_rotations,
)

FX, FY, CX, CY, WIDTH, HEIGHT = 300.0, 310.0, 158.25, 121.5, 320, 240
LENS = (-0.21, 0.05, 0.001, -0.002, 0.0)
#: That of an Azure Kinect's colour camera.
RATIONAL_LENS = (0.46, -2.63, 0.0006, -0.0003, 1.52, 0.34, -2.45, 1.45)
SCALE_FACTOR, N_LEVELS, BF = 1.2, 8, 30.0
UNMATCHED = 5  # keypoints of every keyframe that show no point
FIRST_TIME, STEP = 1305031102.175304, 0.5


def made_up_map(
    n_keyframes: int = 8,
    n_points: int = 120,
    *,
    seed: int = 0,
    depth: bool = False,
    lens: tuple[float, ...] | None = None,
    colours: bool = False,
    noise: float = 0.0,
    loop: bool = True,
) -> MapContents:
    """A consistent map.

    Parameters
    ----------
    n_keyframes
        Cameras on an arc that ends near its start, looking inwards.
    n_points
        In the middle; every one is seen at least twice.
    depth
        Keypoints have depths, as of a stereo pair; else a single camera.
    lens
        k1, k2, p1, p2, k3.
    colours
        Keypoints have the colours of their points, but for those of keyframe 1.
    noise
        Of keypoints [px], standard deviation.
    loop
        The last keyframe closes a loop to the first.
    """
    random = np.random.default_rng(seed)
    T_wc = _way(n_keyframes)
    positions = random.uniform([-1.0, -0.7, 3.0], [1.0, 0.7, 5.0], (n_points, 3))
    pixels, depths = _project(positions, inverse_poses(T_wc))
    raw = _distorted(pixels, lens) if lens else pixels
    inside = (depths > 0.1) & np.all((raw > 1) & (raw < [WIDTH - 2, HEIGHT - 2]), axis=2)
    inside &= random.random(inside.shape) < 0.8
    enough = inside.sum(axis=0) >= 2
    positions, inside = positions[enough], inside[:, enough]
    if noise:
        pixels = pixels + random.normal(scale=noise, size=pixels.shape)
        raw = _distorted(pixels, lens) if lens else pixels
    # Ids with gaps, as culling leaves them.
    point_ids = np.cumsum(random.integers(1, 4, len(positions))) + 10
    keypoints = _keypoints(random, pixels[:, enough], raw[:, enough], depths[:, enough], inside)
    observations = _observations(keypoints, point_ids)
    k = n_keyframes
    palette = random.integers(0, 256, (len(positions), 3)).astype(np.uint8)
    offsets = np.concatenate([[0], np.cumsum([len(row) for row in keypoints.point])])
    point = np.concatenate(keypoints.point)
    n = len(point)
    shown = np.where(point[:, None] >= 0, palette[point], 17).astype(np.uint8)
    has_colours = np.full(k, colours)
    if colours:
        has_colours[1] = False
        shown[offsets[1] : offsets[2]] = 0
    depth_of = np.where(point >= 0, np.concatenate(keypoints.depth), -1.0)
    bf = BF if depth else 0.0
    covisibility = counted(observations)
    T_cw = inverse_poses(T_wc)
    keyframes = Keyframes(
        ids=np.arange(k),
        frame_ids=7 * np.arange(k),
        timestamps=FIRST_TIME + STEP * np.arange(k),
        camera=np.zeros(k, np.int64),
        rotations=quaternions_from_rotations(T_cw[:, :3, :3]),
        translations=T_cw[:, :3, 3].copy(),
        scale=np.linspace(1.0, 1.02, k),
        parent=_parents(k, covisibility),
        provisional_parent=np.zeros(k, bool),
        processed=np.ones(k, bool),
        has_colours=has_colours,
        offsets=offsets.astype(np.int64),
        keypoints=np.concatenate(keypoints.pixels).astype(np.float32),
        raw_keypoints=np.concatenate(keypoints.raw).astype(np.float32)
        if lens
        else np.zeros((0, 2), np.float32),
        octave=random.integers(0, N_LEVELS, n).astype(np.uint8),
        angle=random.uniform(0, 360, n).astype(np.float32),
        response=random.uniform(7, 100, n).astype(np.float32),
        descriptors=random.integers(0, 256, (n, 32)).astype(np.uint8),
        depth=(depth_of if depth else np.full(n, -1.0)).astype(np.float32),
        right_u=_right(np.concatenate(keypoints.pixels)[:, 0], depth_of if depth else -1.0, bf),
        colours=shown if colours else np.zeros((0, 3), np.uint8),
    )
    points = _points(random, point_ids, positions, observations, keyframes)
    return MapContents(
        map_index=0,
        next_keyframe=k,
        next_point=int(point_ids[-1]) + 5,
        cameras=_camera(lens, bf),
        keyframes=keyframes,
        removed_keyframes=_none_removed(),
        points=points,
        observations=observations,
        covisibility=covisibility,
        loop_edges=np.array([[0, k - 1]] if loop and k > 2 else np.zeros((0, 2)), np.int64),
    )


def counted(observations: Observations) -> Covisibility:
    """Shared points of all pairs of keyframes."""
    shared: dict[tuple[int, int], int] = {}
    for point in np.unique(observations.point):
        seen_in = observations.keyframe[observations.point == point].tolist()
        for i, a in enumerate(seen_in):
            for b in seen_in[i + 1 :]:
                shared[a, b] = shared.get((a, b), 0) + 1
    pairs = sorted(shared)
    a, b = np.array(pairs, np.int64).reshape(-1, 2).T
    return Covisibility(a, b, np.array([shared[pair] for pair in pairs], np.int32))


# ---- parts ---------------------------------------------------------------------------------------
class _KeypointLists:
    """Keypoints of each keyframe: pixels, depth, and row of the point or -1."""

    def __init__(self) -> None:
        self.pixels: list[NDArray[np.float64]] = []
        self.raw: list[NDArray[np.float64]] = []
        self.depth: list[NDArray[np.float64]] = []
        self.point: list[NDArray[np.int64]] = []


def _way(k: int) -> NDArray[np.float64]:
    """Poses T_wc (k, 4, 4): the first is the identity, all look at a point 4 in front of it."""
    angles = np.linspace(0.0, 0.9, k) * np.sin(np.linspace(0, np.pi * (k - 1) / k, k))
    centre = np.array([0.0, 0.0, 4.0])
    c, s = np.cos(angles), np.sin(angles)
    zero, one = np.zeros(k), np.ones(k)
    R = np.stack([c, zero, -s, zero, one, zero, s, zero, c], axis=1).reshape(k, 3, 3)
    lift = np.stack([zero, 0.1 * angles, zero], axis=1)
    return poses_from(R, centre - 4.0 * R[:, :, 2] + lift)


def _project(
    X: NDArray[np.float64], T_cw: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Pixels (k, p, 2) and depths (k, p)."""
    in_camera = np.einsum("kij,pj->kpi", T_cw[:, :3, :3], X) + T_cw[:, None, :3, 3]
    z = in_camera[..., 2]
    u, v = FX * in_camera[..., 0] / z + CX, FY * in_camera[..., 1] / z + CY
    return np.stack([u, v], axis=2), z


def _distorted(pixels: NDArray[np.float64], lens: tuple[float, ...]) -> NDArray[np.float64]:
    rays = (pixels - [CX, CY]) / [FX, FY]
    flat = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=2).reshape(-1, 1, 3)
    K = np.array([[FX, 0, CX], [0, FY, CY], [0, 0, 1]])
    seen, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), K, np.array(lens))
    return np.asarray(seen.reshape(pixels.shape), np.float64)


def _keypoints(
    random: np.random.Generator,
    pixels: NDArray[np.float64],
    raw: NDArray[np.float64],
    depths: NDArray[np.float64],
    inside: NDArray[np.bool_],
) -> _KeypointLists:
    lists = _KeypointLists()
    for row in range(len(pixels)):
        seen = random.permutation(np.flatnonzero(inside[row]))
        others = random.uniform([0, 0], [WIDTH, HEIGHT], (UNMATCHED, 2))
        point = np.concatenate([seen, np.full(UNMATCHED, -1)])
        order = random.permutation(len(point))
        lists.point.append(point[order])
        lists.pixels.append(np.concatenate([pixels[row, seen], others])[order])
        lists.raw.append(np.concatenate([raw[row, seen], others])[order])
        lists.depth.append(np.concatenate([depths[row, seen], np.full(UNMATCHED, -1.0)])[order])
    return lists


def _observations(keypoints: _KeypointLists, point_ids: NDArray[np.int64]) -> Observations:
    rows = [
        (int(point_ids[point]), keyframe, number)
        for keyframe, points in enumerate(keypoints.point)
        for number, point in enumerate(points.tolist())
        if point >= 0
    ]
    table = np.array(sorted(rows), np.int64).reshape(-1, 3)
    return Observations(table[:, 0].copy(), table[:, 1].copy(), table[:, 2].astype(np.int32))


def _parents(k: int, covisibility: Covisibility) -> NDArray[np.int64]:
    """For each the earlier keyframe with which it shares most."""
    parents = np.full(k, -1, np.int64)
    for child in range(1, k):
        mine = covisibility.b == child
        best = np.argmax(covisibility.weight[mine])
        parents[child] = covisibility.a[mine][best]
    return parents


def _right(
    u: NDArray[np.float64], depth: NDArray[np.float64] | float, bf: float
) -> NDArray[np.float32]:
    z = np.broadcast_to(depth, u.shape)
    return np.where(z > 0, u - bf / np.where(z > 0, z, 1.0), -1.0).astype(np.float32)


def _camera(lens: tuple[float, ...] | None, bf: float) -> Cameras:
    return Cameras(
        *(np.array([value]) for value in (FX, FY, CX, CY)),
        distortion=np.array([(*(lens or ()), *(0.0,) * 8)[:8]]),
        bf=np.array([bf]),
        depth_ratio=np.array([40.0 if bf else 0.0]),
        width=np.array([WIDTH]),
        height=np.array([HEIGHT]),
        scale_factor=np.array([SCALE_FACTOR], np.float32),
        n_levels=np.array([N_LEVELS]),
        model=np.zeros(1, np.int64),
        lens=np.zeros((1, 16)),
    )


def _none_removed() -> RemovedKeyframes:
    ids = np.zeros(0, np.int64)
    numbers = np.zeros(0)
    return RemovedKeyframes(ids, ids, np.zeros((0, 4)), np.zeros((0, 3)), numbers, numbers)


def _points(
    random: np.random.Generator,
    ids: NDArray[np.int64],
    positions: NDArray[np.float64],
    observations: Observations,
    keyframes: Keyframes,
) -> Points:
    p = len(ids)
    begin = np.searchsorted(observations.point, ids)
    reference = observations.keyframe[begin]
    centres = keyframes.T_wc[:, :3, 3]
    mean, farthest = np.zeros((p, 3)), np.zeros(p)
    for row, (first, last) in enumerate(pairwise([*begin.tolist(), len(observations)])):
        ray = positions[row] - centres[observations.keyframe[first:last]]
        length = np.linalg.norm(ray, axis=1)
        mean[row] = (ray / length[:, None]).mean(axis=0)
        keypoint = keyframes.offsets[reference[row]] + observations.keypoint[first]
        farthest[row] = length[0] * SCALE_FACTOR ** keyframes.octave[keypoint]
    return Points(
        ids=ids,
        positions=positions,
        mean_directions=mean,
        min_distance=farthest / SCALE_FACTOR ** (N_LEVELS - 1),
        max_distance=farthest,
        descriptors=random.integers(0, 256, (p, 32)).astype(np.uint8),
        n_visible=random.integers(2, 50, p).astype(np.int32),
        n_found=np.full(p, 2, np.int32),
        reference_keyframe=reference,
        first_keyframe=reference,
        first_frame=keyframes.frame_ids[reference],
    )
