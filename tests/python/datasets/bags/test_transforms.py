# SPDX-License-Identifier: BSD-3-Clause
"""Where cameras are, by the transforms of ROS."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.datasets import BagSequence
from support import bags

GREY = np.full((24, 32), 90, np.uint8)


def shift(x: float, y: float = 0, z: float = 0) -> FloatArray:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def optical(T_link_camera: FloatArray) -> FloatArray:
    """From the optical axes (z ahead) to those of a body (x ahead, y left), as ROS has them."""
    axes = np.eye(4)
    axes[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    return T_link_camera @ axes


def pair(*transforms: bags.Made) -> list[bags.Made]:
    """Two cameras that were each calibrated alone, with frames of their own."""
    made = []
    for side in ("left", "right"):
        made.append(bags.camera_info(f"/{side}/camera_info", bags.START))
        frame = f"{side}_optical"
        made.append(bags.raw_image(f"/{side}/image_raw", bags.START, GREY, "mono8", frame=frame))
    return [*made, *transforms]


TRUE = shift(0.12)  # T_left_right: the right camera is 120 mm to the right of the left one
WAYS = {
    "left is the parent": [bags.frames("/tf_static", ("left_optical", "right_optical", TRUE))],
    "right is the parent": [
        bags.frames("/tf_static", ("right_optical", "left_optical", np.linalg.inv(TRUE)))
    ],
    "a common parent": [
        bags.frames(
            "/tf_static",
            ("base", "left_optical", shift(0.3, 1, 2)),
            ("base", "right_optical", shift(0.42, 1, 2)),
        )
    ],
    "optical frames below links": [
        bags.frames("/tf_static", ("base", "link", shift(1, 2, 3))),
        bags.frames("/tf_static", ("link", "left_optical", optical(shift(0, 0.06)))),
        bags.frames("/tf_static", ("/link", "/right_optical", optical(shift(0, -0.06)))),
    ],
    "on /tf, beside one that moves": [
        bags.frames(
            "/tf",
            ("odom", "left_optical", shift(i)),
            ("left_optical", "right_optical", TRUE),
            stamp=bags.START + i,
        )
        for i in range(5)
    ],
}


@pytest.mark.parametrize("kind", bags.KINDS)
@pytest.mark.parametrize("way", WAYS)
def test_the_baseline(tmp_path: Path, kind: str, way: str) -> None:
    bag = bags.write(tmp_path / "b", kind, pair(*WAYS[way]))
    settings = BagSequence(bag).settings
    assert settings.camera.bf == pytest.approx(20 * 0.12)
    assert settings.rectification is None


def test_the_calibration_goes_first(tmp_path: Path) -> None:
    """P says 150 mm: it was made of the images."""
    made = [m for m in pair(*WAYS["left is the parent"]) if m.topic != "/right/camera_info"]
    made.append(bags.camera_info("/right/camera_info", bags.START, bf=3.0))
    assert BagSequence(bags.write(tmp_path / "b", "mcap", made)).settings.camera.bf == 3.0


def test_exchanged_cameras(tmp_path: Path) -> None:
    bag = bags.write(tmp_path / "b", "mcap", pair(*WAYS["right is the parent"]))
    named = {"left": "/right/image_raw", "right": "/left/image_raw"}
    sequence = BagSequence(bag, topics=named)
    with pytest.raises(orb.DatasetError, match=r"stands to the left of the other one; exchange"):
        _ = sequence.settings


@pytest.mark.parametrize(
    ("transforms", "message"),
    [
        ([bags.frames("/tf_static", ("base", "left_optical", TRUE))], "no transform in the bag"),
        (
            [
                bags.frames(
                    "/tf", ("left_optical", "right_optical", shift(i)), stamp=bags.START + i
                )
                for i in range(1, 4)
            ],
            "no transform in the bag",  # the cameras move to each other
        ),
        (
            [bags.frames("/tf_static", ("left_optical", "right_optical", np.full((4, 4), np.nan)))],
            "no transform in the bag",
        ),
        (
            [bags.frames("/tf_static", ("left_optical", "right_optical", shift(0.02, 0, 0.3)))],
            "are not side by side",
        ),
    ],
)
def test_transforms_that_do_not_tell(
    tmp_path: Path, transforms: list[bags.Made], message: str
) -> None:
    sequence = BagSequence(bags.write(tmp_path / "b", "rosbag1", pair(*transforms)))
    with pytest.raises(orb.DatasetError, match=message):
        _ = sequence.settings


@pytest.mark.parametrize("name", ["image_raw", "image_rect"])
def test_a_turned_camera_is_rectified(tmp_path: Path, name: str) -> None:
    """Also if the images were rectified: each camera for itself, that takes out the lens alone."""
    T = TRUE.copy()
    T[:3, :3] = cv2.Rodrigues(np.array([0.01, 0.03, 0.0]))[0]
    edge = bags.frames("/tf_static", ("left_optical", "right_optical", T))
    made = [replace(m, topic=m.topic.replace("image_raw", name)) for m in pair(edge)]
    settings = BagSequence(bags.write(tmp_path / "b", "mcap", made)).settings
    assert settings.rectification is not None
    assert settings.camera.bf / settings.camera.fx == pytest.approx(0.12)
    # Rays of one point have the same row in both rectified images.
    point = np.array([0.2, 0.1, 2.0])
    seen = np.linalg.inv(T) @ [*point, 1]
    rows = [
        (one.P[:, :3] @ one.R @ at)[1] / (one.R @ at)[2]
        for one, at in (
            (settings.rectification.left, point),
            (settings.rectification.right, seen[:3]),
        )
    ]
    assert rows[0] == pytest.approx(rows[1], abs=1e-6)
