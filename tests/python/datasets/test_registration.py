# SPDX-License-Identifier: BSD-3-Clause
"""Depth of one camera at the pixels of another: against exact depth in a made-up scene."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets.registration import DepthRegistration, Lens

SMALL = (160, 120)
#: A slanted wall, and a board before its left half; both as n X = d in the depth camera.
WALL = (np.array([0.2, 0.1, 1.0]), 2.0)
BOARD = (np.array([0.0, 0.0, 1.0]), 1.0)
BOARD_ENDS = -0.1  # x of its right edge [m]


def lens(f: float, size: tuple[int, int] = SMALL, D: tuple[float, ...] = (0,) * 5) -> Lens:
    K = np.array([[f, 0, (size[0] - 1) / 2 + 1.5], [0, f * 1.01, (size[1] - 1) / 2], [0, 0, 1]])
    return Lens(K, np.array(D, np.float64), size)


def pose(turn: tuple[float, float, float], shift: tuple[float, float, float]) -> FloatArray:
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array(turn, np.float64))[0]
    T[:3, 3] = shift
    return T


def exact(camera: Lens, T_camera_depth: FloatArray, *, board: bool = True) -> FloatArray:
    """Depth [m] that a camera sees, by casting a ray through each pixel."""
    width, height = camera.size
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1).astype(np.float64)
    many = (cv2.TERM_CRITERIA_COUNT, 50, 0.0)
    plane = cv2.undistortPoints(pixels[:, None], camera.K, camera.D, criteria=many)[:, 0]
    rays = np.hstack([plane, np.ones((len(plane), 1))])
    R, t = T_camera_depth[:3, :3], T_camera_depth[:3, 3]
    found = np.full(len(rays), np.inf)
    for (n, d), ends in ((WALL, np.inf), (BOARD, BOARD_ENDS)):
        if ends < np.inf and not board:
            continue
        z = (d + n @ R.T @ t) / (rays @ (R @ n))
        points = (rays * z[:, None] - t) @ R  # in the depth camera
        hit = (z > 0) & (points[:, 0] < ends) & (z < found)
        found[hit] = z[hit]
    return found.reshape(height, width)


CASES = {
    "finer": (lens(100), lens(160), pose((0.01, -0.02, 0.01), (0.015, 0.002, -0.001))),
    "coarser": (lens(160), lens(100), pose((0, 0, 0), (-0.05, 0, 0))),
    "larger": (lens(100), lens(330, (480, 360)), pose((0, 0, 0), (0.015, 0, 0))),
    "bent": (
        lens(100),
        lens(150, D=(0.1, -0.2, 0.001, -0.002, 0.05)),
        pose((0.01, 0, 0), (0.02, 0, 0)),
    ),
    "rational": (
        lens(120, D=(0.5, -2.1, 4e-4, -2e-4, 1.2, 0.4, -1.9, 1.1)),
        lens(150, D=(0.5, -2.1, 4e-4, -2e-4, 1.2, 0.4, -1.9, 1.1)),
        pose((0.1, 0, 0), (-0.03, 0.004, 0.002)),
    ),
    "turned": (lens(100), lens(100), pose((0, 0, np.pi / 2), (0.01, 0.01, 0))),
}


@pytest.mark.parametrize("case", CASES)
def test_against_exact_depth(case: str) -> None:
    """On the slanted wall depth is right to what half a pixel of depth makes out."""
    depth, colour, T = CASES[case]
    raw = np.round(exact(depth, np.eye(4), board=False) * 1000).astype(np.uint16)
    found = DepthRegistration(depth, colour, T, 1000.0).register(raw)
    assert found.dtype == np.float32
    assert found.shape == colour.size[::-1]
    known = found > 0
    errors = np.abs(found / 1000 - exact(colour, T, board=False))[known]
    assert np.median(errors) < 0.003
    assert errors.max() < 0.02
    assert known[30:-30, 45:-45].all()  # no holes


@pytest.mark.parametrize("shift", [0.015, -0.03])
def test_nearest_wins(shift: float) -> None:
    """Of a board before a wall each pixel has one of the two, never something in between."""
    depth, colour, T = lens(100), lens(160), pose((0.01, -0.02, 0.01), (shift, 0.002, 0.0))
    raw = np.round(exact(depth, np.eye(4)) * 1000).astype(np.uint16)
    found = DepthRegistration(depth, colour, T, 1000.0).register(raw) / 1000
    true = exact(colour, T)
    known = found > 0
    right = np.abs(found - true) < 0.02
    assert right[known].mean() > 0.98
    wrong = np.argwhere(known & ~right)
    edge = np.argmax(np.diff(true, axis=1) > 0.3, axis=1)
    assert np.abs(wrong[:, 1] - edge[wrong[:, 0]]).max(initial=0) <= 3  # only beside the edge
    # To the right of the depth camera, the colour camera sees a strip of wall behind the board.
    strip = (~known[20:-20, 20:-20]).sum(axis=1)
    assert (strip.min() >= 1 and strip.max() <= 5) if shift < 0 else not strip.any()
    on_board = true < 1.2
    assert (found[on_board & known] < 1.2).mean() > 0.98  # all but a pixel at the edge


def test_what_is_no_depth() -> None:
    """NaN, infinity, negative numbers and 0 are none; single holes in a surface are filled."""
    depth, colour, T = lens(100), lens(100), np.eye(4)
    raw = np.full((120, 160), 2.0, np.float32)
    raw[10:20, 10:20] = np.nan
    raw[40:50, 10:20] = np.inf
    raw[70:80, 10:20] = -1
    raw[90:100, 10:20] = 0
    raw[60, 100] = 0
    found = DepthRegistration(depth, colour, T, 1.0).register(raw)
    for rows in (slice(12, 18), slice(42, 48), slice(72, 78), slice(92, 98)):
        assert not found[rows, 12:18].any()
    assert found[60, 100] == 2
    assert np.isfinite(found).all()
    assert set(np.unique(found)) == {0, 2}


def test_nothing_at_all() -> None:
    depth, colour, T = CASES["finer"]
    registration = DepthRegistration(depth, colour, T, 1000.0)
    assert not registration.register(np.zeros((120, 160), np.uint16)).any()
    behind = DepthRegistration(depth, colour, pose((0, np.pi, 0), (0, 0, 0)), 1000.0)
    assert not behind.register(np.full((120, 160), 900, np.uint16)).any()


def test_points_far_aside_do_not_fold_back() -> None:
    """Distortion is a polynomial: far outside of the image it may lead back into it."""
    depth = lens(40)  # sees more than twice as much as the colour camera
    colour = lens(150, D=(-0.3, 0.0, 0.0, 0.0, 0.0))
    raw = np.full((120, 160), 2000, np.uint16)
    raw[:, :30] = raw[:, -30:] = 500  # seen by the depth camera alone
    found = DepthRegistration(depth, colour, np.eye(4), 1000.0).register(raw)
    assert set(np.unique(found)) == {2000}


def test_another_size() -> None:
    depth, colour, T = CASES["finer"]
    with pytest.raises(orb.ImageError, match=r"depth is 80 x 60, but the calibration .* 160 x 120"):
        DepthRegistration(depth, colour, T, 1000.0).register(np.ones((60, 80), np.uint16))
