# SPDX-License-Identifier: BSD-3-Clause
"""A stereo pair that is one image twice is told, once."""

from __future__ import annotations

import logging

import numpy as np
import pytest

from orbslam2py import Sensor
from orbslam2py._timing import StageTimer
from orbslam2py.settings import builtin_settings
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.pair_check import N_CHECKED, PairCheck

PICTURE = np.random.default_rng(1).integers(0, 255, (480, 640), dtype=np.uint8)
OTHER = np.roll(PICTURE, 5, axis=1)
DARK = np.zeros_like(PICTURE)

Pair = tuple[np.ndarray, np.ndarray]


@pytest.mark.parametrize(
    ("pairs", "told"),
    [
        ([(PICTURE, PICTURE.copy())] * 3, 1),
        ([(PICTURE, OTHER), (PICTURE, PICTURE)], 1),
        ([(DARK, DARK)] * 9 + [(PICTURE, PICTURE)], 1),
        ([(PICTURE, OTHER)] * 9, 0),
        ([(DARK, DARK)] * 9, 0),
        ([(PICTURE, OTHER)] * N_CHECKED + [(PICTURE, PICTURE)], 0),
    ],
    ids=["at once", "second", "after the dark", "never", "dark", "too late"],
)
def test_one_image_twice_is_told_once(
    caplog: pytest.LogCaptureFixture, pairs: list[Pair], told: int
) -> None:
    check = PairCheck()
    with caplog.at_level(logging.WARNING):
        for pair in pairs:
            check.look(*pair)
    assert len(caplog.records) == told
    assert (check.warning is not None) == bool(told)


def test_the_front_end_warns_of_depth_that_will_be_wrong(caplog: pytest.LogCaptureFixture) -> None:
    front = FrontEnd(builtin_settings("euroc", "stereo"), Sensor.STEREO)
    with caplog.at_level(logging.WARNING):
        for number in range(4):
            front.stereo(PICTURE, PICTURE, number, float(number), StageTimer())
    assert caplog.text.count("give the images of both cameras") == 1
    assert front.depth_warning is not None
    assert "left and the right image of a pair are the same" in front.depth_warning
