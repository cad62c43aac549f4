# SPDX-License-Identifier: BSD-3-Clause
"""Map files on a disk that becomes full: a small one is mounted where that is allowed."""

from __future__ import annotations

import logging
import os
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from orbslam2py import MapFileError, Sensor
from orbslam2py.maps import load_map, save_map, verify_map_file
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
from support import small_sequences
from support.saved_maps import small_map
from support.small_disk import small_disk


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk with room for four small maps."""
    save_map(small_map(), tmp_path / "size.orbmap")
    size = 4 * (tmp_path / "size.orbmap").stat().st_size
    with small_disk(tmp_path / "disk", size) as folder:
        yield folder


def test_a_save_that_does_not_fit_leaves_the_file_that_was_there(disk: Path) -> None:
    path = disk / "a.orbmap"
    save_map(small_map(), path)
    _fill(disk, leave=path.stat().st_size // 2)
    with pytest.raises(MapFileError, match="the disk is full; make room") as caught:
        save_map(small_map(), path)
    assert str(caught.value).startswith(f"cannot write {path}: ")
    assert small_map().contents.first_difference(verify_map_file(path).contents) is None
    assert sorted(file.name for file in disk.iterdir()) == ["a.orbmap", "filler"]


def test_a_commit_that_does_not_fit_leaves_the_last_one(disk: Path) -> None:
    path = disk / "a.orbmap"
    small, large = small_map(frames=20), small_map()
    with closing(MapWriter(path)) as writer:
        writer.commit(all_rows(small))
        filler = _fill(disk, leave=200_000)
        with pytest.raises(MapFileError, match="the disk is full; make room"):
            writer.commit(all_rows(large))
        assert small.contents.first_difference(load_map(path).contents) is None
        filler.unlink()
        writer.commit(all_rows(large))
        assert large.contents.first_difference(load_map(path).contents) is None
    assert large.contents.first_difference(verify_map_file(path).contents) is None


def test_autosave_tells_of_a_full_disk_and_goes_on_when_there_is_room(
    disk: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = disk / "a.orbmap"
    with (
        small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam,
        caplog.at_level(logging.WARNING),
    ):
        small_sequences.play(slam, 10)
        slam.save_map(path)
        before = load_map(path).contents
        filler = _fill(disk)
        slam.autosave(path, every=0.01)
        records = small_sequences.play(slam, 20, first=10)
        assert len(records) == 20, "tracking goes on"
        with pytest.raises(MapFileError, match="the disk is full"):
            slam.save_map(path)
        assert before.first_difference(load_map(path).contents) is None
        filler.unlink()
        slam.save_map(path)
        now = slam.map_contents()
    assert now.first_difference(verify_map_file(path).contents) is None
    told = [record.getMessage() for record in caplog.records]
    assert all("autosave failed and will be tried again" in text for text in told)


def _fill(folder: Path, leave: int = 0) -> Path:
    """Take all room but so many bytes; deleting the file gives it back."""
    status = os.statvfs(folder)
    filler = folder / "filler"
    filler.write_bytes(bytes(status.f_bavail * status.f_frsize - leave))
    return filler
