# SPDX-License-Identifier: BSD-3-Clause
"""Masks of sequences: one for all, or one for every image."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import DatasetError, ImageError
from orbslam2py.datasets import ImageFolder, MaskedSequence, Sequence, VideoSequence, open_input
from orbslam2py.settings import builtin_settings
from support.numbered_images import MONO, SIZE, coloured, mask_image


def test_one_mask_for_all(folder: Path, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "mask.png"), mask_image())
    sequence: Sequence = open_input(  # type: ignore[assignment]
        folder, MONO, settings="tum1", mask=tmp_path / "mask.png"
    )
    assert isinstance(sequence, MaskedSequence)
    assert (sequence.name, sequence.layout, len(sequence)) == ("walk", "images", 12)
    assert sequence.settings == builtin_settings("tum1", MONO) == sequence.default_settings()
    assert sequence.ground_truth() is None
    assert (sequence.folder, sequence.image_path(3).name) == (folder, "4.png")
    images = sequence.load(3)
    np.testing.assert_array_equal(images.mask, mask_image())
    assert images.image.shape == (*SIZE, 3)


def test_masks_by_name_or_by_order(folder: Path, video: Path, tmp_path: Path) -> None:
    masks = tmp_path / "masks"
    masks.mkdir()
    for k in range(1, 13):  # colour files with equal channels are masks too
        cv2.imwrite(str(masks / f"{k}.bmp"), cv2.cvtColor(mask_image(k), cv2.COLOR_GRAY2BGR))
    sequence = MaskedSequence(ImageFolder(folder, settings="tum1"), masks)
    for i in (0, 10):
        mask = sequence.load(i).mask
        assert mask is not None
        assert mask[0, 0] == i + 1
    frames = VideoSequence(video, settings="tum1")
    with pytest.raises(DatasetError, match="12 masks for 20 images"):
        MaskedSequence(frames, masks)
    for k in range(13, 21):
        cv2.imwrite(str(masks / f"{k}.png"), mask_image(k))
    mask = MaskedSequence(frames, masks).load(14).mask
    assert mask is not None
    assert mask[0, 0] == 15
    (masks / "7.bmp").unlink()
    with pytest.raises(DatasetError, match=r"the first without one is 7\)"):
        MaskedSequence(ImageFolder(folder, settings="tum1"), masks)


def test_bad_masks(folder: Path, tmp_path: Path) -> None:
    sequence = ImageFolder(folder, settings="tum1")
    path = tmp_path / "mask.png"
    with pytest.raises(DatasetError, match=r"mask .*mask\.png does not exist"):
        MaskedSequence(sequence, path)
    path.write_bytes(b"no image")
    with pytest.raises(ImageError, match=r"mask\.png is no readable image"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), mask_image().astype(np.uint16))
    with pytest.raises(ImageError, match="8 bits"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), coloured(3))
    with pytest.raises(ImageError, match=r"mask\.png is coloured"):
        MaskedSequence(sequence, path)
    cv2.imwrite(str(path), mask_image(size=(50, 60)))
    with pytest.raises(ImageError, match=r"mask\.png is 60 x 50, but its image 128 x 96"):
        MaskedSequence(sequence, path).load(0)
    (tmp_path / "none").mkdir()
    with pytest.raises(DatasetError, match="no masks in"):
        MaskedSequence(sequence, tmp_path / "none")
