# SPDX-License-Identifier: BSD-3-Clause
"""Numbers that no float holds, paths that are none, transforms that are no poses."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arguments import finite_number, float_of, is_finite, path_of, patience_of, pose_of

HUGE = 10**400


@pytest.mark.parametrize("value", [0, -1.5, 10**300, Fraction(1, 3), np.float32(2), np.int64(3)])
def test_numbers_that_a_float_holds(value: Any) -> None:
    assert is_finite(value)
    assert finite_number(value, "it", "a number") == float(value)


@pytest.mark.parametrize(
    "value",
    [HUGE, -HUGE, Fraction(HUGE), math.nan, math.inf, True, "1", None, 1j, 10**5000],
    ids=lambda value: type(value).__name__,
)
def test_what_is_no_finite_number(value: Any) -> None:
    assert not is_finite(value)
    with pytest.raises(orb.SettingsError, match=r"^it is .*; give a number$") as told:
        finite_number(value, "it", "a number")
    assert len(str(told.value)) < 100


def test_too_large_is_infinite() -> None:
    assert (float_of(HUGE), float_of(-HUGE)) == (math.inf, -math.inf)


@pytest.mark.parametrize("timeout", [HUGE, -1, -HUGE, math.nan, "1"])
def test_a_time_that_nobody_can_wait(timeout: Any) -> None:
    with pytest.raises(orb.StateError, match=r"timeout is .*; give seconds from 0"):
        patience_of(timeout)


def test_settings_of_numbers_that_are_too_large() -> None:
    with pytest.raises(orb.SettingsError, match=r"Camera\.fx is not finite.*Camera\.fps"):
        orb.CameraSettings(HUGE, 500, 320, 240, fps=HUGE)
    with pytest.raises(orb.SettingsError, match="new_map_after"):
        orb.System("tum1", "mono", new_map_after=HUGE)


# ---- paths ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("path", ["a~", "~/a.yaml", "~", "~nobody-of-this-name/a"])
def test_a_wave_is_for_the_shell(path: str) -> None:
    """Who checks a path and who writes it must mean the same file."""
    assert path_of(path, "it") == Path(path)


@pytest.mark.parametrize("path", ["", "a\0b", Path("a\0b")])
def test_names_of_no_file(path: str | Path) -> None:
    with pytest.raises(orb.DatasetError, match=r"^it is '.*', which is the name of no file; give"):
        path_of(path, "it")


# ---- poses ---------------------------------------------------------------------------------------
MIRROR = np.diag([1.0, 1, -1, 1])
SCALED = np.diag([1.1, 1.1, 1.1, 1])
ROUNDED = np.round([[0.8, -0.6, 0, 1], [0.6, 0.8, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], 3)


@pytest.mark.parametrize(
    "T",
    [MIRROR, SCALED, np.ones((4, 4)), np.zeros((4, 4)), np.full((4, 4), 1e200), np.eye(4) * np.nan],
    ids=["mirror", "scaled", "ones", "zeros", "overflow", "nan"],
)
def test_transforms_that_are_no_poses(T: np.ndarray) -> None:
    with pytest.raises(orb.SettingsError, match=r"^T_cw "):
        pose_of(T, "T_cw")
    with pytest.raises(orb.SettingsError, match=r"^T_cw "):
        orb.CameraSettings(500, 500, 320, 240).project([[0, 0, 1]], T)  # type: ignore[arg-type]


def test_rounded_poses_are_taken() -> None:
    np.testing.assert_array_equal(pose_of(ROUNDED.tolist(), "T_cw"), ROUNDED)
