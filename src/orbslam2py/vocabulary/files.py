# SPDX-License-Identifier: BSD-3-Clause
"""Recognises the format of a vocabulary file by its content, and reads it.

Binary (our own, memory-mapped), text (ORBvoc.txt), text packed with gzip or tar and gzip, and the
YAML form of DBoW2.
"""

from __future__ import annotations

import bisect
import gzip
import re
import tarfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from enum import Enum
from pathlib import Path
from typing import IO, cast

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import cannot_open
from orbslam2py.errors import VocabularyError
from orbslam2py.vocabulary import _textio

Progress = Callable[[float], object]
"""Gets the completed fraction, 0 to 1."""


class VocabularyFormat(str, Enum):
    """The format of a file, independent of its name."""

    BINARY = "binary"
    TEXT = "text"
    GZIP = "text in gzip"
    TAR = "text in tar"
    YAML = "yaml"


_UNKNOWN = (
    "not a vocabulary; expected the binary format (.bvoc), the text format (ORBvoc.txt, also "
    "packed with gzip or tar) or DBoW2's YAML"
)
_BLOCK = 1 << 20


def detect_format(path: Path) -> VocabularyFormat:
    """Return the format of a file by its first bytes.

    Raises
    ------
    VocabularyError
        If the file cannot be read or has none of these formats.
    """
    with _reading(path), path.open("rb") as file:
        head = file.read(512)
        if head[:4] == b"BVOC":
            return VocabularyFormat.BINARY
        packed = _is_gzip(path)
        if packed:
            file.seek(0)
            with gzip.open(file) as unpacked:
                head = unpacked.read(512)
    if _is_tar(head):
        return VocabularyFormat.TAR
    if not packed and re.match(rb"(%YAML|---|vocabulary\s*:)", head):
        return VocabularyFormat.YAML
    if re.match(rb"\s*\d", head) and b"\0" not in head:
        return VocabularyFormat.GZIP if packed else VocabularyFormat.TEXT
    raise VocabularyError(f"{path}: {_UNKNOWN}")


def read_nodes(
    path: Path, file_format: VocabularyFormat, progress: Progress | None = None
) -> core.Vocabulary:
    """Read any format but the binary one into memory.

    Raises
    ------
    VocabularyError
        The message names the path, the first bad line or node, and the fault.
    """
    with _reading(path):
        if file_format is VocabularyFormat.YAML:
            return _build(path, *_read_yaml(path), _node_name)
        size = path.stat().st_size
        with _open_text(path, file_format) as (raw, text):

            def report(_: int) -> None:
                if progress is not None:
                    progress(min(0.9, 0.9 * raw.tell() / size))

            hint = size if file_format is VocabularyFormat.TEXT else 0
            header, columns, empty_lines = _textio.read_vocabulary_text(text, hint, report)

        def line_of(node: int) -> str:
            return f"line {1 + node + bisect.bisect_left(empty_lines, node)}"

        vocabulary = _build(path, header, columns, line_of)
    if progress is not None:
        progress(1.0)
    return vocabulary


def _build(
    path: Path,
    header: _textio.Header,
    columns: _textio.Columns,
    place_of: Callable[[int], str],
) -> core.Vocabulary:
    branching, depth, scoring, weighting = header
    problem = core.find_problem(branching, depth, *columns)
    if problem is not None:
        node, what = problem
        raise VocabularyError(f"{place_of(node)}: {what}")
    return core.Vocabulary.from_table(
        branching, depth, core.Scoring(scoring), core.Weighting(weighting), *columns
    )


def _node_name(node: int) -> str:
    return f"node {node}"


def _is_tar(head: bytes) -> bool:
    return head[257:262] == b"ustar"


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Convert errors of reading to errors that name the path."""
    try:
        yield
    except VocabularyError as error:
        message = str(error)
        named = message if message.startswith(str(path)) else f"{path}: {message}"
        raise VocabularyError(named) from error
    except OSError as error:
        # gzip's own complaints are OSErrors without a code
        if error.errno is not None:
            raise VocabularyError(cannot_open(path, error)) from error
        raise VocabularyError(f"{path}: damaged archive ({error}); get it again") from error
    except (EOFError, zlib.error, tarfile.TarError) as error:
        raise VocabularyError(f"{path}: damaged archive ({error}); get it again") from error


@contextmanager
def _open_text(
    path: Path, file_format: VocabularyFormat
) -> Iterator[tuple[IO[bytes], _textio._Source]]:
    """Yield the file itself, for its position, and the stream of text in it."""
    with path.open("rb") as raw, ExitStack() as stack:
        unpacked: IO[bytes] = raw
        if _is_gzip(path):
            unpacked = cast("IO[bytes]", stack.enter_context(gzip.open(raw)))
        content = unpacked
        if file_format is VocabularyFormat.TAR:
            content = _first_file(stack.enter_context(tarfile.open(fileobj=unpacked, mode="r|")))
        yield raw, cast("_textio._Source", content)
        while unpacked.read(_BLOCK):  # to the checksum at the end
            pass


def _is_gzip(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


def _first_file(archive: tarfile.TarFile) -> IO[bytes]:
    for member in archive:
        content = archive.extractfile(member) if member.isfile() else None
        if content is not None:
            return content
    raise VocabularyError("the archive holds no file")


# ---- YAML ----------------------------------------------------------------------------------------
_YAML_SCALARS = {
    "k": rb"\bk\s*:\s*(\d+)",
    "L": rb"\bL\s*:\s*(\d+)",
    "scoringType": rb"\bscoringType\s*:\s*(\d+)",
    "weightingType": rb"\bweightingType\s*:\s*(\d+)",
}
_YAML_NODE = re.compile(
    rb"nodeId\s*:\s*(\d+)\s*,\s*parentId\s*:\s*(\d+)\s*,\s*weight\s*:\s*([^,\s]+)\s*,"
    rb"\s*descriptor\s*:\s*\"?([\d\s]*)\"?"
)
_YAML_WORD = re.compile(rb"wordId\s*:\s*(\d+)\s*,\s*nodeId\s*:\s*(\d+)")


def _read_yaml(path: Path) -> tuple[_textio.Header, _textio.Columns]:
    """Read DBoW2's YAML form, whose nodes are in any order and contain their numbers."""
    data = path.read_bytes()
    nodes_at = data.find(b"nodes:")
    words_at = data.find(b"words:", nodes_at)
    if nodes_at < 0 or words_at < 0:
        raise VocabularyError("not a vocabulary, it has no 'nodes' and 'words'")
    values = []
    for name, pattern in _YAML_SCALARS.items():
        match = re.search(pattern, data[:nodes_at])
        if match is None:
            raise VocabularyError(f"not a vocabulary, '{name}' is missing")
        values.append(match[1])
    header = _textio.read_header(b" ".join(values))

    nodes = list(_YAML_NODE.finditer(data, nodes_at, words_at))
    if data.count(b"nodeId", nodes_at, words_at) != len(nodes):
        raise VocabularyError("a node lacks its nodeId, parentId, weight or descriptor")
    count = len(nodes)
    parents = np.zeros(count, np.uint32)
    is_word = np.zeros(count, np.uint8)
    centres = np.zeros((count, 32), np.uint8)
    weights = np.full(count, np.nan)
    seen = np.zeros(count, bool)
    for match in nodes:
        row = int(match[1]) - 1
        if not 0 <= row < count or seen[row]:
            raise VocabularyError(f"node {row + 1}: its number is repeated or out of range")
        seen[row] = True
        _fill_yaml_node(match, row, parents, centres, weights)
    last_row = -1
    for word, match in enumerate(_YAML_WORD.finditer(data, words_at)):
        row = int(match[2]) - 1
        if int(match[1]) != word or not last_row < row < count:
            raise VocabularyError(f"word {word}: words must be listed in the order of their nodes")
        is_word[row] = 1
        last_row = row
    weights[is_word == 0] = 0.0
    return header, (parents, is_word, centres, weights)


def _fill_yaml_node(
    match: re.Match[bytes],
    row: int,
    parents: np.ndarray,
    centres: np.ndarray,
    weights: np.ndarray,
) -> None:
    values = [int(value) for value in match[4].split()]
    if len(values) != 32 or max(values) > 255:
        raise VocabularyError(f"node {row + 1}: its descriptor must be 32 numbers from 0 to 255")
    try:
        weights[row] = float(match[3])
    except ValueError:
        raise VocabularyError(f"node {row + 1}: its weight is not a number") from None
    parents[row] = min(int(match[2]), 0xFFFFFFFF)  # the tree's check refuses it by its node
    centres[row] = values
