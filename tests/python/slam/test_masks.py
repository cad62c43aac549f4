# SPDX-License-Identifier: BSD-3-Clause
"""Masks given to the track calls: what they hide, and wrong ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from orbslam2py import ImageError, Sensor, System, TrackingRecord, TrackingState
from orbslam2py.settings.sensor import WITHOUT_RIG
from support.feeding import feed
from support.small_sequences import images, new_system

pytestmark = pytest.mark.watchdog(30)

HEIGHT, WIDTH = 240, 320
EVERYTHING = np.full((HEIGHT, WIDTH), 255, np.uint8)
LEFT_HALF = EVERYTHING.copy()
LEFT_HALF[:, : WIDTH // 2] = 0


@pytest.fixture(params=WITHOUT_RIG)
def sensor(request: pytest.FixtureRequest) -> Sensor:
    return Sensor(request.param)


def track(system: System, index: int, mask: Any) -> TrackingRecord:
    return feed(system, images(system.sensor, index), index / 20, mask=mask, details=True)


def columns(record: TrackingRecord) -> np.ndarray:
    assert record.features is not None
    return record.features.keypoints[:, 0]


def test_no_keypoint_where_the_mask_is_zero(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        assert (columns(track(system, 0, LEFT_HALF)) > WIDTH // 2 - 1).all()
        assert (columns(track(system, 1, None)) < WIDTH // 2 - 1).any(), "of this image only"


def test_a_mask_that_hides_nothing_changes_nothing(sensor: Sensor) -> None:
    found = []
    for mask in (None, EVERYTHING):
        with new_system(sensor, deterministic=True) as system:
            found.append(columns(track(system, 0, mask)))
    np.testing.assert_array_equal(*found)


def test_everything_hidden(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        record = track(system, 0, 0 * EVERYTHING)
        assert record.state is TrackingState.NOT_INITIALIZED
        assert len(columns(record)) == 0


@pytest.mark.parametrize("pair", [(LEFT_HALF, None), (None, LEFT_HALF), (None, None)])
def test_masks_of_a_pair(pair: tuple[Any, Any]) -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        record = track(system, 0, pair)
        assert (columns(record) < WIDTH // 2 - 1).any() == (pair[0] is None)
        assert record.features is not None
        seen = record.features.depths > 0
        if pair[1] is not None:  # what is hidden in the right image gives no depth
            assert (columns(record)[seen] > WIDTH // 2 - 1).all()
        assert seen.any()


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (
            EVERYTHING[:-1],
            r"mask has shape \(239, 320\); it must be that of the image, \(240, 320\)",
        ),
        (EVERYTHING.T, r"mask has shape \(320, 240\)"),
        (np.stack([EVERYTHING] * 3, axis=2), r"mask has shape \(240, 320, 3\)"),
        (EVERYTHING > 0, "mask must be a NumPy array of uint8 .*got bool"),
        (EVERYTHING.astype(np.float32), "got float32"),
        (EVERYTHING.tolist(), "got list"),
        ("mask.png", "got str"),
    ],
)
def test_wrong_masks(sensor: Sensor, mask: Any, message: str) -> None:
    with new_system(sensor, deterministic=True) as system:
        with pytest.raises(ImageError, match=message):
            track(system, 0, mask)
        record = track(system, 0, LEFT_HALF)  # nothing has changed, not even the time
        assert record.frame_id == 0


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_wrong_one_of_a_pair_is_named(side: str) -> None:
    wrong = EVERYTHING[:, :-1]
    pair = (wrong, None) if side == "left" else (EVERYTHING, wrong)
    with (
        new_system(Sensor.STEREO, deterministic=True) as system,
        pytest.raises(ImageError, match=f"{side} mask"),
    ):
        track(system, 0, pair)


@pytest.mark.parametrize("masks", [(), (EVERYTHING,), (EVERYTHING,) * 3])
def test_a_pair_has_two(masks: tuple[Any, ...]) -> None:
    with (
        new_system(Sensor.STEREO, deterministic=True) as system,
        pytest.raises(ImageError, match="two"),
    ):
        track(system, 0, masks)


def test_a_mask_that_is_not_contiguous(sensor: Sensor) -> None:
    wide = np.zeros((HEIGHT, 2 * WIDTH), np.uint8)
    wide[:, ::2] = LEFT_HALF
    found = []
    for mask in (wide[:, ::2], LEFT_HALF):
        with new_system(sensor, deterministic=True) as system:
            found.append(columns(track(system, 0, mask)))
    np.testing.assert_array_equal(*found)
