# SPDX-License-Identifier: BSD-3-Clause
"""A bag: one file, or the folder of a recording that was split into several files."""

from __future__ import annotations

import re
import shutil
import tempfile
import weakref
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import yaml

from orbslam2py._arguments import cannot_open
from orbslam2py.datasets.bags.libraries import unpack_zstd
from orbslam2py.datasets.bags.mcap_file import McapFile
from orbslam2py.datasets.bags.parts import BagFile, Channel, Place, naming_damage
from orbslam2py.datasets.bags.ros1_file import Ros1File
from orbslam2py.datasets.bags.sqlite_file import SqliteFile
from orbslam2py.errors import DatasetError

#: Endings of files of bags, what their layout is called, and what reads them.
_KINDS: dict[str, tuple[str, type[BagFile]]] = {
    ".bag": ("rosbag1", Ros1File),
    ".db3": ("rosbag2", SqliteFile),
    ".mcap": ("mcap", McapFile),
}
_COMPRESSED = ".zstd"
#: Endings behind those: compressed, or a recording of ROS 1 that was not ended.
_BEHIND = (_COMPRESSED, ".active")
_METADATA = "metadata.yaml"
_INFORMATION = "rosbag2_bagfile_information"
#: ``drive_0.bag``, ``drive_1.bag``: one recording in parts.
_PART = re.compile(r"(.*)_(\d+)")


@dataclass(frozen=True)
class Topic:
    """Messages of one name and type in a bag.

    Attributes
    ----------
    name
        Its name.
    kind
        Type of the messages, as in ROS 2.
    encoding
        Serialisation: ``ros1`` or ``cdr``; others cannot be read.
    n
        Number of messages.
    """

    name: str
    kind: str
    encoding: str
    n: int

    def __str__(self) -> str:
        return f"{self.name} ({self.kind}, {self.n} messages)"


@dataclass(frozen=True, order=True)
class Message:
    """The position of a message."""

    recorded: int
    """Time of recording, nanoseconds."""
    file: int
    """Number of its file."""
    place: Place
    """Place in the file."""


class Bag:
    """The topics of a recording, and their messages by index.

    Only the positions of messages are kept in memory; files stay open as long as the object exists.

    Parameters
    ----------
    path
        A file of ROS 1, SQLite or MCAP, or the folder of a recording.

    Raises
    ------
    DatasetError
        If it is no bag or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        #: Faults of a bag that can be read: whole sentences.
        self.doubts: list[str] = []
        paths = _files_of(path, self.doubts)
        self.layout = _kind_of(paths[0])[0]
        self._files: list[BagFile] = []
        for one in paths:
            with naming_damage(one):
                opened = _kind_of(one)[1](self._unpacked(one))  # type: ignore[call-arg]
            self.doubts += [f"{one} {doubt}" for doubt in opened.doubts]
            self._files.append(opened)
        counts: dict[Channel, int] = {}
        for opened in self._files:
            for channel, n in opened.counts().items():
                counts[channel] = counts.get(channel, 0) + n
        #: Topics in the order of their names.
        self.topics = [
            Topic(channel.topic, channel.kind, channel.encoding, n)
            for channel, n in sorted(counts.items(), key=lambda item: item[0].topic)
        ]

    def messages(self, topic: Topic) -> list[Message]:
        """Return the positions of the messages of a topic, in the order of recording.

        Raises
        ------
        DatasetError
            If the bag is damaged at this position.
        """
        channel = Channel(topic.name, topic.kind, topic.encoding)
        with naming_damage(self.path):
            return sorted(
                Message(place.recorded, number, place)
                for number, file in enumerate(self._files)
                for place in file.places(channel)
            )

    def attachment(self, name: str) -> str | None:
        """Return the text of a file that is attached to an MCAP file; None if there is none."""
        for file in self._files:
            if isinstance(file, McapFile) and name in file.attachments:
                return file.attachments[name].decode("utf-8", "replace")
        return None

    def read(self, message: Message, most: int | None = None) -> bytes:
        """Read a message, or its first bytes."""
        return self._files[message.file].read(message.place, most)

    def _unpacked(self, path: Path) -> Path:
        """Return the file, or a decompressed copy that is deleted with the bag."""
        if path.suffix != _COMPRESSED:
            return path
        folder = Path(tempfile.mkdtemp(prefix="orbslam2py-bag-"))
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        copy = folder / path.stem
        try:
            with path.open("rb") as stream, copy.open("wb") as target:
                problem = unpack_zstd(stream, target)
        except OSError as error:
            raise DatasetError(
                f"{path} cannot be unpacked into {folder}: {error.strerror or error}; make room "
                "there, or name another folder with the variable TMPDIR"
            ) from error
        if problem is not None:
            self.doubts.append(f"{path} {problem}; read as far as it goes")
        return copy


def is_bag(path: Path) -> bool:
    """Return whether a path is a file of a bag by its name, or a folder with such files."""
    if path.is_dir():
        return ((path / _METADATA).is_file() and _INFORMATION in _text(path / _METADATA)) or bool(
            _files_in(path)
        )
    return path.is_file() and _ending(path) in _KINDS


def _ending(path: Path) -> str:
    return Path(path.stem if path.suffix in _BEHIND else path.name).suffix.lower()


def _kind_of(path: Path) -> tuple[str, type[BagFile]]:
    return _KINDS[_ending(path)]


def _files_in(folder: Path) -> list[Path]:
    found = [p for p in folder.iterdir() if _ending(p) in _KINDS and not p.name.startswith(".")]
    return sorted(found, key=_part_key)


def _part_key(path: Path) -> tuple[str, int]:
    stem = path.name.partition(".")[0]
    match = _PART.fullmatch(stem)
    return (match[1], int(match[2])) if match else (stem, -1)


def _files_of(path: Path, doubts: list[str]) -> list[Path]:
    if not path.is_dir():
        if not path.exists():
            raise DatasetError(f"{path} does not exist; give the file of a bag, or its folder")
        return [path]
    if (path / _METADATA).is_file():
        return _listed_files(path, doubts)
    found = _files_in(path)
    endings = {_ending(one) for one in found}
    stems = {_part_key(one)[0] for one in found}
    if not found:
        raise DatasetError(f"{path} holds no bag: looked for {', '.join(_KINDS)}; give its file")
    if len(found) > 1 and (len(endings) > 1 or len(stems) > 1):
        raise DatasetError(
            f"{path} holds {len(found)} bags that are no parts of one recording: "
            f"{', '.join(one.name for one in found)}; give the file of one of them"
        )
    if ".bag" not in endings:
        doubts.append(f"{path} has no {_METADATA}; all bags in the folder are taken")
    return found


def _listed_files(folder: Path, doubts: list[str]) -> list[Path]:
    """Return the existing files that ``metadata.yaml`` lists."""
    path = folder / _METADATA
    try:
        document: Any = yaml.safe_load(_text(path))
        names = document[_INFORMATION]["relative_file_paths"]
        listed = [folder / PurePosixPath(str(name)).name for name in names]
    except (yaml.YAMLError, KeyError, TypeError) as error:
        listed = []
        found = _files_in(folder)
        if not found:
            raise DatasetError(
                f"{path} is damaged, and no bag lies beside it; copy the folder again"
            ) from error
        doubts.append(f"{path} is damaged; all bags in the folder are taken")
        return found
    there = [one for one in listed if one.is_file() and _ending(one) in _KINDS]
    missing = [one.name for one in listed if not one.is_file()]
    unknown = [one.name for one in listed if one.is_file() and _ending(one) not in _KINDS]
    if unknown:
        raise DatasetError(
            f"{folder} is stored as {unknown[0]}, which is not known here; convert it to MCAP or "
            "SQLite with 'ros2 bag convert'"
        )
    if not there:
        raise DatasetError(
            f"none of the {len(listed)} files that {path} lists is there; copy them beside it"
        )
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        doubts.append(
            f"{folder} is not complete: {missing[0]}{more} of {len(listed)} files that "
            f"{_METADATA} lists {'are' if more else 'is'} missing"
        )
    return there


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise DatasetError(cannot_open(path, error)) from error
