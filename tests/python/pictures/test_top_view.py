# SPDX-License-Identifier: BSD-3-Clause
"""The map from above, and the window that follows it."""

import numpy as np
import pytest

from orbslam2py._palette import (
    CAMERA,
    COVISIBILITY,
    FAINT_TEXT,
    KEYFRAME,
    LOOP,
    LOST,
    PANEL,
    PATH,
    TEXT,
)
from orbslam2py.pictures import MapPicture, bounds, draw_ground, draw_top_view, frame_all
from orbslam2py.pictures.top_view import nice_length

SIZE = (400, 300)


def poses(*places):
    T_wc = np.tile(np.eye(4), (len(places), 1, 1))
    T_wc[:, :3, 3] = places
    return T_wc


def has(picture, colour, where=None, radius=4):
    """Whether a colour is in a picture, or near a pixel (x, y) of it."""
    if where is not None:
        x, y = np.rint(where).astype(int)
        picture = picture[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
    return bool((np.abs(picture.astype(int) - colour).max(axis=2) < 30).any())


WINDOW = frame_all(np.array([-5.0, -5.0]), np.array([5.0, 5.0]), SIZE)


def test_right_is_right_and_ahead_is_up():
    x, y = WINDOW.to_pixels(np.array([1.0, 1.0]))
    assert x > 199.5
    assert y < 149.5


def test_everything_is_drawn_where_it_is():
    scene = MapPicture(
        points=np.array([[4.0, 0.0, 4.0]]),
        keyframes=poses((-3, 0, 0), (3, 0, 0)),
        covisibility=np.array([[(-3.0, 0, 0), (3.0, 0, 0)]]),
        loop_edges=np.array([[(-3.0, 0, -3), (3.0, 0, -3)]]),
        path=np.array([(-3.0, 0, 2), (0.0, 0, 2), (1.0, 0, 2), (3.0, 0, 2)]),
        path_gaps=np.array([True, False, True, False]),
    )
    picture = draw_top_view(scene, WINDOW, T_wc=poses((0, 0, -4))[0])

    def at(x, z):
        return WINDOW.to_pixels(np.array([x, z]))

    assert picture.shape == (300, 400, 3)
    x, y = np.rint(at(4.0, 4.0)).astype(int)
    assert picture[y, x].max() > max(PANEL) + 20
    assert has(picture, KEYFRAME, at(3.0, 0.0), 10)
    assert has(picture, COVISIBILITY, at(0.0, 0.0))
    assert has(picture, LOOP, at(1.5, -3.0))
    assert has(picture, PATH, at(-1.5, 2.0))
    assert has(picture, PATH, at(2.0, 2.0))
    assert not has(picture, PATH, at(0.5, 2.0)), "no line over a gap"
    assert has(picture, CAMERA, at(0.0, -4.0), 24)


def test_a_lost_camera_is_drawn_as_lost():
    seen, lost = (
        draw_top_view(MapPicture(), WINDOW, T_wc=np.eye(4), lost=lost) for lost in (False, True)
    )
    assert has(seen, CAMERA)
    assert not has(seen, LOST)
    assert has(lost, LOST)
    assert not has(lost, CAMERA)


def test_more_points_are_brighter():
    def brightness(n):
        points = np.tile((0.0, 0.0, 0.0), (n, 1))
        return draw_ground(MapPicture(points=points), WINDOW).sum(dtype=int)

    assert brightness(0) < brightness(1) < brightness(3) < brightness(10) <= brightness(10**5)


def test_a_ground_drawn_before_gives_the_same_picture_and_stays():
    rng = np.random.default_rng(0)
    scene = MapPicture(points=rng.normal(0, 2, (500, 3)), keyframes=poses((0, 0, 0), (1, 0, 1)))
    ground = draw_ground(scene, WINDOW)
    before = ground.copy()
    again = draw_top_view(scene, WINDOW, T_wc=np.eye(4), ground=ground)
    np.testing.assert_array_equal(again, draw_top_view(scene, WINDOW, T_wc=np.eye(4)))
    np.testing.assert_array_equal(ground, before)


def test_points_far_away_do_not_shrink_the_path_to_a_dot():
    rng = np.random.default_rng(0)
    near = rng.uniform(-3, 3, (1000, 3))
    far = rng.normal(0, 1e4, (30, 3))
    path = np.array([(-2.0, 0, 0), (2.0, 0, 0)])
    low, high = bounds(MapPicture(points=np.vstack([near, far]), path=path))
    assert (low > -9).all()
    assert (high < 9).all()
    assert low[0] <= -2
    assert high[0] >= 2


def test_the_window_follows_without_a_jump_and_arrives():
    window = WINDOW
    low, high = np.array([-5.0, -5.0]), np.array([40.0, 8.0])
    steps = []
    for _ in range(120):
        after = window.follow(low, high, 1 / 30)
        pixels = np.abs(after.state[:2] - window.state[:2]) / window.unit_per_pixel
        steps.append((pixels.max(), abs(after.state[2] - window.state[2])))
        window = after
    assert window.shows(low, high)
    moved, zoomed = np.array(steps).T
    assert moved.max() < 15
    assert moved[0] < 4, "it begins softly"
    assert zoomed.max() < 0.1
    np.testing.assert_array_equal(window.state, window.goal)


def test_a_window_that_shows_all_stands_still():
    window = WINDOW
    for grown in (0.0, 0.3, 0.6):
        after = window.follow(np.array([-5.0, -5.0]), np.array([5.0 + grown, 5.0]), 0.1)
        np.testing.assert_array_equal(after.state, window.state)


@pytest.mark.parametrize("size", [(80, 300), (400, 60), (2, 2)])
def test_any_shape_of_the_picture(size):
    window = frame_all(np.array([0.0, 0.0]), np.array([1.0, 1.0]), size)
    assert window.shows(np.array([0.0, 0.0]), np.array([1.0, 1.0]))
    picture = draw_top_view(MapPicture(keyframes=poses((0, 0, 0))), window, T_wc=np.eye(4))
    assert picture.shape == (size[1], size[0], 3)


@pytest.mark.parametrize(
    ("at_most", "length"), [(1.0, 1.0), (1.9, 1.0), (4.9, 2.0), (73.0, 50.0), (0.03, 0.02)]
)
def test_the_scale_bar_has_a_round_length(at_most, length):
    assert nice_length(at_most) == pytest.approx(length)


def test_without_a_map_there_is_no_scale():
    empty = draw_top_view(MapPicture(), WINDOW)
    begun = draw_top_view(MapPicture(path=np.zeros((1, 3))), WINDOW)
    assert has(begun[-20:, :200], TEXT)
    assert not has(empty[-20:, :200], TEXT)
    assert has(empty[130:170], FAINT_TEXT), "it is said in words"
