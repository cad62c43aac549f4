# SPDX-License-Identifier: BSD-3-Clause
"""Camera models: pixels of points, rays of pixels, and what is refused."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import cv2
import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings import AngleOfView

FOCAL = (458.6, 457.3, 367.2, 248.4)
K = np.array([[458.6, 0, 367.2], [0, 457.3, 248.4], [0, 0, 1]])
SIZE = (752, 480)

#: A lens of each model, after the focal lengths and the principal point.
LENSES: dict[str, tuple[float, ...]] = {
    "pinhole": (),
    "radtan4": (-0.283, 0.074, 0.0002, -0.0004),
    "radtan5": (-0.283, 0.074, 0.0002, -0.0004, 0.01),
    "rational": (1.17, 0.286, 0.0003, -0.0002, 0.0076, 1.51, 0.58, 0.047),
    "thin_prism": (1.17, 0.286, 0.003, -0.002, 0.0076, 1.51, 0.58, 0.047, 2e-3, -1e-3, -3e-3, 1e-3),
    "kannala_brandt": (-0.0068, 0.0452, -0.0435, 0.0084),
    "double_sphere": (-0.24, 0.57),
    "eucm": (0.63, 1.04),
    "mei": (0.9, -0.21, 0.05, 0.0003, -0.0002),
    "fov": (0.93,),
}
OPENCV = ["pinhole", "radtan4", "radtan5", "rational", "thin_prism"]


def model(name: str, size: tuple[int, int] = SIZE) -> orb.CameraModel:
    return orb.CameraModel(name, (*FOCAL, *LENSES[name]), size)


def pixels_of_the_image() -> FloatArray:
    u, v = np.meshgrid(np.arange(0.0, SIZE[0], 17), np.arange(0.0, SIZE[1], 17))
    return np.stack([u.ravel(), v.ravel()], axis=1)


# ---- the same as OpenCV --------------------------------------------------------------------------
@pytest.mark.parametrize("name", OPENCV)
def test_points_are_where_opencv_projects_them(name: str) -> None:
    camera = model(name)
    rays = camera.unproject(pixels_of_the_image())
    points = rays * np.linspace(0.2, 20, len(rays))[:, None]
    lens = np.array(LENSES[name]) if LENSES[name] else None
    expected, J = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, lens)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)
    # OpenCV gives derivatives by the translation, which are those by the point.
    jacobians = camera.project_with_jacobian(points)[1]
    np.testing.assert_allclose(jacobians, J[:, 3:6].reshape(-1, 2, 3), rtol=1e-9, atol=1e-9)


def test_points_are_where_opencv_projects_them_through_a_fisheye() -> None:
    camera = model("kannala_brandt")
    points = camera.unproject(pixels_of_the_image()) * 3.0
    lens = np.array(LENSES["kannala_brandt"])
    expected, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, lens)
    np.testing.assert_allclose(camera.project(points), expected[:, 0], atol=1e-9)


@pytest.mark.skipif(not hasattr(cv2, "omnidir"), reason="this OpenCV has no module omnidir")
def test_points_are_where_opencv_projects_them_through_an_omnidirectional_lens() -> None:
    camera = model("mei")
    points = camera.unproject(pixels_of_the_image()) * 3.0
    xi, *lens = LENSES["mei"]
    zeros = np.zeros((1, 3))
    project: Any = vars(cv2)["omnidir"].projectPoints  # stubs of other builds do not know it
    expected, _ = project(points[:, None], zeros, zeros, K, xi, np.array([lens]))
    np.testing.assert_allclose(camera.project(points), expected.reshape(-1, 2), atol=1e-9)


# ---- there and back ------------------------------------------------------------------------------
@pytest.mark.parametrize("name", LENSES)
def test_rays_of_pixels_are_projected_to_them(name: str) -> None:
    camera, pixels = model(name), pixels_of_the_image()
    rays = camera.unproject(pixels)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(camera.project(7.5 * rays), pixels, atol=1e-8)
    np.testing.assert_array_equal(camera.project_with_jacobian(rays)[0], camera.project(rays))


@pytest.mark.parametrize("name", LENSES)
def test_jacobians_are_derivatives_of_pixels_by_points(name: str) -> None:
    camera = model(name)
    points = np.array([[0.3, -0.2, 1.1], [0.0, 0.0, 2.0], [-0.5, 0.4, 0.9]])
    jacobians = camera.project_with_jacobian(points)[1]
    assert jacobians.shape == (3, 2, 3)
    for axis in range(3):
        step = 1e-6 * np.eye(3)[axis]
        slope = (camera.project(points + step) - camera.project(points - step)) / 2e-6
        np.testing.assert_allclose(jacobians[:, :, axis], slope, atol=1e-4)


def test_lenses_that_see_behind_the_camera() -> None:
    camera = orb.CameraModel("kannala_brandt", [200, 200, 319.5, 319.5, 0, 0, 0, 0], (640, 640))
    ray = np.array([[np.sin(1.7), 0.0, np.cos(1.7)]])  # 97 degrees from the axis
    np.testing.assert_allclose(camera.project(ray), [[319.5 + 340, 319.5]])
    np.testing.assert_allclose(camera.unproject([[319.5 + 340, 319.5]]), ray, atol=1e-12)


def test_outside_of_the_domain_is_nan() -> None:
    camera = model("pinhole")
    points = [[1.0, 2.0, -1.0], [0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [0.0, 0.0, 1.0]]
    pixels, jacobians = camera.project_with_jacobian(points)
    assert np.isnan(pixels).all(axis=1).tolist() == [True, True, True, False]
    assert np.isnan(jacobians).all(axis=(1, 2)).tolist() == [True, True, True, False]
    fisheye = model("kannala_brandt")
    np.testing.assert_array_equal(
        fisheye.unproject([[1e5, 0.0], [np.nan, 0.0]]), np.full((2, 3), np.nan)
    )
    assert np.isnan(fisheye.pixels_per_radian([[1e5, 0.0]])).all()


@pytest.mark.parametrize("name", LENSES)
def test_nothing_in_nothing_out(name: str) -> None:
    camera = model(name)
    assert camera.project(np.empty((0, 3))).shape == (0, 2)
    assert camera.project_with_jacobian(np.empty((0, 3)))[1].shape == (0, 2, 3)
    assert camera.unproject(np.empty((0, 2))).shape == (0, 3)
    assert camera.pixels_per_radian(np.empty((0, 2))).shape == (0,)


def test_arrays_of_any_layout() -> None:
    camera = model("eucm")
    points = np.array([[0.25, -0.5, 1.0], [0.5, 0.125, 2.0]])
    expected = camera.project(points)
    np.testing.assert_array_equal(camera.project(np.asfortranarray(points)), expected)
    np.testing.assert_array_equal(camera.project(points.astype(np.float32)), expected)
    np.testing.assert_array_equal(camera.project(np.repeat(points, 2, axis=0)[::2]), expected)


# ---- angles --------------------------------------------------------------------------------------
def test_pixels_per_radian() -> None:
    camera = orb.CameraModel("pinhole", [300, 300, 320, 240], (640, 480))
    np.testing.assert_allclose(camera.pixels_per_radian(), [300])
    at_45_degrees = camera.pixels_per_radian([[620.0, 240.0]])
    np.testing.assert_allclose(at_45_degrees, [300 * 2**0.75])


def test_angle_of_view() -> None:
    f = 600 / np.radians(195)
    camera = orb.CameraModel("equidistant", [f, f, 299.5, 299.5, 0, 0, 0, 0], (600, 600))
    angles = camera.angle_of_view()
    assert isinstance(angles, AngleOfView)
    np.testing.assert_allclose(np.degrees(angles), [195, 195, 195 * 2**0.5])


# ---- names, equality, copies ---------------------------------------------------------------------
def test_parameters_by_name() -> None:
    by_name = {"alpha": 0.57, "xi": -0.24, "fx": 349.8, "fy": 348.7, "cx": 365.9, "cy": 249.3}
    camera = orb.CameraModel("ds", by_name, SIZE)
    assert camera.name == "double_sphere"
    assert camera.parameter_names == ("fx", "fy", "cx", "cy", "xi", "alpha")
    assert camera.parameters == (349.8, 348.7, 365.9, 249.3, -0.24, 0.57)
    assert camera.image_size == SIZE
    assert repr(camera) == (
        "CameraModel(double_sphere, 752x480, fx=349.8, fy=348.7, cx=365.9, cy=249.3, "
        "xi=-0.24, alpha=0.57)"
    )


def test_cameras_are_equal_by_their_values() -> None:
    camera = model("kannala_brandt")
    same = orb.CameraModel("KannalaBrandt8", np.array(camera.parameters), SIZE)
    assert camera == same
    assert hash(camera) == hash(same)
    assert camera != orb.CameraModel("radtan4", camera.parameters, SIZE)
    assert camera != model("kannala_brandt", (752, 481))
    assert camera != "kannala_brandt"
    for copied in (copy.deepcopy(camera), pickle.loads(pickle.dumps(camera))):
        assert copied == camera
        np.testing.assert_array_equal(copied.unproject([[10, 20]]), camera.unproject([[10, 20]]))


@pytest.mark.parametrize("name", ["name", "parameters", "image_size", "other"])
def test_cameras_cannot_be_changed(name: str) -> None:
    with pytest.raises(AttributeError):
        setattr(model("fov"), name, None)


# ---- what is refused -----------------------------------------------------------------------------
REFUSED: dict[str, tuple[tuple[Any, ...], str]] = {
    "unknown model": (("fish", [1], SIZE), r"'fish'; give one of pinhole, .*kannala_brandt"),
    "no name": ((3, [1], SIZE), r"camera model is 3; give one of pinhole"),
    "KannalaBrandt8 with five numbers": (
        ("KannalaBrandt8", [*FOCAL, 0.1], SIZE),
        r"KannalaBrandt8 \(kannala_brandt\) has 8 parameters, got 5; give fx, .*k4$",
    ),
    "pinhole with distortion": (
        ("PinHole", [*FOCAL, 0.1, 0, 0, 0], SIZE),
        r"got 8; give fx, fy, cx, cy, or the model radtan4",
    ),
    "not finite": (("pinhole", [*FOCAL[:3], np.inf], SIZE), "cy is inf; give a finite number"),
    "too large": (("pinhole", [*FOCAL[:3], 10**400], SIZE), "cy is inf; give a finite number"),
    "focal length 0": (("pinhole", [0, *FOCAL[1:]], SIZE), "fx is 0; give a finite number above 0"),
    "focal length below 0": (("fov", [400, -400, 300, 200, 0.9], SIZE), "fy is -400"),
    "alpha": (("eucm", [*FOCAL, 1.1, 1], SIZE), "eucm: alpha is 1.1; give a number from 0 to 1"),
    "beta": (("eucm", [*FOCAL, 0.6, 0], SIZE), "beta is 0; give a finite number above 0"),
    "xi": (("ds", [*FOCAL, -1.5, 0.6], SIZE), "xi is -1.5; give a number from -1 to 1"),
    "xi of mei": (("mei", [*FOCAL, -1, 0, 0, 0, 0], SIZE), "xi is -1; give .*not below 0"),
    "omega in degrees": (
        ("fov", [*FOCAL, 53.0], SIZE),
        "omega is 53; give a number from 0 to 3.14",
    ),
    "order of Kalibr": (
        ("mei", [1.2, 460, 459, 365, 249, 0, 0, 0, 0], SIZE),
        r"fx 1.2 and fy 460 .*give the parameters in the order fx, fy, cx, cy, xi",
    ),
    "relative to the image size": (("fov", [0.61, 0.95, 0.5, 0.5, 0.9], SIZE), "in pixels"),
    "a name is missing": (
        ("fov", {"fx": 1.0, "w": 1.0}, SIZE),
        "lacks fy, .*does not have w; give",
    ),
    "text": (("pinhole", "450", SIZE), "parameters is '450'; give a list of numbers"),
    "nothing": (("pinhole", None, SIZE), "parameters is None; give a list of numbers"),
    "texts": (("pinhole", ["450", 1, 1, 1], SIZE), "parameter 0 is '450'; give a number"),
    "size 0": (("pinhole", FOCAL, (752, 0)), r"image_size is \(752, 0\); give \(width, height\)"),
    "size of parts": (("pinhole", FOCAL, (752, 480.5)), r"image_size is \(752, 480.5\); give"),
    "one size": (("pinhole", FOCAL, 752), "image_size is 752; give"),
    "a large size": (("pinhole", FOCAL, (752, 2**40)), "image_size is .*; give"),
}


@pytest.mark.parametrize("wrong", REFUSED)
def test_refused(wrong: str) -> None:
    arguments, message = REFUSED[wrong]
    with pytest.raises(SettingsError, match=message):
        orb.CameraModel(*arguments)


def test_arrays_of_another_shape_are_refused() -> None:
    camera = model("pinhole")
    with pytest.raises(SettingsError, match=r"points has shape \(3,\); give \(n, 3\)"):
        camera.project([1.0, 2.0, 3.0])  # type: ignore[list-item]
    with pytest.raises(SettingsError, match=r"pixels has shape \(1, 3\); give \(n, 2\)"):
        camera.unproject([[1.0, 2.0, 3.0]])
    with pytest.raises(SettingsError, match="points is 'no'; give an array of numbers"):
        camera.project("no")  # type: ignore[arg-type]
