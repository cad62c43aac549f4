# SPDX-License-Identifier: BSD-3-Clause
"""What is said of a frame."""

from __future__ import annotations

import numpy as np
import pytest

from orbslam2py import Reason, Relocalized, TrackingRecord, TrackingState
from orbslam2py.datasets import Images

pytestmark = pytest.mark.watchdog(20)


def test_record_inverts_its_pose() -> None:
    T_cw = np.eye(4)
    T_cw[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T_cw[:3, 3] = [1, 2, 3]
    values = {"covariance": None, "n_matches": 0, "n_inliers": 0, "is_keyframe": False}
    record = TrackingRecord(
        *(0, 0.0, 0, TrackingState.OK, Reason.NONE, T_cw), reference_keyframe=0, **values
    )
    np.testing.assert_allclose(record.T_wc, np.linalg.inv(T_cw), atol=1e-15)
    lost = TrackingRecord(
        *(0, 0.0, 0, TrackingState.LOST, Reason.NONE, None), reference_keyframe=0, **values
    )
    assert lost.T_wc is None


def test_reasons_print_as_text() -> None:
    assert str(Reason.NONE) == ""
    assert f"{Reason.TOO_FEW_DEPTHS}" == "too few keypoints with depth"


# ---- equal records -------------------------------------------------------------------------------
def test_equal_records_have_equal_hashes() -> None:
    found = [Relocalized(0, 3, float("nan"), np.eye(4)) for _ in range(2)]
    assert found[0] == found[1]
    assert len(set(found)) == 1


def test_no_image_is_not_an_empty_one() -> None:
    image, empty = np.zeros((4, 4), np.uint8), np.zeros((0, 0), np.uint8)
    assert Images(image) != Images(image, right=empty)
    assert Images(image, right=empty) != Images(image)
    assert Images(image) == Images(image.copy())
