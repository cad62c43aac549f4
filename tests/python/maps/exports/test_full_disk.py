# SPDX-License-Identifier: BSD-3-Clause
"""A disk that is too small for an export: which folder, why and what to do; nothing is left."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from orbslam2py._arrays import ByteArray
from orbslam2py.maps import export_colmap, export_nerfstudio
from support.made_up_map import HEIGHT, WIDTH, made_up_map
from support.small_disk import small_disk

pytestmark = pytest.mark.watchdog(30)

#: Noise, which PNG files keep at its size.
PHOTOGRAPH = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH), np.uint8)

EXPORTS = [export_colmap, partial(export_colmap, binary=False), export_nerfstudio]


def photograph(_: int) -> ByteArray:
    return PHOTOGRAPH


@pytest.mark.parametrize("export", EXPORTS)
@pytest.mark.parametrize("with_images", [True, False])
def test_a_full_disk(tmp_path: Path, export: Callable[..., None], with_images: bool) -> None:
    images = photograph if with_images else None
    with small_disk(tmp_path / "disk", "4k" if images is None else "64k") as disk:
        with pytest.raises(OSError, match="No space left") as refused:
            export(made_up_map(), disk / "desk", images=images)
        assert list(disk.iterdir()) == []
    folder = tmp_path / "disk" / "desk"
    assert refused.value.strerror == (
        f"cannot write to {folder}: No space left on device; make room, or give another folder"
    )


def test_images_that_cannot_be_read_are_not_the_exports_failure(tmp_path: Path) -> None:
    def gone(_: int) -> ByteArray:
        raise FileNotFoundError(2, "No such file or directory", "/media/film.png")

    with pytest.raises(FileNotFoundError) as refused:
        export_colmap(made_up_map(), tmp_path / "desk", images=gone)
    assert refused.value.filename == "/media/film.png"
    assert list(tmp_path.iterdir()) == []
