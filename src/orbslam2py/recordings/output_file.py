# SPDX-License-Identifier: BSD-3-Clause
"""A file that grows during a run, and appears when it is complete."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable
from pathlib import Path

from orbslam2py._arguments import path_of
from orbslam2py._files import reason_of, take_mode, temporary_beside, utf8_path
from orbslam2py.errors import OutputFileError

#: So much is left free on a disk, for what else a run has to write [bytes].
RESERVE = 32 * 2**20


class OutputFile:
    """A hidden file that gets its name at the end.

    Some space of the disk is reserved, because such a file is readable only with its last part.

    Parameters
    ----------
    path : str or Path
        Final path of the file.
    what : str
        Its name in messages: "video".
    suffixes : iterable of str
        Allowed suffixes of the name, in lower case.

    Attributes
    ----------
    path : Path
        The path as given.
    temporary : Path
        Path to write to.

    Raises
    ------
    OutputFileError
        If the file certainly cannot be written.
    """

    def __init__(self, path: str | os.PathLike[str], what: str, suffixes: Iterable[str]) -> None:
        self.path = path_of(path, f"the {what}", OutputFileError)
        self._what = what
        _check_name(self.path, what, list(suffixes))
        target = Path(os.path.realpath(self.path))
        _check_folder(self.path, target)
        self._target = target
        # The writer depends on the suffix, so the suffix stays at the end.
        self.temporary = temporary_beside(target, f".tmp{target.suffix.lower()}")
        self.require_room()

    def require_room(self) -> None:
        """Check that there is space for more.

        Raises
        ------
        OutputFileError
            If the disk is nearly full.
        """
        try:
            free = shutil.disk_usage(self._target.parent).free
        except OSError as error:
            raise self.error(reason_of(error)) from error
        if free < RESERVE:
            raise self.error(
                f"the disk is full but for {RESERVE // 2**20} MB that are left to the run's other "
                "files; take a place with more room"
            )

    def error(self, why: str) -> OutputFileError:
        """Make an error that names the file."""
        return OutputFileError(f"cannot write the {self._what} {self.path}: {why}")

    def publish(self) -> None:
        """Give the file its name; it replaces an existing file and keeps its permissions.

        Raises
        ------
        OutputFileError
            If that cannot be done.
        """
        take_mode(self.temporary, self._target)
        try:
            self.temporary.replace(self._target)
        except OSError as error:
            raise self.error(reason_of(error)) from error

    def discard(self) -> None:
        """Remove the unfinished file."""
        with contextlib.suppress(OSError):
            self.temporary.unlink()


def _check_name(path: Path, what: str, suffixes: list[str]) -> None:
    if path.suffix.lower() not in suffixes:
        *others, last = suffixes
        names = f"{', '.join(others)} or {last}" if others else last
        raise OutputFileError(f"{path} does not end like a {what}; name it with {names}")
    if path.is_dir():
        raise OutputFileError(f"{path} is a folder; give the name of a file in it")


def _check_folder(path: Path, target: Path) -> None:
    folder = target.parent
    if not folder.is_dir():
        raise OutputFileError(f"there is no folder {path.parent} for {path.name}; make it first")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputFileError(f"{path} cannot be written: no right to write into {path.parent}")
    # Its own name may be any: it is written under another one.
    utf8_path(folder, OutputFileError, "rename the folder, or take another one")
