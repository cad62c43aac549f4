# SPDX-License-Identifier: BSD-3-Clause
"""Writing of files and folders so that readers see the old or the new content, never a part."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, NoReturn

from orbslam2py._arguments import path_of
from orbslam2py.errors import OrbSlamError

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
#: Letters of a file's name in that of the hidden one beside it, which must not become too long.
_LETTERS = 24


def reason_of(error: OSError) -> str:
    """Return why something failed, without file, numbers and class names."""
    return os.strerror(error.errno) if error.errno else str(error)


def printable_name(name: str) -> str:
    """Return the name of a file or folder for messages, in any locale.

    Parameters
    ----------
    name
        Python replaces bytes that the locale cannot decode by surrogates, which no font has and no
        page may contain.
    """
    return name.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def utf8_name(name: str) -> str:
    """Return the name of a file whose bytes are UTF-8, as Python writes it in this locale."""
    return os.fsdecode(printable_name(name).encode())


def utf8_path(
    path: Path,
    error: type[OrbSlamError],
    remedy: str = "rename the file, or the folder it is in",
) -> str:
    """Return a path for libraries that need UTF-8, such as the core and OpenCV.

    The core accepts only UTF-8. OpenCV ends the whole program at surrogates, which replace bytes
    that the locale cannot decode, although these may be valid UTF-8.

    Parameters
    ----------
    path
        Path of the file.
    error
        If the path has bytes that are not UTF-8.
    remedy
        The remedy.
    """
    try:
        return os.fsencode(path).decode()
    except UnicodeError:
        raise error(f"the path {path} is not UTF-8, and so it cannot be used; {remedy}") from None


def kind_of_special(path: Path) -> str | None:
    """Return the kind of a path that is neither file nor folder: a pipe would wait for a writer.

    Raises
    ------
    OSError
        If there is nothing.
    """
    mode = path.stat().st_mode
    if stat.S_ISREG(mode) or stat.S_ISDIR(mode):
        return None
    kinds = ((stat.S_ISFIFO, "pipe"), (stat.S_ISSOCK, "socket"))
    return next((name for is_kind, name in kinds if is_kind(mode)), "device")


def temporary_beside(target: Path, ending: str = ".tmp") -> Path:
    """Return a hidden name in the folder of a file or folder, in UTF-8.

    It begins like the target's name, but is short, because a name of the greatest allowed length
    has no room for additions.
    """
    beginning = printable_name(target.name)[:_LETTERS]
    name = f".{beginning}.{os.getpid()}-{secrets.token_hex(4)}{ending}"
    return target.with_name(utf8_name(name))


def take_mode(place: Path, target: Path, more: int = 0) -> None:
    """Give a replacement the permissions of the old file or folder: private ones stay private.

    Parameters
    ----------
    place
        The replacement.
    target
        If there is none, nothing happens.
    more
        Further permissions for it.
    """
    # Some file systems have no permissions, and refuse to change them.
    with contextlib.suppress(OSError):
        place.chmod(stat.S_IMODE(target.stat().st_mode) | more)


@contextlib.contextmanager
def failing_as(folder: Path, made: Path) -> Iterator[None]:
    """Let errors name the requested folder, not a file in the temporary one."""
    try:
        yield
    except OSError as error:
        place = None if error.filename is None else Path(str(error.filename))
        if place is not None and place != made and made not in place.parents:
            raise  # it is something that was to be read
        is_full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        remedy = f"{'make room, or ' if is_full else ''}give another folder"
        message = f"cannot write to {folder}: {reason_of(error)}; {remedy}"
        raise OSError(error.errno, message, str(folder)) from error


def describe_error(error: BaseException) -> str:
    """Return a readable message: what failed, with which file and why, without numbers."""
    if not isinstance(error, OSError):
        return str(error) or type(error).__name__
    text = error.strerror or str(error)
    if error.filename is None or str(error.filename) in text:
        return text
    return f"{error.filename}: {text}"


@contextlib.contextmanager
def atomic_write(path: str | os.PathLike[str], *, binary: bool = False) -> Iterator[IO[Any]]:
    r"""Open a file for writing; it gets its name only after everything is written.

    The content goes to a temporary file in the same folder, which replaces `path` at the end of the
    ``with`` block. If the block raises or the disk is full, the temporary file is removed and an
    existing file is kept. Otherwise the new file gets the permissions of the old one. Devices and
    pipes are written directly.

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
    temporary = temporary_beside(target)
    try:  # a Ctrl-C may arrive once it exists
        stream = _open(path, temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, binary)
        try:
            take_mode(temporary, target)
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
    """Make a folder that gets its name only after everything in it is written.

    Yields a temporary folder beside it, which replaces `path` at the end of the ``with`` block. If
    anything fails, the temporary folder is removed and an existing folder is kept. Otherwise the
    existing one is removed with its contents; only its permissions are kept.

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
    temporary, old = temporary_beside(target), temporary_beside(target, ".old")
    try:  # a Ctrl-C may arrive once it exists
        try:
            temporary.mkdir(parents=True)
        except OSError as error:
            raise OSError(
                error.errno,
                f"cannot write to {path}: {reason_of(error)}; give another folder",
                str(path),
            ) from error
        take_mode(temporary, target, stat.S_IRWXU)
        yield temporary
        if target.exists() and any(target.iterdir()):
            target.replace(old)
        temporary.replace(target)
        if old.exists():
            shutil.rmtree(old)
    except BaseException:
        if os.path.lexists(old) and not os.path.lexists(target):  # between the two renames
            old.replace(target)
        elif not os.path.lexists(temporary):  # the new one is in its place
            shutil.rmtree(old, ignore_errors=True)
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
