# SPDX-License-Identifier: BSD-3-Clause
"""Where points are seen, through lenses of every kind."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orbslam2py import CameraSettings, SettingsError
from orbslam2py.settings import BUILTIN_NAMES, builtin_settings
from orbslam2py.settings.projection import largest_radius

PLAIN = CameraSettings(500, 510, 320, 240)
BENT = CameraSettings(500, 510, 320, 240, k1=0.26, k2=-0.95, p1=0.005, p2=0.0026, k3=1.16)
BARREL = CameraSettings(500, 510, 320, 240, k1=-0.3)
#: As Azure Kinect's, with eight coefficients.
RATIONAL = CameraSettings(
    500, 510, 320, 240, 0.45, -2.6, 6e-4, -2e-4, 1.5, k4=0.33, k5=-2.4, k6=1.42
)
POINTS = np.random.default_rng(1).uniform([-1, -1, 2], [1, 1, 5], (200, 3))


def pose() -> np.ndarray:
    T_cw = np.eye(4)
    T_cw[:3, :3] = cv2.Rodrigues(np.array([0.1, -0.2, 0.05]))[0]
    T_cw[:3, 3] = [0.1, -0.2, 0.3]
    return T_cw


@pytest.mark.parametrize(
    "camera", [PLAIN, BENT, BARREL, RATIONAL], ids=["plain", "bent", "barrel", "rational"]
)
def test_as_opencv_projects(camera: CameraSettings) -> None:
    T_cw = pose()
    expected, _ = cv2.projectPoints(
        POINTS, cv2.Rodrigues(T_cw[:3, :3])[0], T_cw[:3, 3], camera.matrix, camera.distortion
    )
    seen = camera.project(POINTS, T_cw)
    assert seen.shape == (200, 2)
    assert seen.dtype == np.float64
    np.testing.assert_allclose(seen, expected[:, 0], atol=1e-9)


@pytest.mark.parametrize("camera", [PLAIN, BENT], ids=["plain", "bent"])
def test_without_the_lens(camera: CameraSettings) -> None:
    """As keypoints are given: undistorted."""
    seen = camera.project(POINTS, distort=False)
    np.testing.assert_allclose(seen, PLAIN.project(POINTS))
    raw = camera.project(POINTS)
    undistorted = cv2.undistortPoints(
        raw[:, None], camera.matrix, camera.distortion, P=camera.matrix
    )
    np.testing.assert_allclose(undistorted[:, 0], seen, atol=0.05)


def test_what_is_not_in_front_is_not_seen() -> None:
    points = np.array([[0, 0, 1], [0, 0, 0], [0.1, 0, -1], [1e6, 0, 1], [np.nan, 0, 1]])
    seen = PLAIN.project(points)
    np.testing.assert_array_equal(np.isfinite(seen).all(axis=1), [True, False, False, True, False])
    np.testing.assert_array_equal(seen[0], [320, 240])
    # Moved in front by the pose.
    T_cw = np.eye(4)
    T_cw[2, 3] = 2
    assert np.isfinite(PLAIN.project(points[:3], T_cw)).all()
    assert PLAIN.project(np.zeros((0, 3))).shape == (0, 2)


def test_a_lens_does_not_fold_the_world_back_into_the_image() -> None:
    """A polynomial does: what is far aside would appear in the middle."""
    edge = largest_radius(BARREL.distortion)
    assert edge == pytest.approx(np.sqrt(1 / 0.9))
    aside = np.linspace(0, 3, 301)
    seen = BARREL.project(np.stack([aside, 0 * aside, 1 + 0 * aside], axis=1))
    np.testing.assert_array_equal(np.isfinite(seen[:, 0]), aside < edge)
    assert (np.diff(seen[aside < edge, 0]) > 0).all()
    assert largest_radius(np.array([0.1, 0, 0, 0])) == np.inf
    # r / (1 + r^2) turns at 1, r / (1 - r^2) has its pole there.
    assert largest_radius(np.array([0, 0, 0, 0, 0, 1.0, 0, 0])) == pytest.approx(1)
    assert largest_radius(np.array([0, 0, 0, 0, 0, -1.0, 0, 0])) == pytest.approx(1)


@pytest.mark.parametrize("name", BUILTIN_NAMES)
def test_lenses_in_use_see_their_whole_image(name: str) -> None:
    camera = builtin_settings(name, "mono").camera
    assert camera.width is not None or name.startswith(("tum", "kitti", "euroc"))
    corners = np.array([[0, 0], [camera.cx * 2, 0], [0, camera.cy * 2]])[:, None]
    plane = cv2.undistortPoints(corners, camera.matrix, camera.distortion)[:, 0]
    seen = camera.project(np.column_stack([plane, np.ones(3)]))
    np.testing.assert_allclose(seen, corners[:, 0], atol=3)


def test_other_shapes_are_told() -> None:
    with pytest.raises(SettingsError, match=r"points has shape \(3,\); give \(n, 3\)"):
        PLAIN.project(np.zeros(3))
    with pytest.raises(SettingsError, match=r"T_cw has shape \(3, 4\); give \(4, 4\)"):
        PLAIN.project(POINTS, np.eye(4)[:3])
