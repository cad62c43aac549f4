# SPDX-License-Identifier: BSD-3-Clause
"""What is drawn of the view of a fisheye camera."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import CameraModel, CameraSettings
from orbslam2py.recordings.rerun_recorder import border_lines
from orbslam2py.viewer.frusta import vertical_angle

LENS = (0.0, 0.0, 0.0, 0.0)


def fisheye(focal: float, height: int | None = 400) -> CameraSettings:
    width = None if height is None else 640
    return CameraSettings(
        *(focal, focal, 319.5, 199.5),
        width=width,
        height=height,
        model="kannala_brandt",
        lens=LENS,
    )


def test_the_frustum_follows_the_rays_of_the_border() -> None:
    # Equidistant: 399 pixels between the outer rows of pixels.
    assert vertical_angle(fisheye(399 / np.radians(90))) == pytest.approx(np.radians(90), rel=5e-3)
    assert vertical_angle(fisheye(399 / np.radians(90), None)) == pytest.approx(
        np.radians(90), rel=5e-3
    )
    assert vertical_angle(fisheye(399 / np.radians(190))) == pytest.approx(np.radians(120))
    pinhole = CameraSettings(300.0, 300.0, 319.5, 199.5)
    assert vertical_angle(pinhole) == pytest.approx(2 * np.arctan(199.5 / 300))


def test_lines_of_a_view_beyond_the_side_reach_backwards() -> None:
    focal = 639 / np.radians(200)
    camera = CameraModel("kannala_brandt", (focal, focal, 319.5, 199.5, *LENS), (640, 400))
    border, *edges = border_lines(camera, 0.5)
    np.testing.assert_allclose(np.linalg.norm(border, axis=1), 0.5)
    left = border[np.argmin(border[:, 0])]
    assert np.degrees(np.arctan2(-left[0], left[2])) == pytest.approx(100, abs=1)
    assert border[:, 2].min() < 0
    assert len(edges) == 4
    for edge, corner in zip(edges, ([0, 0], [639, 0], [639, 399], [0, 399]), strict=True):
        np.testing.assert_allclose(edge[1], 0.5 * camera.unproject([corner])[0], atol=1e-9)
