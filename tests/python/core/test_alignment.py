# SPDX-License-Identifier: BSD-3-Clause
"""The bindings of the alignment of patches."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from orbslam2py import ImageError, StateError
from orbslam2py import _core as core
from orbslam2py._arrays import ByteArray

CENTRE = np.array([32.3, 31.8])


@pytest.fixture(scope="module")
def image() -> ByteArray:
    grey = np.random.default_rng(1).uniform(0, 255, (64, 64))
    return cv2.GaussianBlur(cv2.GaussianBlur(grey, (0, 0), 2) * 4 - 384, (0, 0), 1).astype(np.uint8)


def test_a_moved_image(image: ByteArray) -> None:
    moved = np.roll(image, (1, -2), axis=(0, 1))
    found = core.align_patch(image, CENTRE, np.eye(2), moved, CENTRE)
    assert found.ok
    assert found.failure == core.AlignmentFailure.NONE
    np.testing.assert_allclose(found.position, CENTRE + np.array([-2, 1]), atol=0.01)
    assert found.correlation > 0.999
    assert found.gain == pytest.approx(1, abs=0.01)
    assert (np.linalg.eigvalsh(found.information) > 0).all()


def test_reasons(image: ByteArray) -> None:
    failure = core.AlignmentFailure

    def reason(reference: ByteArray, start: object, **options: float) -> core.AlignmentFailure:
        chosen = core.AlignmentOptions(**options)  # type: ignore[arg-type]
        return core.align_patch(reference, CENTRE, np.eye(2), image, start, chosen).failure  # type: ignore[arg-type]

    assert reason(image, CENTRE) == failure.NONE
    assert reason(image, [1, 30]) == failure.OUTSIDE
    assert reason(image, [np.nan, 30]) == failure.OUTSIDE
    assert reason(image[:20, :20].copy(), CENTRE) == failure.OUTSIDE
    assert reason(np.full_like(image, 99), CENTRE) == failure.FLAT
    assert reason(image, CENTRE + 1, max_shift=0.5) == failure.NOT_CONVERGED
    assert reason(255 - image, CENTRE) != failure.NONE
    assert reason(image, CENTRE, min_correlation=1.1) == failure.LOW_CORRELATION


def test_images_that_are_none(image: ByteArray) -> None:
    with pytest.raises(ImageError, match="the reference"):
        core.align_patch(image[0], CENTRE, np.eye(2), image, CENTRE)
    with pytest.raises(ImageError, match="the image"):
        core.align_patch(image, CENTRE, np.eye(2), image.astype(np.float32), CENTRE)


def test_an_empty_map(image: ByteArray) -> None:
    alignment = core.SightingAlignment(core.Map())
    assert len(alignment.keyframes) == alignment.n_points == alignment.n_observations == 0
    assert (
        alignment.counts == alignment.right_counts == [0] * len(core.AlignmentFailure.__members__)
    )
    alignment.begin_round()
    alignment.weigh()
    with pytest.raises(StateError, match="keyframe 0 is not part of the bundle"):
        alignment.align(0, image)
