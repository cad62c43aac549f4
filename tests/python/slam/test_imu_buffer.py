# SPDX-License-Identifier: BSD-3-Clause
"""Samples of an IMU that wait for their images: order, gaps, late ones, and what is said."""

from __future__ import annotations

import logging
import threading
import time
from typing import Any

import numpy as np
import pytest

from orbslam2py import DatasetError
from orbslam2py._arrays import FloatArray
from orbslam2py.slam.inertial import ImuBuffer

pytestmark = pytest.mark.watchdog(20)

RATE = 200.0


def samples(begin: float, end: float) -> FloatArray:
    """Readings that are linear in time: interpolation between them is exact."""
    t = np.round(np.arange(begin, end, 1 / RATE), 6)
    return np.column_stack([t, *(k * t for k in range(1, 7))])


def check_linear(rows: FloatArray, offset: float = 0.0) -> None:
    for k in range(1, 7):
        np.testing.assert_allclose(rows[:, k], k * (rows[:, 0] + offset), atol=1e-12)


def test_intervals_begin_and_end_at_their_images() -> None:
    buffer = ImuBuffer()
    buffer.add(samples(0, 1))
    assert buffer.take(0.1013) is None
    interval = buffer.take(0.1517)
    assert interval is not None and interval.is_complete
    assert (interval.begin, interval.end) == (0.1013, 0.1517)
    assert interval.samples[0, 0] == 0.1013
    assert interval.samples[-1, 0] == 0.1517
    np.testing.assert_allclose(interval.samples[1:-1, 0], np.arange(0.105, 0.1516, 0.005))
    check_linear(interval.samples)


def test_images_at_the_time_of_a_sample_do_not_repeat_it() -> None:
    buffer = ImuBuffer()
    buffer.add(samples(0, 1))
    buffer.take(0.1)
    interval = buffer.take(0.12)
    assert interval is not None
    np.testing.assert_allclose(interval.samples[:, 0], [0.1, 0.105, 0.11, 0.115, 0.12])


@pytest.mark.parametrize("rate", [50, 2000])
def test_the_time_offset_is_taken_off(rate: float) -> None:
    t = np.arange(0, 1, 1 / rate)
    buffer = ImuBuffer(time_offset=0.03)
    buffer.add(np.column_stack([t, *(k * t for k in range(1, 7))]))
    buffer.take(0.1)
    interval = buffer.take(0.2)
    assert interval is not None
    assert interval.samples[[0, -1], 0].tolist() == [0.1, 0.2]
    check_linear(interval.samples, offset=0.03)


def test_portions_in_any_order_give_the_same() -> None:
    whole, portions = ImuBuffer(), ImuBuffer()
    whole.add(samples(0, 1))
    for begin in (0.5, 0.0, 0.25, 0.75):
        portions.add(samples(begin, begin + 0.2499)[::-1])
    whole.take(0.1)
    portions.take(0.1)
    one, other = whole.take(0.9), portions.take(0.9)
    assert one == other


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def drop(first: int, last: int) -> FloatArray:
    rows = samples(0, 2)
    return np.delete(rows, np.s_[first:last], axis=0)


def spoil(place: Any, value: float) -> FloatArray:
    rows = samples(0, 2)
    rows[place] = value
    return rows


FAULTS: dict[str, tuple[FloatArray, str]] = {
    "gap": (drop(80, 120), "a gap of 0.205 s before the image of"),
    "repeated": (np.repeat(samples(0, 2), 2, axis=0), "repeat the time of another one"),
    "unsorted": (samples(0, 2)[np.arange(400) ^ 1], "out of order in time; they are sorted"),
    "not a number": (spoil((50, 4), np.nan), "1 samples of the IMU are not finite"),
    "infinite time": (spoil((50, 0), np.inf), "1 samples of the IMU are not finite"),
    "nanoseconds": (samples(100, 102) * ([1e9] + 6 * [1.0]), "give both in seconds on one clock"),
    "ended": (samples(0, 0.3), "a gap of"),
    "none": (np.zeros((0, 7)), "no samples of the IMU came"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_one_sentence_for_each_fault(name: str, caplog: pytest.LogCaptureFixture) -> None:
    rows, said = FAULTS[name]
    buffer = ImuBuffer()
    for begin in range(20):  # as a stream, a tenth of a second with each image
        buffer.add(rows[begin * len(rows) // 20 : (begin + 1) * len(rows) // 20])
        interval = buffer.take(0.1 * (begin + 1) - 0.001)
        assert interval is None or np.isfinite(interval.samples).all()
        assert interval is None or (np.diff(interval.samples[:, 0]) > 0).all()
    told = warnings_of(caplog)
    assert sum(said in one for one in told) == 1, told
    assert len(told) == len(set(told)) <= 2


def test_late_samples_are_left_out(caplog: pytest.LogCaptureFixture) -> None:
    buffer, rows = ImuBuffer(), samples(0, 2)
    for k in range(1, 10):
        buffer.add(rows[(rows[:, 0] > 0.1 * k - 0.4) & (rows[:, 0] <= 0.1 * k - 0.3)])
        buffer.take(0.1 * k)
    told = warnings_of(caplog)
    assert sum("came after the image that they belong to" in one for one in told) == 1
    # Samples that come in time again count.
    buffer.add(rows[rows[:, 0] > 0.5])
    interval = buffer.take(1.0)
    assert interval is not None and interval.is_complete
    check_linear(interval.samples)


def test_the_last_reading_serves_until_the_image(caplog: pytest.LogCaptureFixture) -> None:
    buffer, rows = ImuBuffer(), samples(0, 2)
    for k in range(10):  # no sample after the image comes with it
        at = 0.1 * k + 0.003
        buffer.add(rows[(rows[:, 0] <= at) & (rows[:, 0] > at - 0.1)])
        interval = buffer.take(at)
    assert interval is not None and interval.is_complete
    assert interval.samples[-1, 0] == at
    np.testing.assert_array_equal(interval.samples[-1, 1:], interval.samples[-2, 1:])
    assert not warnings_of(caplog)


def test_an_image_that_was_left_out_lengthens_the_interval() -> None:
    buffer = ImuBuffer()
    for k in range(10):
        buffer.add(samples(0.1 * k, 0.1 * k + 0.0999))
        if k in (2, 6):
            interval = buffer.take(0.1 * k + 0.05)
    assert interval is not None
    assert [interval.begin, interval.end] == pytest.approx([0.25, 0.65])
    assert len(interval.samples) == 81


def test_waiting_ends(caplog: pytest.LogCaptureFixture) -> None:
    buffer = ImuBuffer()
    buffer.add(samples(0, 0.5))
    begin = time.monotonic()
    assert buffer.wait_for(0.4, 5.0)
    assert not buffer.wait_for(0.7, 0.05)
    assert not buffer.wait_for(0.8, 5.0)  # nothing came before: not again
    assert time.monotonic() - begin < 2
    told = warnings_of(caplog)
    assert len(told) == 1 and "did not come within 0.05 s" in told[0]
    later = threading.Timer(0.05, buffer.add, [samples(0.5, 1.0)])
    buffer.add(samples(0.5, 0.81))
    assert buffer.wait_for(0.8, 5.0)
    later.start()
    assert buffer.wait_for(0.9, 5.0)
    later.join()


@pytest.mark.parametrize(
    "given", [np.zeros((5, 6)), np.zeros(3), "text", [[1, 2], [3]], {"t": 1}, 5.0, None]
)
def test_what_is_no_array_of_samples(given: Any) -> None:
    buffer = ImuBuffer()
    with pytest.raises(DatasetError, match=r"samples of the IMU.*\(n, 7\).*rad/s"):
        buffer.add(given)
