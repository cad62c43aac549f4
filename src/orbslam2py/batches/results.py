# SPDX-License-Identifier: BSD-3-Clause
"""Location of the runs of a batch and its table: a folder that all workers see, or a bucket."""

from __future__ import annotations

import contextlib
import importlib
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py._arguments import path_of
from orbslam2py._files import atomic_write, reason_of
from orbslam2py.batches.job import Job
from orbslam2py.batches.remote import is_remote, require_protocols
from orbslam2py.errors import DatasetError, OrbSlamError

#: Marks the place of a batch.
BATCH_FILE = "batch.json"
#: Marks a run that has ended, and holds its row of the table.
ROW_FILE = "row.json"
#: Counts how often a run was begun, while it is being made.
_BEGUN_FILE = "begun.json"
#: As long as it is there no run begins.
_STOP_FILE = "stop"


@dataclass(frozen=True)
class Results:
    """The location of a batch.

    Attributes
    ----------
    address
        An absolute path, or an address for fsspec such as ``s3://bucket/night``.
    """

    address: str

    @classmethod
    def at(cls, place: Any) -> Results:
        """Take a path or an address.

        Raises
        ------
        DatasetError, SettingsError
            If it is neither, or its protocol is not known or not installed.
        """
        if isinstance(place, str) and is_remote(place):
            require_protocols(place)
            return cls(place.rstrip("/"))
        return cls(str(path_of(place, "output").absolute()))

    @property
    def folder(self) -> Path | None:
        """The folder; None if it is remote."""
        return None if is_remote(self.address) else Path(self.address)

    # ---- the batch -------------------------------------------------------------------------------
    def require_free(self, *, resume: bool) -> None:
        """Check that a batch may begin here, or be continued; nothing is written.

        Raises
        ------
        DatasetError
            If it contains other files, or a batch that should not be continued.
        """
        folder = self.folder
        if folder is not None and folder.exists() and not folder.is_dir():
            raise DatasetError(f"{folder} is a file; give the name of a folder")
        if not self.is_there():
            if self._is_taken():
                raise DatasetError(
                    f"{self.address} is not empty and holds no batch; give another folder"
                )
        elif not resume:
            raise DatasetError(
                f"{self.address} holds a batch already; continue with --resume, or give another "
                "folder"
            )

    def begin(self) -> None:
        """Create it, after `require_free`.

        Raises
        ------
        DatasetError
            If it cannot be written.
        """
        try:
            self._write(BATCH_FILE, {"what": "runs of orbslam2py batch"})
            self._remove(_STOP_FILE)
        except OSError as error:
            raise DatasetError(
                f"cannot write to {self.address}: {reason_of(error)}; give another folder"
            ) from error

    def is_there(self) -> bool:
        """Return whether this computer sees the batch."""
        if self.folder is not None:
            return (self.folder / BATCH_FILE).is_file()
        with self._files() as (files, root):
            return bool(files.exists(f"{root}/{BATCH_FILE}"))

    def rows_of(self, jobs: list[Job]) -> dict[str, dict[str, Any]]:
        """Read the rows of finished jobs, by their keys."""
        if self.folder is not None:
            found = {
                key: row
                for key in (job.key for job in jobs)
                if (row := self._read(f"runs/{key}/{ROW_FILE}"))
            }
        else:
            found = self._remote_rows()
        return {
            job.key: row
            for job in jobs
            if (row := found.get(job.key)) is not None
            and row.get("state") == "done"
            and row.get("fingerprint") == job.fingerprint
        }

    @contextlib.contextmanager
    def table(self) -> Iterator[Path]:
        """Yield a local folder for the files of the table.

        The files are uploaded at the end of the ``with`` block.
        """
        if self.folder is not None:
            yield self.folder
            return
        with tempfile.TemporaryDirectory(prefix="orbslam2py-") as name:
            yield Path(name)
            self._upload(Path(name), "")

    # ---- stopping --------------------------------------------------------------------------------
    def forbid_beginning(self) -> None:
        """Prevent further runs on all workers."""
        self._write(_STOP_FILE, {})

    def allow_beginning(self) -> None:
        """Undo `forbid_beginning`."""
        self._remove(_STOP_FILE)

    def may_begin(self) -> bool:
        """Whether runs may begin."""
        if self.folder is not None:
            return not (self.folder / _STOP_FILE).exists()
        with self._files() as (files, root):
            return not files.exists(f"{root}/{_STOP_FILE}")

    # ---- a run -----------------------------------------------------------------------------------
    def count_beginning(self, key: str, session: str) -> int:
        """Record the start of a run, and return its number of starts in this session."""
        name = f"runs/{key}/{_BEGUN_FILE}"
        noted = self._read(name) or {}
        times = int(noted["times"]) + 1 if noted.get("session") == session else 1
        with contextlib.suppress(OSError):  # the run reports a full disk
            self._write(name, {"session": session, "times": times})
        return times

    @contextlib.contextmanager
    def of_run(self, key: str) -> Iterator[Path]:
        """Give the folder of a run; its contents are uploaded at the end of the ``with``."""
        if self.folder is not None:
            yield self.folder / "runs" / key
            return
        with tempfile.TemporaryDirectory(prefix="orbslam2py-") as name:
            made = Path(name) / key
            yield made
            with self._files() as (files, root):
                if files.exists(f"{root}/runs/{key}"):
                    files.rm(f"{root}/runs/{key}", recursive=True)
            self._upload(made, f"runs/{key}/")

    def write_row(self, key: str, row: dict[str, Any]) -> None:
        """Mark a run as ended.

        Raises
        ------
        OSError, DatasetError
            If it cannot be written.
        """
        self._write(f"runs/{key}/{ROW_FILE}", row)
        self._remove(f"runs/{key}/{_BEGUN_FILE}")

    # ---- files -----------------------------------------------------------------------------------
    def _write(self, name: str, content: dict[str, Any]) -> None:
        text = json.dumps(content, indent=2)
        if self.folder is not None:
            path = self.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with atomic_write(path) as stream:
                stream.write(text)
            return
        with self._files() as (files, root):
            files.pipe_file(f"{root}/{name}", text.encode())

    def _read(self, name: str) -> dict[str, Any] | None:
        try:
            if self.folder is not None:
                content = (self.folder / name).read_bytes()
            else:
                with self._files() as (files, root):
                    if not files.exists(f"{root}/{name}"):
                        return None
                    content = files.cat_file(f"{root}/{name}")
            told = json.loads(content)
        except (OSError, ValueError):
            return None
        return told if isinstance(told, dict) else None

    def _remove(self, name: str) -> None:
        if self.folder is not None:
            (self.folder / name).unlink(missing_ok=True)
            return
        with self._files() as (files, root):
            if files.exists(f"{root}/{name}"):
                files.rm_file(f"{root}/{name}")

    def _is_taken(self) -> bool:
        if self.folder is not None:
            return self.folder.is_dir() and any(self.folder.iterdir())
        with self._files() as (files, root):
            return bool(files.exists(root) and files.find(root))

    def _remote_rows(self) -> dict[str, dict[str, Any]]:
        rows = {}
        with self._files() as (files, root):
            found = files.glob(f"{root}/runs/*/{ROW_FILE}")
            for path, content in (files.cat(found) if found else {}).items():
                with contextlib.suppress(ValueError):  # a half one is that of no finished run
                    rows[path.split("/")[-2]] = json.loads(content)
        return rows

    def _upload(self, folder: Path, prefix: str) -> None:
        with self._files() as (files, root):
            for path in sorted(folder.rglob("*")):
                if path.is_file():
                    inner = path.relative_to(folder).as_posix()
                    files.put_file(str(path), f"{root}/{prefix}{inner}")

    @contextlib.contextmanager
    def _files(self) -> Iterator[tuple[Any, str]]:
        """Return fsspec's file system and the path in it; its errors become ours."""
        fsspec = importlib.import_module("fsspec")
        try:
            files, root = fsspec.core.url_to_fs(self.address)
            files.invalidate_cache()
            yield files, root.rstrip("/")
        except OrbSlamError:
            raise
        except Exception as error:  # each protocol has errors of its own
            words = " ".join(str(error).split()) or type(error).__name__
            raise DatasetError(
                f"{self.address} cannot be used: {words}; check the address, the network, and the "
                "right to write there"
            ) from error
