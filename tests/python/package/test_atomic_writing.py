# SPDX-License-Identifier: BSD-3-Clause
"""Files appear whole or not at all."""

from __future__ import annotations

import errno
import os
import stat
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


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o444, 0o666])
def test_an_existing_file_keeps_its_permissions(tmp_path: Path, mode: int) -> None:
    """A private file could be read by everybody once it was written anew."""
    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(mode)
    with atomic_write(path) as stream:
        (growing,) = [one for one in tmp_path.iterdir() if one != path]
        assert stat.S_IMODE(growing.stat().st_mode) == mode, "also while it is written"
        stream.write("new")
    assert stat.S_IMODE(path.stat().st_mode) == mode
    assert path.read_text() == "new"


def test_a_file_that_has_no_permissions_of_its_own_is_written_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, "Operation not permitted")

    path = tmp_path / "a.txt"
    path.write_text("old")
    path.chmod(0o600)
    monkeypatch.setattr(Path, "chmod", refuse)  # as on a stick with FAT
    with atomic_write(path) as stream:
        stream.write("new")
    assert path.read_text() == "new"


@pytest.mark.parametrize("name", ["x" * 240 + ".txt", "\u00fc" * 127, "caf\udce9" * 40])
def test_a_name_may_be_as_long_as_the_system_allows(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("plain works")
    with atomic_write(tmp_path / name) as stream:
        (growing,) = [one for one in tmp_path.iterdir() if one.name != name]
        assert growing.name.startswith(".")
        assert growing.name.endswith(".tmp")
        stream.write("new")
    assert (tmp_path / name).read_text() == "new"
    (tmp_path / name).unlink()
    with atomic_folder(tmp_path / name) as folder:
        (folder / "a").write_text("first")
    with atomic_folder(tmp_path / name) as folder:
        (folder / "a").write_text("second")
    assert (tmp_path / name / "a").read_text() == "second"
    assert names_in(tmp_path) == [name]


def test_a_folder_keeps_its_permissions(tmp_path: Path) -> None:
    path = tmp_path / "f"
    path.mkdir(mode=0o700)
    (path / "old").write_text("")
    with atomic_folder(path) as growing:
        assert stat.S_IMODE(growing.stat().st_mode) == 0o700
        (growing / "new").write_text("")
    assert stat.S_IMODE(path.stat().st_mode) == 0o700
    assert names_in(path) == ["new"]


@pytest.mark.parametrize("error", [KeyboardInterrupt(), OSError(errno.EIO, "broken")])
@pytest.mark.parametrize("after", [True, False])
@pytest.mark.parametrize("step", [1, 2])
def test_a_folder_is_the_old_one_or_the_new_whatever_happens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, after: bool, step: int
) -> None:
    """Between the two renames nothing was there under the name, and the old content hidden."""
    path = tmp_path / "f"
    path.mkdir()
    (path / "old").write_text("precious")
    rename, count = Path.replace, 0

    def fails(self: Path, target: Path) -> Path:
        nonlocal count
        count += 1
        if count == step and not after:
            raise error
        rename(self, target)
        if count == step:
            raise error
        return target

    with pytest.raises(type(error)), atomic_folder(path) as growing:
        (growing / "new").write_text("")
        monkeypatch.setattr(Path, "replace", fails)
    monkeypatch.undo()
    assert names_in(tmp_path) == ["f"]
    assert names_in(path) == (["new"] if (step, after) == (2, True) else ["old"])
