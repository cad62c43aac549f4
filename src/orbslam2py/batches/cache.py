# SPDX-License-Identifier: BSD-3-Clause
"""A folder of limited size for remote sequences, shared by all workers of a computer."""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py._files import atomic_write, reason_of
from orbslam2py.batches.sizes import bytes_of, text_of
from orbslam2py.errors import DatasetError

DEFAULT_SIZE = "20GB"

#: Puts content into a new folder; gets the folder, and a function to call with the bytes that it
#: needs next.
Fetch = Callable[[Path, Callable[[int], None]], None]


def cache_size_of(size: str | int) -> int:
    """Read the size limit of a cache, such as ``20GB``.

    Raises
    ------
    SettingsError
        If it is no size.
    """
    return bytes_of(size, "the size of the cache", DEFAULT_SIZE)


def default_folder() -> Path:
    """Return where caches of users are."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "orbslam2py/sequences"


@dataclass(frozen=True)
class Cache:
    """A folder of limited size; the content with the oldest use is removed first.

    Attributes
    ----------
    folder
        The folder; it is created at its first use.
    limit
        Size limit in bytes.
    """

    folder: Path
    limit: int

    @contextlib.contextmanager
    def holding(self, address: str, fetch: Fetch) -> Iterator[Path]:
        """Make content available in the cache; it is not removed before the end of the ``with``.

        Parameters
        ----------
        address
            Identification of the content.
        fetch
            Gets the content, if it is not in the cache yet. Other workers that need the same
            content wait for it.

        Yields
        ------
        Path
            The folder that `fetch` has filled.

        Raises
        ------
        DatasetError
            If it does not fit, or the folder cannot be written.
        """
        # A path may hold bytes that are no text.
        key = hashlib.sha256(address.encode("utf-8", "surrogateescape")).hexdigest()[:20]
        with contextlib.ExitStack() as stack:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                while not self._is_held(key, stack):
                    with self._locked(key, fcntl.LOCK_EX):
                        if not (self.folder / key).is_dir():
                            self._fetch(key, address, fetch)
            except OSError as error:
                raise DatasetError(
                    f"cannot write to the cache {self.folder}: {reason_of(error)}; make room, or "
                    "give another --cache"
                ) from error
            yield self.folder / key

    def _is_held(self, key: str, stack: contextlib.ExitStack) -> bool:
        """Protect content until the end of `stack`; False if it is not in the cache."""
        with contextlib.ExitStack() as held:
            held.enter_context(self._locked(key, fcntl.LOCK_SH))
            if not (self.folder / key).is_dir():
                return False
            os.utime(self.folder / key)
            stack.push(held.pop_all())
            return True

    def _fetch(self, key: str, address: str, fetch: Fetch) -> None:
        temporary = self.folder / f"{key}.part"
        shutil.rmtree(temporary, ignore_errors=True)  # of a worker that was killed
        try:
            temporary.mkdir()
            fetch(temporary, lambda size: self._reserve(key, address, size))
            self._reserve(key, address, _size(temporary))
            temporary.rename(self.folder / key)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            self._note(key).unlink(missing_ok=True)
            raise

    def _reserve(self, key: str, address: str, size: int) -> None:
        """Make room for content, and count it."""
        if size > self.limit:
            raise DatasetError(
                f"{address} takes {text_of(size)}, more than the cache of {text_of(self.limit)}; "
                "give more with --cache-size"
            )
        with self._locked("cache", fcntl.LOCK_EX):
            sizes = self._sizes()
            sizes[key] = size
            for other in sorted((name for name in sizes if name != key), key=self._last_used):
                if sum(sizes.values()) <= self.limit:
                    break
                if self._remove(other):
                    del sizes[other]
            if sum(sizes.values()) > self.limit:
                raise DatasetError(
                    f"there is no room for {address} ({text_of(size)}): the cache of "
                    f"{text_of(self.limit)} is full of sequences that are being run; give more "
                    "with --cache-size"
                )
            with atomic_write(self._note(key)) as stream:
                json.dump({"address": address, "size": size}, stream)

    def _sizes(self) -> dict[str, int]:
        sizes = {}
        for note in self.folder.glob("*.json"):
            try:
                told: Any = json.loads(note.read_text(encoding="utf-8"))
                sizes[note.stem] = int(told["size"])
            except (OSError, ValueError, KeyError, TypeError):
                sizes[note.stem] = _size(self.folder / note.stem)
        return sizes

    def _remove(self, key: str) -> bool:
        """Remove content that is not in use; False if it is in use."""
        try:
            with self._locked(key, fcntl.LOCK_EX | fcntl.LOCK_NB):
                shutil.rmtree(self.folder / key, ignore_errors=True)
                shutil.rmtree(self.folder / f"{key}.part", ignore_errors=True)
                self._note(key).unlink(missing_ok=True)
                return True
        except BlockingIOError:
            return False

    def _last_used(self, key: str) -> float:
        try:
            return (self.folder / key).stat().st_mtime
        except OSError:
            return 0.0

    def _note(self, key: str) -> Path:
        return self.folder / f"{key}.json"

    @contextlib.contextmanager
    def _locked(self, name: str, how: int) -> Iterator[None]:
        # The file stays: who waits for it must wait for the same as who comes later.
        with (self.folder / f"{name}.lock").open("w") as stream:
            fcntl.flock(stream, how)
            yield


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
