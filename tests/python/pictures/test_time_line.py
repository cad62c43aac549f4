# SPDX-License-Identifier: BSD-3-Clause
"""What became of the images over time, as a picture."""

import numpy as np
import pytest

from orbslam2py import Reason, TrackingRecord, TrackingState
from orbslam2py._palette import FRAME, KEYFRAME, LOOP, LOST, MAPPED, NOT_TRACKED, NOW
from orbslam2py.pictures import GrowingHistory, History, draw_time_line

SIZE = (900, 120)


def record(seconds, state=TrackingState.OK, **more):
    values = {"n_matches": 120, "n_inliers": 100, "is_keyframe": False, **more}
    return TrackingRecord(
        frame_id=0, timestamp=seconds, map_index=0, state=state, reason=Reason.NONE, T_cw=None,
        covariance=None, reference_keyframe=0, **values,
    )  # fmt: skip


def columns(picture, colour):
    """Columns in which a colour is, relative to the whole width."""
    same = (np.abs(picture.astype(int) - colour).max(axis=2) < 12).any(axis=0)
    return np.flatnonzero(same)


def test_states_stand_where_they_were():
    history = GrowingHistory(duration=10.0)
    for i in range(101):
        lost = 50 <= i < 60
        history.add(record(1000 + 0.1 * i, TrackingState.LOST if lost else TrackingState.OK))
    picture = draw_time_line(history.picture(), SIZE)
    good = columns(picture, MAPPED)
    left, right = good.min(), good.max()
    bad = columns(picture, LOST)
    assert (bad.min() - left) / (right - left) == pytest.approx(0.5, abs=0.01)
    assert (bad.max() - left) / (right - left) == pytest.approx(0.6, abs=0.01)
    strip = picture[5:25]
    assert not np.intersect1d(columns(strip, LOST), columns(strip, MAPPED)).size


def test_one_lost_image_of_thousands_is_not_hidden():
    history = GrowingHistory()
    for i in range(5000):
        history.add(record(float(i), TrackingState.LOST if i == 2500 else TrackingState.OK))
    assert columns(draw_time_line(history.picture(), SIZE), LOST).size


def test_keyframes_loops_and_now_stand_where_they_were():
    history = GrowingHistory(duration=20.0)
    for i in range(101):
        history.add(record(5 + 0.1 * i, is_keyframe=i == 25))
    history.add_loop(5 + 7.5)
    picture = draw_time_line(history.picture(), SIZE)
    begin = columns(picture, MAPPED).min()
    end = columns(picture, FRAME).max()

    def along(colour):
        return (np.median(columns(picture, colour)) - begin) / (end - begin)

    assert along(KEYFRAME) == pytest.approx(2.5 / 20, abs=0.01)
    now = picture[:100, begin + 1 :]
    whole = np.flatnonzero((now == NOW).all(axis=2).sum(axis=0) > 50)
    assert whole.min() / (end - begin) == pytest.approx(10 / 20, abs=0.01)
    stem = picture[60:80]
    first_of_loop = columns(stem, LOOP).min()
    assert (first_of_loop - begin) / (end - begin) == pytest.approx(7.5 / 20, abs=0.01)


def test_images_that_were_not_used_are_told_apart():
    history = GrowingHistory()
    history.add(record(0.0))
    history.add_unused(0.5)
    history.add(record(1.0))
    assert columns(draw_time_line(history.picture(), SIZE)[5:25], NOT_TRACKED).size


@pytest.mark.parametrize("size", [(900, 120), (700, 400), (200, 40), (60, 20)])
@pytest.mark.parametrize("n", [0, 1, 2, 300])
def test_any_size_and_length(size, n):
    seconds = np.arange(n) * 0.1
    history = History(
        seconds=seconds,
        states=np.full(n, int(TrackingState.OK)),
        inliers=np.full(n, 300.0),
        milliseconds=np.full(n, 20.0),
        loops=seconds[:1],
    )
    assert draw_time_line(history, size).shape == (size[1], size[0], 3)
