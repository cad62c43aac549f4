# SPDX-License-Identifier: BSD-3-Clause
"""The image with its keypoints, and the line below it."""

import numpy as np
import pytest

from orbslam2py import TrackingState
from orbslam2py._palette import (
    LOST,
    MAPPED,
    NOT_TRACKED,
    STARTING,
    UNMATCHED,
    VISUAL_ODOMETRY,
)
from orbslam2py.pictures.overlay import (
    Marks,
    Status,
    draw_overlay,
    draw_status,
    status_height,
    to_rgb,
)

GREY = np.full((240, 320), 90, np.uint8)


def near(picture, place, colour, radius=6):
    """Whether a pixel close to a place (x, y) has a colour."""
    x, y = (round(value) for value in place)
    part = picture[max(0, y - radius) : y + radius + 1, max(0, x - radius) : x + radius + 1]
    return bool((np.abs(part.astype(int) - colour).max(axis=2) < 40).any())


def test_every_kind_of_keypoint_has_its_colour_where_it_is():
    marks = Marks(
        mapped=np.array([[50.0, 60.0]]),
        visual_odometry=np.array([[150.0, 60.0]]),
        unmatched=np.array([[250.0, 60.0]]),
        start_lines=np.array([[40.0, 180.0, 90.0, 200.0]]),
    )
    picture = draw_overlay(GREY, marks)
    assert picture.shape == (240, 320, 3)
    assert near(picture, (50, 60), MAPPED)
    assert near(picture, (150, 60), VISUAL_ODOMETRY)
    assert near(picture, (250, 60), UNMATCHED)
    for along in (0.1, 0.5, 1.0):
        assert near(picture, (40 + 50 * along, 180 + 20 * along), STARTING)
    assert not near(picture, (150, 60), MAPPED)
    assert (picture[110:160] == 90).all()


def test_the_image_that_was_given_stays_as_it_is():
    image = np.dstack([GREY] * 3)
    draw_overlay(image, Marks(mapped=np.array([[50.0, 60.0]])))
    assert (image == 90).all()


@pytest.mark.parametrize("size", [(640, 480), (160, 120), (320, 100)])
def test_marks_stay_with_what_they_mark_when_the_image_is_scaled(size):
    image = GREY.copy()
    image[118:123, 198:203] = 255
    picture = draw_overlay(image, Marks(mapped=np.array([[200.0, 120.0]])), size=size)
    assert picture.shape == (size[1], size[0], 3)
    place = (200.5 * size[0] / 320 - 0.5, 120.5 * size[1] / 240 - 0.5)
    assert near(picture, place, MAPPED, 8)
    far = np.ones(picture.shape[:2], bool)
    x, y = (round(value) for value in place)
    far[max(0, y - 20) : y + 20, max(0, x - 20) : x + 20] = False
    assert np.abs(picture[far].astype(int) - 90).max() < 30  # only what resizing rings


@pytest.mark.parametrize(
    ("shape", "rgb"), [((9, 7), True), ((9, 7, 3), True), ((9, 7, 3), False), ((9, 7, 4), False)]
)
def test_any_order_of_channels_becomes_rgb(shape, rgb):
    image = np.zeros(shape, np.uint8)
    if len(shape) == 3:
        image[..., 0 if rgb else 2] = 200
        assert to_rgb(image, rgb=rgb)[4, 4].tolist() == [200, 0, 0]
    else:
        assert to_rgb(image + 7)[4, 4].tolist() == [7, 7, 7]


def test_places_outside_of_the_image_or_without_a_number_are_no_failure():
    odd = np.array([[-50.0, 10.0], [1e9, 10.0], [np.nan, 10.0], [319.0, 239.0]])
    picture = draw_overlay(GREY, Marks(mapped=odd))
    assert near(picture, (316, 236), MAPPED)
    assert not near(picture, (160, 10), MAPPED, 9)


@pytest.mark.parametrize(
    ("status", "words"),
    [
        (Status(TrackingState.NO_IMAGES_YET), "waiting for images"),
        (Status(TrackingState.NOT_INITIALIZED, "low parallax"), "trying to initialize: low par"),
        (Status(TrackingState.OK), "SLAM  ·  tracking"),
        (Status(TrackingState.OK, localization=True), "LOCALIZATION  ·  tracking"),
        (Status(TrackingState.OK, n_matches=3, n_visual_odometry=9), "by visual odometry"),
        (Status(TrackingState.LOST, "too few matches"), "track lost, trying to relocalize: too"),
        (Status(TrackingState.OK, "unreadable", skipped=True), "image not used: unreadable"),
        (
            Status(TrackingState.OK, n_points=12345, n_keyframes=7),
            "7 keyframes  ·  12\u2009345 points",
        ),
        (
            Status(TrackingState.OK, frames_per_second=29.7, n_dropped=4),
            "30 frames/s  ·  4 dropped",
        ),
    ],
)
def test_the_line_says_mode_state_reason_and_numbers(status, words):
    assert words in str(status)


@pytest.mark.parametrize(
    ("status", "colour"),
    [
        (Status(TrackingState.OK), MAPPED),
        (Status(TrackingState.OK, n_visual_odometry=1), VISUAL_ODOMETRY),
        (Status(TrackingState.LOST), LOST),
        (Status(TrackingState.NOT_INITIALIZED), STARTING),
        (Status(TrackingState.NO_IMAGES_YET), NOT_TRACKED),
        (Status(TrackingState.OK, skipped=True), NOT_TRACKED),
    ],
)
@pytest.mark.parametrize("width", [40, 320, 853, 1920])
def test_the_line_has_the_colour_of_the_state_at_any_width(status, colour, width):
    strip = draw_status(width, status)
    assert strip.shape == (status_height(width), width, 3)
    assert (strip[:, :4] == colour).all()
    assert strip.max() > 150


def test_the_line_stands_below_the_image():
    picture = draw_overlay(GREY, Marks(), Status(TrackingState.LOST, "not found in the map"))
    assert picture.shape == (240 + status_height(320), 320, 3)
    assert (picture[240:, :4] == LOST).all()
    assert (picture[:240] == 90).all()
