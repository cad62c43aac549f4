# SPDX-License-Identifier: BSD-3-Clause
"""Points in the images of the report lie where the lens shows them."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orbslam2py.runs.kept_images import SmallImage
from orbslam2py.runs.report_page.frame_images import draw_frame
from orbslam2py.settings import CameraSettings, settings_for_camera


@pytest.mark.parametrize(
    "camera",
    [
        CameraSettings(100, 100, 160, 120, k1=-0.2, p1=0.001),
        CameraSettings(100, 100, 160, 120, model="kannala_brandt", lens=(0.01, 0, 0, 0)),
    ],
)
def test_a_point_is_drawn_where_the_lens_shows_it(camera: CameraSettings) -> None:
    points = np.array([[0.5, -0.3, 1.0], [0.0, 0.0, -1.0]])
    small = SmallImage(np.full((120, 160, 3), 128, np.uint8), 0.5)
    jpeg = draw_frame(small, points, settings_for_camera(camera, "mono"))
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    rows, columns = np.nonzero(np.abs(image.astype(int) - 128).max(axis=2) > 60)
    u, v = camera.project(points[:1])[0] * 0.5
    assert abs(columns.mean() - u) < 1
    assert abs(rows.mean() - v) < 1
    assert np.ptp(columns) < 10
