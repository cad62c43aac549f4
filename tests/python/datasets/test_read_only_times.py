# SPDX-License-Identifier: BSD-3-Clause
"""Times of a sequence are its own: who counts them from the first on takes a copy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from orbslam2py import open_sequence
from orbslam2py.datasets import BagSequence, ImageFolder, Sequence, VideoSequence
from orbslam2py.datasets.base import Stamps
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from support import bags


def bag(folder: Path) -> Path:
    pixels = np.zeros((24, 32), np.uint8)
    stamps = [bags.START + k * bags.STEP for k in range(3)]
    images = [bags.raw_image("/cam/image_raw", stamp, pixels, "mono8") for stamp in stamps]
    return bags.write(folder / "b", "mcap", images)


@pytest.mark.parametrize("kind", ["tum", "kitti", "euroc", "folder", "video", "bag", "synthetic"])
def test_times_cannot_be_changed(request: pytest.FixtureRequest, tmp_path: Path, kind: str) -> None:
    sequence: Sequence
    if kind == "synthetic":
        sequence = SyntheticSequence(SyntheticOptions(frames=3))
    elif kind == "bag":
        sequence = BagSequence(bag(tmp_path), settings="tum1")
    else:
        path = request.getfixturevalue(kind)
        opened = {"folder": ImageFolder, "video": VideoSequence}
        sequence = opened[kind](path, settings="tum1") if kind in opened else open_sequence(path)
    before = sequence.timestamps.tolist()
    seconds = sequence.timestamps
    with pytest.raises(ValueError, match="read-only"):
        seconds -= seconds[0]
    assert sequence.timestamps.tolist() == before
    assert (sequence.timestamps - before[0]).tolist()[0] == 0


def test_an_array_that_was_given_stays_writable() -> None:
    given = np.arange(3.0)
    stamps = Stamps(given, ("0", "1", "2"), ())
    given += 5
    assert stamps.seconds.tolist() == [0, 1, 2]
