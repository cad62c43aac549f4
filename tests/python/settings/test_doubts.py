# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that are allowed but cannot be: lenses and baselines."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    Settings,
    StereoRectification,
)

CAMERA = CameraSettings(120, 120, 95.5, 71.5, width=192, height=144)


def doubts(**values: float) -> list[str]:
    return Settings("mono", dataclasses.replace(CAMERA, **values)).doubts()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "values",
    [
        {"k1": -0.01, "k2": 0.05, "p1": -0.04, "p2": 0.01},  # of a fisheye lens, k3, k4
        {"k2": 0.001, "p1": -0.25},  # k1 at another place
        {"p2": 0.016},
    ],
)
def test_no_lens_is_so_tangential(values: dict[str, float]) -> None:
    (doubt,) = doubts(**values)
    assert "tangential distortion" in doubt
    assert "k3, k4 of a fisheye lens" in doubt


@pytest.mark.parametrize(
    ("values", "pixels"),
    [
        # r (1 + 7.5 r^2 - 540 r^4) turns at r = 0.1541, and is 0.1345 there.
        ({"k1": 7.5, "k2": -540.0}, 16),
        # r (1 - r^2) turns at r = 0.5774, and is 0.3849 there.
        ({"k1": -1.0}, 46),
        # r / (1 + r^2) turns at r = 1, and is 0.5 there.
        ({"k4": 1.0}, 60),
    ],
)
def test_a_lens_that_folds_the_image_over(values: dict[str, float], pixels: int) -> None:
    (doubt,) = doubts(**values)
    assert f"the distorted radius grows only up to {pixels} pixels" in doubt
    assert "corner is 119 pixels" in doubt
    # Without a size the image is twice as large as the principal point says.
    (unsized,) = doubts(**values, width=None, height=None)  # type: ignore[arg-type]
    assert f"up to {pixels} pixels" in unsized


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"k1": -0.28, "k2": 0.07, "p1": 0.0002},
        {"k1": 0.26, "k2": -0.95, "p1": 0.005, "p2": 0.0026, "k3": 1.16},
        {
            "k1": 0.45,
            "k2": -2.6,
            "k3": 1.5,
            "k4": 0.33,
            "k5": -2.4,
            "k6": 1.42,
            "fx": 160,
            "fy": 160,
        },
        {"k4": 1e-300, "k5": 1e-310, "k6": 1e-300},
        {"k1": -0.12},  # folds over, but beyond the corners
    ],
)
def test_lenses_that_can_be_are_not_doubted(values: dict[str, float]) -> None:
    assert doubts(**values) == []


def test_raw_cameras_of_a_pair_are_judged() -> None:
    P_right = np.array([[120, 0, 95.5, -12.0], [0, 120, 71.5, 0], [0, 0, 1, 0.0]])
    P = P_right * [1, 1, 1, 0]
    left, right = (
        CameraRectification(P[:, :3], np.array(D), np.eye(3), side, 192, 144)
        for D, side in (([0.0, 0, 0, 0], P), ([7.5, -540, 0.05, 0], P_right))
    )
    camera = dataclasses.replace(CAMERA, bf=12.0)
    pair = StereoRectification(left, right)
    found = Settings("stereo", camera, depth=DepthSettings(40), rectification=pair).doubts()
    assert len(found) == 2
    assert all(doubt.startswith("RIGHT: the ") for doubt in found)


@pytest.mark.parametrize(
    ("metres", "told"),
    [(100.0, "in millimetres?"), (10.1, "in millimetres?"), (0.00009, "pixel metres")],
)
def test_baselines_beyond_what_there_is(metres: float, told: str) -> None:
    camera = dataclasses.replace(CAMERA, bf=metres * 120)
    (doubt,) = Settings("stereo", camera, depth=DepthSettings(40)).doubts()
    assert f"is a baseline of {metres:.3g} m" in doubt
    assert told in doubt


@pytest.mark.parametrize("metres", [0.0002, 0.05, 9.9])
def test_baselines_of_microscopes_and_cranes(metres: float) -> None:
    camera = dataclasses.replace(CAMERA, bf=metres * 120)
    assert Settings("stereo", camera, depth=DepthSettings(40)).doubts() == []
