# SPDX-License-Identifier: BSD-3-Clause
"""Depth images whose numbers do not fit the factor of the settings are told."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest

from orbslam2py import Sensor
from orbslam2py._timing import StageTimer
from orbslam2py.settings import builtin_settings
from orbslam2py.settings.depth_check import N_CHECKED, N_LOOKED_AT, DepthCheck, doubt_of_tum_factor
from orbslam2py.slam import front_end
from orbslam2py.slam.front_end import FrontEnd
from support.small_sequences import images, sequence


def depths(median: float, dtype: str = "u2") -> npt.NDArray[np.generic]:
    """A depth image around a raw value, a third of it unknown."""
    raw = np.linspace(0.5, 1.5, 60 * 80).reshape(60, 80) * median
    raw[::3] = 0
    return raw.astype(dtype)


def told(
    factor: float, *shown: npt.NDArray[np.generic], log: pytest.LogCaptureFixture
) -> list[str]:
    check = DepthCheck(factor)
    with log.at_level(logging.WARNING):
        for depth in shown:
            check.look(depth)
    return [record.getMessage() for record in log.records]


@pytest.mark.parametrize(
    ("median", "dtype", "factor", "advice"),
    [
        (1430, "u2", 1, "DepthMapFactor: 1000"),
        (1430, "i4", 1, "DepthMapFactor: 1000"),
        (9000, "u2", 1, "DepthMapFactor: 5000"),
        (1.43, "f4", 1000, "DepthMapFactor: 1"),
        (1.43, "f8", 5000, "DepthMapFactor: 1"),
        (1430, "f4", 1, "DepthMapFactor: 1000"),
        (1430, "u2", 1e6, "DepthMapFactor: 1000"),
    ],
)
def test_a_wrong_factor_is_told_with_the_right_one(
    caplog: pytest.LogCaptureFixture, median: float, dtype: str, factor: float, advice: str
) -> None:
    (message,) = told(factor, *[depths(median, dtype)] * 9, log=caplog)
    assert f"DepthMapFactor {factor:g}" in message
    assert f"{advice} " in f"{message} "


def test_depth_beyond_every_usual_factor_is_told(caplog: pytest.LogCaptureFixture) -> None:
    (message,) = told(1, depths(3e7, "f8"), log=caplog)
    assert "DepthMapFactor: 1e+07" in message


@pytest.mark.parametrize(
    ("median", "dtype", "factor"),
    [(1430, "u2", 1000), (7000, "u2", 5000), (1.43, "f4", 1), (55, "f4", 1), (60, "u1", 100)],
)
def test_fitting_depth_is_silent(
    caplog: pytest.LogCaptureFixture, median: float, dtype: str, factor: float
) -> None:
    assert told(factor, *[depths(median, dtype)] * 9, log=caplog) == []


@pytest.mark.parametrize(
    "depth",
    [
        np.zeros((60, 80), np.uint16),
        np.full((60, 80), 65535, np.uint16),
        np.full((60, 80), np.nan, np.float32),
        np.full((60, 80), np.inf),
        np.full((60, 80), -1.0, np.float32),
    ],
)
def test_unknown_depth_says_nothing_and_does_not_count(
    caplog: pytest.LogCaptureFixture, depth: npt.NDArray[np.generic]
) -> None:
    assert told(1, *[depth] * 30, log=caplog) == []
    (message,) = told(1, *[depth] * 30, depths(1430), log=caplog)
    assert "DepthMapFactor: 1000" in message


def test_it_is_over_after_a_few_images() -> None:
    check = DepthCheck(1000.0)
    for i in range(N_CHECKED):
        assert not check.done, i
        check.look(depths(1430))
    assert check.done


def test_a_camera_without_depth_is_not_looked_at_for_ever() -> None:
    check = DepthCheck(1000.0)
    for i in range(N_LOOKED_AT):
        assert not check.done, i
        check.look(np.zeros((60, 80), np.uint16))
    assert check.done


def test_sparse_depth_is_seen(caplog: pytest.LogCaptureFixture) -> None:
    """As of a laser: a column in 8, a row in 4."""
    sparse = np.zeros((480, 640), np.uint16)
    sparse[::4, ::8] = 1430
    (message,) = told(1, sparse, log=caplog)
    assert "DepthMapFactor: 1000" in message


def test_front_end_looks_at_the_first_images_only(monkeypatch: pytest.MonkeyPatch) -> None:
    looked = []

    class Counting(DepthCheck):
        def look(self, depth: npt.NDArray[np.generic]) -> None:
            looked.append(depth)
            super().look(depth)

    monkeypatch.setattr(front_end, "DepthCheck", Counting)
    front = FrontEnd(builtin_settings("tum1", Sensor.RGBD), Sensor.RGBD)
    depth = np.full((64, 64), 7000, np.uint16)
    image = np.zeros((64, 64), np.uint8)
    for i in range(N_CHECKED + 3):
        front.rgbd(image, depth, i, i / 30, StageTimer())
    assert len(looked) == N_CHECKED


def test_front_end_changes_nothing(caplog: pytest.LogCaptureFixture) -> None:
    """The frame is that of the factor given, and the depth image stays as it was."""
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    depth = shown.depth.copy()
    settings = sequence(Sensor.RGBD).settings
    assert settings.depth is not None
    wrong = replace(settings, depth=replace(settings.depth, raw_per_metre=1.0))
    with caplog.at_level(logging.WARNING):
        frame = FrontEnd(wrong, Sensor.RGBD).rgbd(shown.image, depth, 0, 0.0, StageTimer())
    assert "DepthMapFactor" in caplog.text
    right = FrontEnd(settings, Sensor.RGBD).rgbd(shown.image, depth, 0, 0.0, StageTimer())
    known = right.depth > 0
    np.testing.assert_allclose(frame.depth[known], 5000 * right.depth[known], rtol=1e-5)
    np.testing.assert_array_equal(depth, shown.depth)


def test_the_median_is_kept_in_metres() -> None:
    check = DepthCheck(1000)
    assert check.median is None
    for median in (1800, 1880, 1900):
        check.look(depths(median))
    assert check.median == pytest.approx(1.88, rel=0.02)


@pytest.mark.parametrize(
    ("factor", "median", "doubted"),
    [(5000, 0.38, True), (5000, 0.6, False), (1000, 0.38, False), (5000, None, False)],
)
def test_the_factor_of_tum_is_doubted(factor: float, median: float | None, doubted: bool) -> None:
    doubt = doubt_of_tum_factor(factor, median)
    assert (doubt is not None) == doubted
    if doubt is not None:
        assert "0.38 m with DepthMapFactor 5000" in doubt
        assert "DepthMapFactor: 1000 makes it 1.90 m" in doubt


@pytest.mark.parametrize("raw", [1e308, 5e-324, 3e38])
def test_depth_of_absurd_numbers_is_told(caplog: pytest.LogCaptureFixture, raw: float) -> None:
    (message,) = told(1000, np.full((60, 80), raw), log=caplog)
    assert "do not fit DepthMapFactor 1000" in message
