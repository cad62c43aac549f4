# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of a run with the ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.holding_on.play import Flags, Played
from benchmarks.holding_on.scene import Floats
from benchmarks.holding_on.start import StartFigures, judge_start
from orbslam2py.settings import Sensor
from orbslam2py.trajectory import align
from orbslam2py.trajectory.rotations import inverse_poses

MANY_DEVIATIONS = 5.0
FAR, TURNED = 0.2, np.radians(1.0)  # metres, from frame to frame
_SCALE_FRAMES = 10  # on either side, over which the scale of a single camera is measured


@dataclass(frozen=True)
class Figures:
    """Counts of a run; the names are the columns of the CSV file."""

    frames: int
    lasted: float
    """Seconds from the first frame to the last."""
    tracked: int
    """Frames with a pose ..."""
    trackable: int
    """... of these many that could have one: nothing over the lens, and a map begun."""
    compared: int
    """Poses compared with the frame before."""
    wrong: int
    """Of these off by more than 5 deviations, and by more than 0.2 m or 1 degree."""
    wrong_keyframes: int
    """Of these keyframes."""
    wrong_before: int
    """Of these, right relative to the present pose of the frame before: it was adjustment that
    moved the map between them."""
    path_compared: int
    """Poses of the last map's final path compared with the frame before."""
    path_off: int
    """Of these off by more than 0.2 m or 1 degree, whatever its covariance: a path has no
    deviations."""
    losses: int
    """Losses after which a mapped place came into view ..."""
    found: int
    """... and that were over within a second of that."""
    left_view: int
    """Of the others, those in which no mapped place was in view for the whole of that second."""
    rotation_spread: float
    """Spread of the error from frame to frame in units of its stated deviation (1: consistent)."""
    translation_spread: float
    maps: int
    ate: float
    """Metres; of the last map's final path."""
    with_imu: int
    """Frames of which the IMU had a state."""
    loops: int
    seconds: float
    enough_parallax: float
    """Single camera: seconds until the views allowed a start, NaN if they never did."""
    started: float
    """Seconds until there was a map, NaN without one."""
    wrong_starts: int
    """Maps whose first 30 frames are off by more than 10 % of their length."""


def judge(played: Played) -> Figures:
    """Compare a run with the truth."""
    monocular = played.scene.sensor is Sensor.MONOCULAR
    start = judge_start(played) if monocular else StartFigures.of_depth(played)
    compared = consecutive(played)
    scale = np.ones(len(played.posed))
    if monocular:
        scale = local_scale(played.truth, played.T_cw, played.map_index, compared)
    told = relative(played.T_cw, compared)
    error, deviation = errors_between_frames(played, compared, told, scale)
    by_now, _ = errors_between_frames(played, compared, played.motion[compared], scale)
    wrong = np.zeros(len(played.posed), bool)
    wrong[compared] = is_wrong(error, deviation)
    wrong_before = wrong.copy()
    known = np.isfinite(played.motion[compared]).all(axis=(1, 2))
    wrong_before[compared] &= known & ~is_wrong(by_now, deviation)
    path_error = errors_of_path(played, with_scale=monocular)
    losses, found, left_view = found_again(played)
    trackable = ~played.covered & started_by_now(played, monocular)
    return Figures(
        frames=len(played.posed),
        lasted=float(played.scene.timestamps[-1] - played.scene.timestamps[0]),
        tracked=int((played.posed & trackable).sum()),
        trackable=int(trackable.sum()),
        compared=len(compared),
        wrong=int(wrong.sum()),
        wrong_keyframes=int((wrong & played.keyframe).sum()),
        wrong_before=int(wrong_before.sum()),
        path_compared=len(path_error),
        path_off=int((path_error > limits_of_path(played)).any(axis=1).sum()),
        losses=losses,
        found=found,
        left_view=left_view,
        rotation_spread=spread(error[:, :3], deviation[:, :3, :3]),
        translation_spread=spread(error[:, 3:], deviation[:, 3:, 3:]),
        maps=len(np.unique(played.map_index[played.posed])),
        ate=absolute_error(played, with_scale=monocular),
        with_imu=int(played.with_imu.sum()),
        loops=played.loops,
        seconds=played.seconds,
        enough_parallax=start.enough_parallax,
        started=start.started,
        wrong_starts=start.wrong,
    )


def started_by_now(played: Played, monocular: bool) -> Flags:
    """Frames from which on there is a map: with a single camera its start is judged apart."""
    if not monocular:
        return np.ones(len(played.posed), bool)
    return np.asarray(np.cumsum(played.posed) > 0)


# ---- from frame to frame -------------------------------------------------------------------------
def consecutive(played: Played) -> NDArray[np.int64]:
    """Frames (m,) whose pose can be compared with that of the frame before, in one map.

    A loop moves the map between two frames; that is no error of the second.
    """
    both = played.posed[1:] & played.posed[:-1]
    same = played.map_index[1:] == played.map_index[:-1]
    same &= played.truth_part[1:] == played.truth_part[:-1]
    known = np.isfinite(played.covariance) & np.isfinite(played.truth[:, :1, :1])
    stated: Flags = np.asarray(known.all(axis=(1, 2)))
    fine = both & same & ~played.changed[1:] & ~played.changed[:-1] & stated[1:] & stated[:-1]
    return np.flatnonzero(fine) + 1


def relative(T_cw: Floats, frames: NDArray[np.int64]) -> Floats:
    """Motions (m, 4, 4) from the frames before to these."""
    return np.asarray(T_cw[frames] @ inverse_poses(T_cw[frames - 1]))


def local_scale(
    truth: Floats, T_cw: Floats, map_index: NDArray[np.int64], frames: NDArray[np.int64]
) -> Floats:
    """Metres per unit of a single camera's map, (n,): the median over the frames around each."""
    true = np.linalg.norm(relative(truth, frames)[:, :3, 3], axis=1)
    told = np.linalg.norm(relative(T_cw, frames)[:, :3, 3], axis=1)
    moving = (true > 1e-3) & (told > 1e-9)
    scale = np.full(len(truth), np.nan)
    for frame in frames:
        near = moving & (np.abs(frames - frame) <= _SCALE_FRAMES)
        near &= map_index[frames] == map_index[frame]
        if near.any():
            scale[frame] = np.median(true[near] / told[near])
    usual = np.nanmedian(scale) if np.isfinite(scale).any() else 1.0
    return np.where(np.isfinite(scale), scale, usual)


def errors_between_frames(
    played: Played, frames: NDArray[np.int64], motion: Floats, scale: Floats
) -> tuple[Floats, Floats]:
    """Errors (m, 6) of motions from the frames before, and their stated covariance (m, 6, 6).

    Rotation [rad], then translation [m], in the camera's frame. The covariance is that of this
    pose and of the one before, carried over, for a frame's own says how well it lies in the map;
    and that of the truth.
    """
    told = motion.copy()
    told[:, :3, 3] *= scale[frames, None]
    error = errors_of_motions(told, relative(played.truth, frames))
    here = in_metres(played.covariance[frames], scale[frames])
    before = in_metres(played.covariance[frames - 1], scale[frames])
    carry = adjoint(told)
    of_truth = np.diag(played.scene.truth_variance)
    return error, here + carry @ before @ np.swapaxes(carry, 1, 2) + of_truth


def errors_of_motions(told: Floats, true: Floats) -> Floats:
    """Errors (m, 6) of motions (m, 4, 4): rotation [rad], then translation [m]."""
    gap = true @ inverse_poses(told)
    error = np.zeros((len(gap), 6))
    for k, T in enumerate(gap):
        error[k, :3] = cv2.Rodrigues(T[:3, :3])[0].ravel()
    error[:, 3:] = gap[:, :3, 3]
    return error


def path_known(played: Played) -> Flags:
    """Frames (n,) of the final path whose true pose is known."""
    return np.asarray(np.isfinite(played.path + played.truth).all(axis=(1, 2)))


def errors_of_path(played: Played, *, with_scale: bool) -> Floats:
    """Angles [rad] and distances [m], (m, 2), of the final path's motions from frame to frame."""
    known = path_known(played)
    same = played.truth_part[1:] == played.truth_part[:-1]
    frames = np.flatnonzero(known[1:] & known[:-1] & same) + 1
    T_cw = np.full_like(played.path, np.nan)
    T_cw[known] = inverse_poses(played.path[known])
    told = relative(T_cw, frames)
    if with_scale and len(frames):
        one_map = np.zeros(len(T_cw), np.int64)
        told[:, :3, 3] *= local_scale(played.truth, T_cw, one_map, frames)[frames, None]
    error = errors_of_motions(told, relative(played.truth, frames))
    return np.linalg.norm(error.reshape(-1, 2, 3), axis=2)


def limits_of_path(played: Played) -> Floats:
    """Angle [rad] and distance [m] from which on a motion is off, with room for the truth's own."""
    of_truth = np.sqrt(played.scene.truth_variance[[0, 3]])
    return np.asarray([TURNED, FAR] + MANY_DEVIATIONS * of_truth)


def in_metres(covariance: Floats, scale: Floats) -> Floats:
    units = np.ones((len(scale), 6))
    units[:, 3:] = scale[:, None]
    return np.asarray(covariance * units[:, :, None] * units[:, None, :])


def adjoint(T: Floats) -> Floats:
    """Adjoint maps (m, 6, 6) of motions (m, 4, 4), for tangents (rotation, translation)."""
    carry = np.zeros((len(T), 6, 6))
    R, t = T[:, :3, :3], T[:, :3, 3]
    cross = np.zeros((len(T), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -t[:, 2], t[:, 1], -t[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    carry[:, :3, :3] = carry[:, 3:, 3:] = R
    carry[:, 3:, :3] = cross @ R
    return carry


def is_wrong(error: Floats, covariance: Floats) -> Flags:
    """Off by more than five deviations, and by more than 0.2 m or 1 degree, (m,)."""
    rotation = off(error[:, :3], covariance[:, :3, :3], TURNED)
    return rotation | off(error[:, 3:], covariance[:, 3:, 3:], FAR)


def off(error: Floats, covariance: Floats, limit: float) -> Flags:
    """Whether errors (m, 3) exceed a limit and five deviations in their own direction, (m,)."""
    size = np.linalg.norm(error, axis=1)
    direction = error / np.maximum(size, 1e-300)[:, None]
    variance = np.einsum("mi,mij,mj->m", direction, covariance, direction)
    return np.asarray((size > limit) & (size > MANY_DEVIATIONS * np.sqrt(np.maximum(variance, 0))))


def spread(error: Floats, covariance: Floats) -> float:
    """Half of the middle 68 % of the errors (m, 3) in units of their deviations; NaN for few."""
    deviation = np.sqrt(np.einsum("mii->mi", covariance))
    known = (deviation > 0).all(axis=1)
    units = (error[known] / deviation[known]).ravel()
    if len(units) < 30:
        return float("nan")
    low, high = np.percentile(units, [15.87, 84.13])
    return float(high - low) / 2


# ---- losses --------------------------------------------------------------------------------------
_ALIKE = np.cos(np.radians(20.0))


def found_again(played: Played) -> tuple[int, int, int]:
    """Losses after which a mapped place came into view, and how many were over within a second.

    Last, how many were not, of which no mapped place stayed in view for that second.
    """
    fps = max(1, round(played.scene.fps))
    n = len(played.posed)
    losses = found = left_view = 0
    for k in np.flatnonzero(played.posed[:-1] & ~played.posed[1:]) + 1:
        in_view = [
            j for j in range(k, n) if not played.covered[j] and mapped_place(played, int(k), j)
        ]
        if not in_view:
            continue
        until = min(n, in_view[0] + fps + 1)
        again = played.posed[k:until] & (played.map_index[k:until] == played.map_index[k - 1])
        if not again.any() and in_view[0] + fps >= n:
            continue  # the sequence ended first
        losses += 1
        found += bool(again.any())
        stayed = in_view[: fps + 1] == list(range(in_view[0], until))
        left_view += not again.any() and not stayed
    return losses, found, left_view


def mapped_place(played: Played, lost: int, frame: int) -> bool:
    """Whether a frame sees what one sees that was tracked in the map before it was lost."""
    before = np.flatnonzero(played.posed[:lost])
    before = before[played.map_index[before] == played.map_index[lost - 1]]
    T_wc = inverse_poses(played.truth[[*before, frame]])
    near = np.linalg.norm(T_wc[:-1, :3, 3] - T_wc[-1, :3, 3], axis=1) < played.scene.near
    return bool((near & (T_wc[:-1, :3, 2] @ T_wc[-1, :3, 2] > _ALIKE)).any())


# ---- the whole -----------------------------------------------------------------------------------
def absolute_error(played: Played, *, with_scale: bool) -> float:
    """RMSE [m] of the last map's final path, aligned; NaN with fewer than three poses."""
    known = path_known(played)
    if known.sum() < 3:
        return float("nan")
    points = played.path[known][:, :3, 3]
    targets = inverse_poses(played.truth[known])[:, :3, 3]
    moved = align(points, targets, with_scale=with_scale).apply(points)
    return float(np.sqrt(np.mean(np.sum((moved - targets) ** 2, axis=1))))
