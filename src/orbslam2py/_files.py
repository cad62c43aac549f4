# SPDX-License-Identifier: BSD-3-Clause
"""Writing files and folders so that a reader sees the old content or the new, never a part."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NoReturn

from orbslam2py._arguments import path_of

#: Endings of names, in lower case, that OpenCV reads as single images.
IMAGE_SUFFIXES = (
    ".png",
    ".jpg",
    ".jpeg",
    ".bmp",
    ".tif",
    ".tiff",
    ".webp",
    ".pgm",
    ".ppm",
    ".jp2",
)


_REMEDIES = {
    errno.ENOENT: "make the folder first",
    errno.ENOTDIR: "a part of the path is a file; give another one",
    errno.EISDIR: "give the name of a file",
}


def reason_of(error: OSError) -> str:
    """Say why something failed, without the file, numbers and names of classes."""
    return os.strerror(error.errno) if error.errno else str(error)


def printable_name(name: str) -> str:
    """Spell a name of a file or folder for people, also where the locale is not that of its bytes.

    Parameters
    ----------
    name
        As Python gives it: bytes that the locale cannot read stand for themselves as surrogates,
        which no font has and no page may hold.
    """
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def describe_error(error: BaseException) -> str:
    """Say what failed in words for people; of a file which, and why, without numbers."""
    if not isinstance(error, OSError):
        return str(error) or type(error).__name__
    text = error.strerror or str(error)
    if error.filename is None or str(error.filename) in text:
        return text
    return f"{error.filename}: {text}"


@contextlib.contextmanager
def atomic_write(path: str | os.PathLike[str], *, binary: bool = False) -> Iterator[IO[Any]]:
    r"""Open a file for writing; it appears under its name only when all was written.

    The content goes to a temporary file in the same folder, which replaces `path` at the end of
    the ``with`` block. If the block raises or the disk is full, the temporary file is removed and
    an existing file stays as it was. Devices and pipes are written directly.

    Parameters
    ----------
    path
        The file to write; a symbolic link is followed.
    binary
        Bytes instead of UTF-8 text. Text keeps "\n" as line end on every system.

    Raises
    ------
    OSError
        If the file cannot be written (no permission, no such folder, disk full); the message
        names the file. Subclasses (`PermissionError`, `FileNotFoundError`) as usual.
    DatasetError
        If `path` is no path.
    """
    path = path_of(path, "the file to write")
    target = Path(os.path.realpath(path))
    # Of the path itself: /dev/stdout may lead to a pipe, which has no place.
    if path.exists() and not path.is_file():
        with _open(path, path, os.O_WRONLY, binary) as stream:
            yield stream
        return
    temporary = target.with_name(f".{target.name}.{os.getpid()}-{secrets.token_hex(4)}.tmp")
    try:  # a Ctrl-C may come as soon as it is there
        stream = _open(path, temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, binary)
        try:
            yield stream
        except BaseException:
            with contextlib.suppress(OSError):
                stream.close()
            raise
        _report_as(path, lambda: _finish(stream))
        _report_as(path, lambda: temporary.replace(target))
    except OSError as error:
        _remove(temporary)
        # A full disk shows itself already inside the block, when the buffer is flushed.
        if error.filename is None and error.errno is not None:
            _raise_named(path, error)
        raise
    except BaseException:
        _remove(temporary)
        raise


@contextlib.contextmanager
def atomic_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Make a folder that appears under its name only when everything in it was written.

    Yields a temporary folder beside it, which takes the place of `path` at the end of the ``with``
    block. If the block raises, the temporary folder is removed and an existing folder stays as it
    was; else the existing one is removed with all it holds.

    Parameters
    ----------
    path
        The folder; a symbolic link is followed.

    Raises
    ------
    OSError
        If it cannot be written or replaced.
    """
    target = Path(os.path.realpath(path_of(path, "the folder to write")))
    token = secrets.token_hex(4)
    temporary = target.with_name(f".{target.name}.{token}.tmp")
    try:  # a Ctrl-C may come as soon as it is there
        try:
            temporary.mkdir(parents=True)
        except OSError as error:
            raise OSError(
                error.errno,
                f"cannot write to {path}: {reason_of(error)}; give another folder",
                str(path),
            ) from error
        yield temporary
        if target.exists() and any(target.iterdir()):
            old = target.with_name(f".{target.name}.{token}.old")
            target.replace(old)
            temporary.replace(target)
            shutil.rmtree(old)
        else:
            temporary.replace(target)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _finish(stream: IO[Any]) -> None:
    try:
        stream.flush()
        os.fsync(stream.fileno())
    finally:
        stream.close()


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()


def _open(path: str | os.PathLike[str], actual: Path, flags: int, binary: bool) -> IO[Any]:
    try:
        descriptor = os.open(actual, flags, 0o666)
    except OSError as error:
        _raise_named(path, error)
    if binary:
        return os.fdopen(descriptor, "wb")
    # Names of files may hold bytes that the locale cannot read; in text they stand as they are.
    return os.fdopen(descriptor, "w", encoding="utf-8", errors="surrogateescape", newline="\n")


def _report_as(path: str | os.PathLike[str], step: Callable[[], object]) -> None:
    try:
        step()
    except OSError as error:
        _raise_named(path, error)


def _raise_named(path: str | os.PathLike[str], error: OSError) -> NoReturn:
    remedy = _REMEDIES.get(error.errno or 0, "a file that was there is kept")
    message = f"cannot write {path}: {reason_of(error)}; {remedy}"
    # OSError(errno, ...) makes the matching subclass by itself.
    raise OSError(error.errno, message, str(path)) from error
