# SPDX-License-Identifier: BSD-3-Clause
"""A turn that begins from one image to the next: no pose is wrong, and none is missing."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import System, TrackingRecord
from orbslam2py.slam.records import PoseMethod
from support.sharp_street import SharpCorner


@pytest.fixture(scope="module", params=[0, 1])
def driven(request: pytest.FixtureRequest) -> tuple[SharpCorner, list[TrackingRecord]]:
    corner = SharpCorner(seed=request.param)
    records = []
    with System(corner.settings, "stereo", deterministic=True) as slam:
        for i in range(len(corner)):
            images = corner.load(i)
            records.append(slam.track_stereo(images.image, images.right, i / 10))
    return corner, records


def test_every_image_has_a_pose(driven: tuple[SharpCorner, list[TrackingRecord]]) -> None:
    _, records = driven
    assert [record.frame_id for record in records if record.T_wc is None] == []


def test_no_pose_is_wrong(driven: tuple[SharpCorner, list[TrackingRecord]]) -> None:
    """Without a second search keyframes are off by 0.4 m and 1.2 degrees."""
    corner, records = driven
    errors = np.array(corner.errors(records))
    assert errors[:, 0].max() < 0.2
    assert errors[:, 1].max() < 1.0


def test_the_images_tell_how_it_turned(driven: tuple[SharpCorner, list[TrackingRecord]]) -> None:
    _, records = driven
    evidence = [record.evidence for record in records if record.evidence is not None]
    methods = {each.method for each in evidence}
    assert PoseMethod.MOTION_MODEL in methods
    assert PoseMethod.ALIGNED_IMAGES in methods
