# SPDX-License-Identifier: BSD-3-Clause
"""Files that grow with a run: what they may be called, and who may read them."""

from __future__ import annotations

import stat
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import OutputFileError, RerunRecorder, VideoWriter
from orbslam2py.recordings.video_file import VideoFile
from support.files import names_in
from support.videos import read_video

pytestmark = pytest.mark.watchdog(60)

#: As Python spells a name with a byte that is no UTF-8.
NOT_UTF_8 = "caf\udce9"


def write(path: str | Path) -> None:
    video = VideoFile(path, (320, 240), 25.0)
    for shade in range(3):
        video.write(np.full((240, 320, 3), 80 * shade, np.uint8))
    video.close()


@pytest.mark.parametrize("name", [f"{NOT_UTF_8}.mp4", "x" * 250 + ".avi", "take:2.mp4", "a%d.avi"])
def test_a_video_may_be_called_as_any_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """While it grows it has another name; OpenCV ended the program over the first."""
    monkeypatch.chdir(tmp_path)
    write(name)
    assert names_in(tmp_path) == [name]
    (tmp_path / name).rename(tmp_path / "plain.mp4")
    assert len(read_video(tmp_path / "plain.mp4")[0]) == 3


def test_a_recording_may_be_called_as_any_file(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    RerunRecorder(tmp_path / f"{NOT_UTF_8}.rrd").close()
    assert names_in(tmp_path) == []


def test_a_folder_that_is_no_utf_8_is_named(tmp_path: Path) -> None:
    folder = tmp_path / NOT_UTF_8
    folder.mkdir()
    with pytest.raises(OutputFileError, match=r"is not UTF-8.*; rename the folder"):
        VideoWriter(folder / "a.mp4")
    assert names_in(folder) == []


def test_a_private_file_stays_private(tmp_path: Path) -> None:
    path = tmp_path / "a.avi"
    path.write_text("old")
    path.chmod(0o600)
    write(path)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert len(read_video(path)[0]) == 3


@pytest.mark.parametrize(
    "size",
    [("a", 3), "ab", None, (640,), (640.0, 480), (640, 480, 3), (True, 480), (2**40, 480)],
    ids=repr,
)
def test_sizes_are_two_whole_numbers(tmp_path: Path, size: object) -> None:
    with pytest.raises(OutputFileError, match=r"^size is .*; give width and height"):
        VideoWriter(tmp_path / "a.avi", size=size)  # type: ignore[arg-type]
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("size", [(641, 480), (300, 480), (640, 200), (-640, 480)])
def test_sizes_are_even_and_large_enough(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(OutputFileError, match=rf"be {size[0]} x {size[1]} pixels .*; take even"):
        VideoWriter(tmp_path / "a.avi", size=size)
