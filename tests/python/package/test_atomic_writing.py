# SPDX-License-Identifier: BSD-3-Clause
"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from orbslam2py import _files
from orbslam2py._files import atomic_folder, atomic_write
from support.files import names_in


def test_file_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with atomic_write(path) as stream:
        stream.write("new\n")
        assert path.read_text() == "old"
    assert path.read_bytes() == b"new\n"
    assert names_in(tmp_path) == ["a.txt"]
    with atomic_write(path, binary=True) as stream:
        stream.write(b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"


def test_file_has_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("")
    with atomic_write(tmp_path / "ours"):
        pass
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("error", [ValueError("bad"), KeyboardInterrupt()])
def test_old_file_stays_when_writing_fails(tmp_path: Path, error: BaseException) -> None:
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(type(error)), atomic_write(path) as stream:
        stream.write("half")
        raise error
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["a.txt"]


def test_missing_folder_is_named(tmp_path: Path) -> None:
    """The original does not look whether the file could be opened (OD-18)."""
    with (
        pytest.raises(FileNotFoundError, match=r"cannot write .*none/a\.txt: No such file"),
        atomic_write(tmp_path / "none" / "a.txt"),
    ):
        pass


def test_no_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> int:
        raise PermissionError(errno.EACCES, "Permission denied", "hidden temporary name")

    monkeypatch.setattr(os, "open", refuse)
    with (
        pytest.raises(PermissionError, match=r"cannot write .*a\.txt: Permission denied") as caught,
        atomic_write(tmp_path / "a.txt"),
    ):
        pass
    assert caught.value.filename == str(tmp_path / "a.txt")


def test_full_disk_is_named_and_the_old_file_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: int) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    path = tmp_path / "a.txt"
    path.write_text("old")
    monkeypatch.setattr(os, "fsync", fail)
    with (
        pytest.raises(OSError, match=r"cannot write .*a\.txt: No space left") as caught,
        atomic_write(path) as stream,
    ):
        stream.write("new")
    assert caught.value.errno == errno.ENOSPC
    assert path.read_text() == "old"
    assert names_in(tmp_path) == ["a.txt"]


def test_disk_that_fills_while_writing(tmp_path: Path) -> None:
    """The error of the stream itself names no file; ours does."""
    path = tmp_path / "a.txt"
    with (
        pytest.raises(OSError, match=r"cannot write .*a\.txt: No space left"),
        atomic_write(path),
    ):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert not path.exists()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_devices_are_written_directly() -> None:
    with atomic_write("/dev/null") as stream:
        stream.write("gone")
    with pytest.raises(OSError, match="No space left"), atomic_write("/dev/full") as stream:
        stream.write("x" * 100_000)


def test_a_pipe_that_has_no_place_is_written_directly() -> None:
    read, write = os.pipe()
    with os.fdopen(read) as reader:
        with atomic_write(f"/proc/self/fd/{write}") as stream:
            stream.write("through\n")
        os.close(write)
        assert reader.read() == "through\n"


def test_links_are_followed(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    with atomic_write(tmp_path / "link") as stream:
        stream.write("new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


@pytest.mark.parametrize("write", [atomic_write, atomic_folder])
def test_a_ctrl_c_right_after_the_temporary_one_is_made_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Any
) -> None:
    def interrupted(real: Any) -> Any:
        def make(*arguments: Any, **options: Any) -> None:
            real(*arguments, **options)
            raise KeyboardInterrupt

        return make

    monkeypatch.setattr(Path, "mkdir", interrupted(Path.mkdir))
    monkeypatch.setattr(_files, "_open", interrupted(_files._open))
    with pytest.raises(KeyboardInterrupt), write(tmp_path / "x"):
        pass
    monkeypatch.undo()
    assert list(tmp_path.iterdir()) == []
