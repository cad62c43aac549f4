# SPDX-License-Identifier: BSD-3-Clause
"""Names that a file may have on Linux, and OpenCV or FFmpeg read in another way, or not at all."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from orbslam2py import DatasetError
from orbslam2py.datasets import VideoReader, VideoSequence, open_input
from support.numbered_images import MONO, number_of

#: As Python spells a name with a byte that is no UTF-8.
NOT_UTF_8 = "caf\udce9"

pytestmark = pytest.mark.watchdog(60)


@pytest.mark.parametrize("ending", [".mp4", ".other"])
def test_a_video_whose_name_is_no_utf_8_is_refused(
    tmp_path: Path, video: Path, ending: str
) -> None:
    """OpenCV ended the whole program."""
    path = Path(shutil.copy(video, tmp_path / (NOT_UTF_8 + ending)))
    with pytest.raises(DatasetError, match=r"caf.* is not UTF-8.*; rename the file") as refused:
        open_input(path, MONO, settings="tum1")
    assert str(path) in str(refused.value)
    with pytest.raises(DatasetError, match="is not UTF-8"):
        VideoReader(path)


def test_a_video_in_a_folder_whose_name_is_no_utf_8(
    tmp_path: Path, video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / NOT_UTF_8
    folder.mkdir()
    shutil.copy(video, folder / "walk.mp4")
    with pytest.raises(DatasetError, match="rename the file, or the folder"):
        VideoReader(folder / "walk.mp4")
    monkeypatch.chdir(folder)
    assert len(VideoReader("walk.mp4").scan()) == 20


@pytest.mark.parametrize(
    "name", ["take:2.mp4", "concat:walk.mp4", "file:walk.mp4", "100%d.mp4", "-x.mp4", "a\nb.mp4"]
)
def test_a_name_that_ffmpeg_would_take_for_something_else(
    tmp_path: Path, video: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """What stands before a colon was the name of a protocol."""
    shutil.copy(video, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    sequence = VideoSequence(name, settings="tum1")
    assert len(sequence) == 20
    rgb = sequence.settings.camera.rgb
    image = sequence.load(7).image
    assert number_of(image[..., ::-1] if rgb else image) == 7
