# SPDX-License-Identifier: BSD-3-Clause
"""CameraInfo as the calibration: rectified images as they are, others rectified."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py.datasets import BagSequence
from orbslam2py.datasets.rectification import rectification_of_pair
from support import bags

SIZE = (320, 240)
K = np.array([[200.0, 0, 155], [0, 205, 118], [0, 0, 1]])
D = (-0.2, 0.05, 0.001, -0.0005, 0.0)
GREY = cv2.GaussianBlur(
    np.random.default_rng(2).integers(0, 256, SIZE[::-1]).astype(np.uint8), (0, 0), 2
)


def raw_pair() -> dict[str, dict[str, object]]:
    """Calibration of a raw pair, as camera_calibration of ROS writes it."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.array([0.01, -0.02, 0.005]))[0]
    T[:3, 3] = [-0.12, 0.001, 0.002]
    found = rectification_of_pair((K, K), (np.array(D), np.array(D)), T, SIZE)
    sides = {"left": found.left, "right": found.right}
    return {
        side: {"size": SIZE, "K": one.K, "D": D, "R": one.R, "P": one.P}
        for side, one in sides.items()
    }


def messages(name: str, infos: dict[str, dict[str, object]]) -> list[bags.Made]:
    made = []
    for side, info in infos.items():
        made.append(bags.camera_info(f"/{side}/camera_info", bags.START, **info))  # type: ignore[arg-type]
        made.append(bags.raw_image(f"/{side}/{name}", bags.START, GREY, "mono8"))
    return made


@pytest.mark.parametrize("kind", bags.KINDS)
def test_a_raw_pair_is_rectified(tmp_path: Path, kind: str) -> None:
    infos = raw_pair()
    sequence = BagSequence(bags.write(tmp_path / "b", kind, messages("image_raw", infos)))
    rectification = sequence.settings.rectification
    assert rectification is not None
    camera = sequence.settings.camera
    P = np.asarray(infos["right"]["P"])
    assert (camera.fx, camera.cx, camera.bf) == (P[0, 0], P[0, 2], -P[0, 3])
    images = sequence.load(0)
    assert images.right is not None
    for image, info in ((images.image, infos["left"]), (images.right, infos["right"])):
        maps = cv2.initUndistortRectifyMap(
            K, np.array(D), np.asarray(info["R"]), np.asarray(info["P"])[:, :3], SIZE, cv2.CV_32FC1
        )
        fixed = cv2.convertMaps(*maps, cv2.CV_16SC2)  # in 1/32 pixel
        assert np.array_equal(image, cv2.remap(GREY, *fixed, cv2.INTER_LINEAR))


def test_a_rectified_pair_stays_as_it_is(tmp_path: Path) -> None:
    infos = raw_pair()
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages("image_rect", infos)))
    assert sequence.settings.rectification is None
    assert sequence.settings.camera.bf == -np.asarray(infos["right"]["P"])[0, 3]
    images = sequence.load(0)
    assert np.array_equal(images.image, GREY)
    assert images.right is not None
    assert np.array_equal(images.right, GREY)


@pytest.mark.parametrize("name", ["image_raw", "image_rect"])
def test_one_camera(tmp_path: Path, name: str) -> None:
    """Raw images are undistorted by the system; rectified ones have the projection's camera."""
    info = raw_pair()["left"]
    made = messages(name, {"camera": info})
    camera = BagSequence(bags.write(tmp_path / "b", "rosbag1", made)).settings.camera
    if name == "image_raw":
        assert (camera.fx, camera.cy, camera.k1, camera.p2) == (200, 118, -0.2, -0.0005)
    else:
        P = np.asarray(info["P"])
        assert (camera.fx, camera.cy, camera.k1) == (P[0, 0], P[1, 2], 0)


@pytest.mark.parametrize(
    ("D", "expected"),
    [
        ((0.02, -0.01, 0.004, -0.001), True),
        ((0.02, -0.01, 0.004, -0.001, 0.0), True),
        ((0.02, -0.01, 0.004, 0.1, 0.1), False),
    ],
)
def test_one_fisheye_camera(tmp_path: Path, D: tuple[float, ...], expected: bool) -> None:
    info = {**raw_pair()["left"], "model": "equidistant", "D": D}
    made = messages("image_raw", {"camera": info})
    sequence = BagSequence(bags.write(tmp_path / "b", "rosbag1", made))
    if not expected:
        with pytest.raises(orb.DatasetError, match=r"equidistant needs the 4 numbers k1, k2, k3"):
            _ = sequence.settings
        return
    camera = sequence.settings.camera
    assert (camera.model, camera.lens) == ("kannala_brandt", D[:4])
    assert (camera.fx, camera.cy, camera.is_distorted) == (200, 118, False)


@pytest.mark.parametrize(
    ("name", "left", "right", "message"),
    [
        ("image_raw", {}, {}, "do not contain the distance of the two cameras"),
        ("image_rect", {}, {"bf": -3.0}, "stands to the left of the other one; exchange"),
        ("image_rect", {}, {"bf": 3.0, "K": K * 2}, "are no rectified pair: their P differ"),
        ("image_rect", {"size": (64, 48)}, {"bf": 3.0}, "is for 64 x 48 pixels, but images of"),
        ("image_rect", {"K": np.zeros((3, 3))}, {}, "of a camera that was not calibrated"),
    ],
)
def test_pairs_that_cannot_be_used(
    tmp_path: Path,
    name: str,
    left: dict[str, object],
    right: dict[str, object],
    message: str,
) -> None:
    infos = {"left": {"size": SIZE, **left}, "right": {"size": SIZE, **right}}
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages(name, infos)))
    with pytest.raises(orb.DatasetError, match=message):
        _ = sequence.settings


def test_a_fisheye_pair_stands_as_its_projections_tell(tmp_path: Path) -> None:
    infos = raw_pair()
    for info in infos.values():
        info.update(model="equidistant", D=(0.01, 0.002, 0.0, 0.0), K=K * [[0.3], [0.3], [1]])
        P = np.asarray(info["P"])
        info["P"] = P * np.array([[0.3], [0.3], [1]])
    sequence = BagSequence(bags.write(tmp_path / "b", "mcap", messages("image_raw", infos)))
    right = sequence.settings.right
    assert right is not None
    assert right.camera.lens == sequence.settings.camera.lens == (0.01, 0.002, 0.0, 0.0)
    P, R = (np.asarray(infos["right"][name]) for name in "PR")
    R_left = np.asarray(infos["left"]["R"])
    expected = -P[0, 3] / P[0, 0]
    assert right.baseline == pytest.approx(expected)
    np.testing.assert_allclose(right.T_right_left[:3, :3], R.T @ R_left, atol=1e-9)
    np.testing.assert_allclose(R_left @ right.centre, [expected, 0, 0], atol=1e-9)


def test_eight_coefficients(tmp_path: Path) -> None:
    """One camera has them in its settings; a pair is rectified with them."""
    eight = (*D, 0.1, 0.02, 0.003)
    info = {**raw_pair()["left"], "D": eight, "model": "rational_polynomial"}
    bag = bags.write(tmp_path / "b", "mcap", messages("image_raw", {"camera": info}))
    assert BagSequence(bag).settings.camera.distortion.tolist() == list(eight)
    infos = {side: {**one, "D": eight} for side, one in raw_pair().items()}
    pair = BagSequence(bags.write(tmp_path / "c", "mcap", messages("image_raw", infos)))
    assert pair.settings.rectification is not None
    assert pair.settings.rectification.left.D.tolist() == list(eight)


def test_more_coefficients(tmp_path: Path) -> None:
    twelve = (*D, 0.1, 0.02, 0.003, 1e-3, 2e-3, 0.0, 4e-3)
    info = {**raw_pair()["left"], "D": twelve, "model": "rational_polynomial"}
    bag = bags.write(tmp_path / "a", "mcap", messages("image_raw", {"camera": info}))
    camera = BagSequence(bag).settings.camera
    assert (camera.model, camera.lens) == ("thin_prism", twelve)
    info = {**raw_pair()["left"], "D": (*D, *[0.1] * 9), "model": "rational_polynomial"}
    bag = bags.write(tmp_path / "b", "mcap", messages("image_raw", {"camera": info}))
    with pytest.raises(orb.DatasetError, match="14 coefficients is not supported, at most 8 are"):
        _ = BagSequence(bag).settings


def test_no_calibration(tmp_path: Path) -> None:
    made = [
        m for m in messages("image_raw", {"camera": raw_pair()["left"]}) if m.kind == bags.IMAGE
    ]
    bag = bags.write(tmp_path / "b", "mcap", made)
    with pytest.raises(
        orb.DatasetError, match=r"no settings for .*: it has no CameraInfo for /cam"
    ):
        _ = BagSequence(bag).settings
    other = bags.camera_info("/elsewhere/info", bags.START, size=SIZE)
    bag = bags.write(tmp_path / "c", "mcap", [*made, other])
    with pytest.raises(orb.DatasetError, match="take one of /elsewhere/info with --topics info="):
        _ = BagSequence(bag).settings
    assert BagSequence(bag, topics={"info": "/elsewhere/info"}).settings.camera.fx == 20
    assert BagSequence(bag, settings="tum1").settings.camera.fx > 500
