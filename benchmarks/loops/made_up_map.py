# SPDX-License-Identifier: BSD-3-Clause
"""A large map after a loop, made without a world: points are dots on black images.

A camera drives around a ring, looking ahead, and sees its beginning again. The dots of every image
go through the extractor, so keyframes are as real as any; who sees what is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core

Array = npt.NDArray[Any]

WIDTH, HEIGHT, FOCAL = 640, 480, 400.0
BASELINE_TIMES_FOCAL = 200.0
"""Of the right camera [pixel metre]: half a metre."""
_DEPTH_LIMIT = 8.0
_STEP = 0.5
_PIXEL_NOISE = 0.6


@dataclass(frozen=True)
class MapSize:
    """How large."""

    keyframes: int = 1000
    points_per_keyframe: int = 70
    """Seen first by each."""
    mean_track: float = 7.0
    """Keyframes that see a point in one visit, on average."""
    overlap: float = 0.06
    """Part of the keyframes that see the beginning again."""
    seed: int = 1


@dataclass
class MadeUpMap:
    """Frames, and which keypoint shows which point. Fills any number of maps."""

    size: MapSize
    frames: list[core.Frame] = field(default_factory=list)
    R_cw: Array = field(default_factory=lambda: np.empty(0))
    """(n, 3, 3)"""
    t_cw: Array = field(default_factory=lambda: np.empty(0))
    points: Array = field(default_factory=lambda: np.empty(0))
    """(m, 3)"""
    creator: Array = field(default_factory=lambda: np.empty(0))
    seen: list[tuple[Array, Array]] = field(default_factory=list)
    """Per keyframe: points and the slots of their keypoints."""

    @staticmethod
    def make(size: MapSize) -> MadeUpMap:
        """Draw and extract everything."""
        made = MadeUpMap(size)
        made._drive()
        observers = made._scatter(np.random.default_rng(size.seed))
        made._photograph(observers, np.random.default_rng(size.seed + 1))
        return made

    def fill(self, slam_map: core.Map, rng: np.random.Generator) -> list[int]:
        """Enter all into an empty map, with drift. Returns the ids of the keyframes."""
        poses = self.drifted(rng)
        keyframes = [
            slam_map.add_keyframe(frame, pose)
            for frame, pose in zip(self.frames, poses, strict=True)
        ]
        matrices = np.stack([pose.matrix for pose in poses])
        # Every point is where the first keyframe that sees it puts it.
        R, t = matrices[self.creator, :3, :3], matrices[self.creator, :3, 3]
        before = np.einsum("nij,nj->ni", self.R_cw[self.creator], self.points)
        before += self.t_cw[self.creator]
        positions = np.einsum("nji,nj->ni", R, before - t)
        n_seen = np.bincount(np.concatenate([p for p, _ in self.seen]), minlength=len(positions))
        ids = [
            slam_map.add_point(position, keyframes[creator], 0) if n > 1 else -1
            for position, creator, n in zip(positions, self.creator, n_seen, strict=True)
        ]
        for keyframe, (points, slots) in zip(keyframes, self.seen, strict=True):
            for point, slot in zip(points.tolist(), slots.tolist(), strict=True):
                if ids[point] >= 0:
                    slam_map.add_observation(ids[point], keyframe, slot)
        for keyframe in keyframes:
            slam_map.publish(keyframe)
        for keyframe in keyframes:
            slam_map.update_connections(keyframe)
        for point in ids:
            if point >= 0:
                slam_map.update_point(point)
        return keyframes

    def drifted(self, rng: np.random.Generator) -> list[core.Pose]:
        """Poses with a drift that a closed loop has spread over all keyframes."""
        n = self.size.keyframes
        walk = np.cumsum(rng.normal(size=(n, 6)) * ([5e-4] * 3 + [4e-3] * 3), axis=0)
        walk -= np.linspace(0, 1, n)[:, None] * walk[-1]
        walk += rng.normal(size=(n, 6)) * ([1e-4] * 3 + [2e-4] * 3)
        walk[0] = 0
        true = [_pose(R, t) for R, t in zip(self.R_cw, self.t_cw, strict=True)]
        return [core.Pose.exp(xi) @ pose for xi, pose in zip(walk, true, strict=True)]

    # ---- how it is made --------------------------------------------------------------------------
    @property
    def _n_lap(self) -> int:
        return self.size.keyframes - int(self.size.overlap * self.size.keyframes)

    def _drive(self) -> None:
        k = np.arange(self.size.keyframes)
        turn = 2 * np.pi * k / self._n_lap
        # x to the right, outwards; y down; z ahead. A little beside the first lap in the second.
        radius = _STEP * self._n_lap / (2 * np.pi) + np.where(k < self._n_lap, 0.0, 0.1)
        cos, sin, zero, one = np.cos(turn), np.sin(turn), 0 * turn, 0 * turn + 1
        R_wc = np.stack([cos, zero, -sin, zero, one, zero, sin, zero, cos], 1).reshape(-1, 3, 3)
        center = np.stack([radius * cos, zero, radius * sin], 1)
        self.R_cw = R_wc.transpose(0, 2, 1)
        self.t_cw = -np.einsum("nij,nj->ni", self.R_cw, center)

    def _scatter(self, rng: np.random.Generator) -> list[Array]:
        """Points, and per keyframe those that it is to see."""
        n, each, n_lap = self.size.keyframes, self.size.points_per_keyframe, self._n_lap
        self.creator = np.repeat(np.arange(n_lap), each)
        m = len(self.creator)
        z = rng.uniform(4, 16, m)
        u, v = rng.uniform(60, WIDTH - 60, m), rng.uniform(40, HEIGHT - 40, m)
        before = np.stack([(u - WIDTH / 2) / FOCAL * z, (v - HEIGHT / 2) / FOCAL * z, z], 1)
        R, t = self.R_cw[self.creator], self.t_cw[self.creator]
        self.points = np.einsum("nji,nj->ni", R, before - t)
        track = np.minimum(2 + rng.geometric(1 / (self.size.mean_track - 1), m), 30)
        observers = []
        for k in range(n):
            near = (self.creator <= k) & (k < self.creator + track)
            revisit = k - n_lap - self.creator
            near |= (revisit >= 0) & (revisit < 10) & (rng.random(m) < 0.6)
            observers.append(np.flatnonzero(near))
        return observers

    def _photograph(self, observers: list[Array], rng: np.random.Generator) -> None:
        options = core.CameraOptions(
            fx=FOCAL,
            fy=FOCAL,
            cx=WIDTH / 2,
            cy=HEIGHT / 2,
            width=WIDTH,
            height=HEIGHT,
            bf=BASELINE_TIMES_FOCAL,
            depth_ratio=200,
        )
        context = core.FrameContext(core.Camera(options), core.ScalePyramid(1.2, 8))
        extractor = core.OrbExtractor(core.OrbOptions(n_features=2000, n_levels=1))
        shape = (HEIGHT, WIDTH)
        offsets = np.add.outer(WIDTH * np.arange(-1, 2), np.arange(-1, 2)).ravel()
        for k, candidates in enumerate(observers):
            p = self.points[candidates] @ self.R_cw[k].T + self.t_cw[k]
            uv = FOCAL * p[:, :2] / p[:, 2:] + (WIDTH / 2, HEIGHT / 2)
            uv = np.rint(uv + rng.normal(scale=_PIXEL_NOISE, size=uv.shape)).astype(np.int64)
            inside = (p[:, 2] > 1) & np.all((uv > 20) & (uv < (WIDTH - 20, HEIGHT - 20)), axis=1)
            pixel = (uv[:, 1] * WIDTH + uv[:, 0])[inside]
            shown = np.full(WIDTH * HEIGHT, -1)
            shown[pixel] = candidates[inside]
            image = np.zeros(WIDTH * HEIGHT, np.uint8)
            image[np.add.outer(pixel, offsets)] = rng.integers(100, 255, (len(pixel), 9))
            image[pixel] = 255
            z = p[inside, 2]
            disparity = BASELINE_TIMES_FOCAL / z + rng.normal(scale=_PIXEL_NOISE, size=len(z))
            depth = np.zeros(WIDTH * HEIGHT, np.float32)
            measured = np.where(z < _DEPTH_LIMIT, BASELINE_TIMES_FOCAL / disparity, 0)
            depth[np.add.outer(pixel, offsets)] = measured[:, None]
            extraction = extractor.extract(image.reshape(shape))
            frame = core.build_rgbd_frame(context, k, k / 10.0, extraction, depth.reshape(shape))
            x, y = np.rint(extraction.keypoints[:, :2]).astype(np.int64).T
            point = shown[y * WIDTH + x]
            known, slots = np.unique(point, return_index=True)
            self.frames.append(frame)
            self.seen.append((known[known >= 0], slots[known >= 0]))


def _pose(R: Array, t: Array) -> core.Pose:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = R, t
    return core.Pose.from_matrix(matrix)
