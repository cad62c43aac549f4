# SPDX-License-Identifier: BSD-3-Clause
"""Vocabularies: find, read, convert and train them.

A vocabulary is a tree over ORB descriptors whose leaves are visual words; relocalization, loop
closing and matching by words need one. The package ships one. ``ORBvoc.txt`` and other files of its
format can be used as well: they are parsed once and stored in the binary format.
"""

from __future__ import annotations

import contextlib
import gzip
import hashlib
import logging
import os
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np

from orbslam2py import _core as core
from orbslam2py._arguments import cannot_open, instance_of, path_of, shown
from orbslam2py._files import atomic_write, printable_name, utf8_name, utf8_path
from orbslam2py.errors import VocabularyError
from orbslam2py.vocabulary import _textio
from orbslam2py.vocabulary.files import Progress, VocabularyFormat, detect_format, read_nodes

ENVIRONMENT_VARIABLE = "ORBSLAM2PY_VOCABULARY"
_SUFFIXES_OF_TEXT = re.compile(r"(\.txt|\.ya?ml|\.tar|\.tgz|\.gz)+$", re.IGNORECASE)
_log = logging.getLogger(__name__)


# ---- load ----------------------------------------------------------------------------------------
def default_vocabulary_path() -> Path:
    """Return the path of the vocabulary that comes with the package."""
    return Path(__file__).parent.parent / "data" / "default.bvoc"


def load_vocabulary(
    path: str | os.PathLike[str] | None = None,
    *,
    cache: bool = True,
    progress: Progress | None = None,
) -> core.Vocabulary:
    """Open a vocabulary of any format, which is recognised by its content.

    Parameters
    ----------
    path : path, optional
        Default: the file in the environment variable ``ORBSLAM2PY_VOCABULARY``, else the vocabulary
        of the package.
    cache : bool
        Store a binary copy of a text file beside it (or in the user's cache folder), and use it as
        long as the text file does not change.
    progress : callable, optional
        Called with the completed fraction, 0 to 1, while a text file is parsed. An exception ends
        it.

    Returns
    -------
    Vocabulary
        Immutable; threads and systems may share it.

    Raises
    ------
    VocabularyError
        The message names the file and, for text files, the first bad line.
    """
    if path is None:
        path = os.environ.get(ENVIRONMENT_VARIABLE) or default_vocabulary_path()
    chosen = path_of(path, "the vocabulary", VocabularyError).expanduser()
    file_format = detect_format(chosen)
    if file_format is VocabularyFormat.BINARY:
        return _open_binary(chosen)
    if not cache:
        return read_nodes(chosen, file_format, progress)

    source = _stamp(chosen)
    for copy in _cache_places(chosen):
        cached = _open_cache(copy)
        if cached is not None and cached.source == source:
            return cached
    vocabulary = read_nodes(chosen, file_format, progress)
    return _keep(vocabulary, chosen, source) or vocabulary


def _open_binary(path: Path) -> core.Vocabulary:
    return core.Vocabulary.open(utf8_path(path, VocabularyError))


def vocabulary_name(choice: core.Vocabulary | str | os.PathLike[str] | None) -> str:
    """Return the file of a vocabulary, as `load_vocabulary` chooses it.

    One in memory has the name of the package's own if it is equal, otherwise None.
    """
    if isinstance(choice, core.Vocabulary):
        own = default_vocabulary_path()
        return own.name if _open_binary(own).hash == choice.hash else ""
    return Path(choice or os.environ.get(ENVIRONMENT_VARIABLE) or default_vocabulary_path()).name


def _stamp(path: Path) -> core.VocabularySource:
    """Return size, time and samples of a file, to notice a change without reading all of it."""
    sample = 1 << 20
    try:
        status = path.stat()
        digest = hashlib.blake2b(digest_size=8)
        with path.open("rb") as file:
            for start in (0, status.st_size // 2, max(0, status.st_size - sample)):
                file.seek(start)
                digest.update(file.read(sample))
    except OSError as error:
        raise VocabularyError(cannot_open(path, error)) from error
    content = int.from_bytes(digest.digest(), "little")
    return core.VocabularySource(status.st_size, status.st_mtime_ns, content)


def _cache_places(path: Path) -> tuple[Path, Path]:
    name = _SUFFIXES_OF_TEXT.sub("", path.name) + ".bvoc"
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    folder = Path(home).expanduser() / "orbslam2py"
    key = hashlib.blake2b(os.fsencode(path.resolve()), digest_size=8).hexdigest()
    # The core opens names in UTF-8 alone; the key tells apart what the second spells alike.
    return path.with_name(name), folder / f"{key}-{utf8_name(name)}"


def _open_cache(path: Path) -> core.Vocabulary | None:
    with contextlib.suppress(VocabularyError):
        return _open_binary(path)
    return None


def _keep(
    vocabulary: core.Vocabulary, path: Path, source: core.VocabularySource
) -> core.Vocabulary | None:
    """Write the binary copy and open it, so that processes share its memory; None if impossible."""
    for copy in _cache_places(path):
        if copy.exists():
            present = _open_cache(copy)
            if present is None or present.source == core.VocabularySource():
                continue  # not a copy that we made: somebody's own file
        with contextlib.suppress(OSError, VocabularyError):
            copy.parent.mkdir(parents=True, exist_ok=True)
            named = utf8_path(copy, VocabularyError)
            vocabulary.save(named, f"Converted from {printable_name(path.name)}.", source)
            _log.info("kept a binary copy of %s in %s", path, copy)
            return _open_binary(copy)
    return None


# ---- save and convert ----------------------------------------------------------------------------
def save_vocabulary(
    vocabulary: core.Vocabulary,
    path: str | os.PathLike[str],
    *,
    comment: str | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a vocabulary; the name determines the format: ``.bvoc``, ``.txt`` or ``.txt.gz``.

    Parameters
    ----------
    vocabulary : Vocabulary
    path : path
        The file; replaced only after everything is written.
    comment : str, optional
        Origin and licence, stored in the binary format; default: those of the vocabulary.
    progress : callable, optional
        Called with the completed fraction, 0 to 1.

    Raises
    ------
    VocabularyError
        If the name has another suffix or the file cannot be written.
    """
    if not isinstance(vocabulary, core.Vocabulary):
        raise VocabularyError(
            f"the vocabulary is {shown(vocabulary)}; give one that load_vocabulary returned"
        )
    target = path_of(path, "the file of the vocabulary", VocabularyError).expanduser()
    if target.suffix == ".bvoc":
        named = utf8_path(target, VocabularyError)
        if comment is not None:
            remedy = "text, or None for that of the vocabulary"
            comment = printable_name(instance_of(comment, str, "comment", remedy, VocabularyError))
        vocabulary.save(named, comment, core.VocabularySource())
    elif target.suffix == ".txt":
        _write_text(vocabulary, target, contextlib.nullcontext, progress)
    elif target.name.endswith(".txt.gz"):
        _write_text(
            vocabulary, target, lambda file: gzip.GzipFile(fileobj=file, mode="wb"), progress
        )
    else:
        raise VocabularyError(f"{target}: the name must end with .bvoc, .txt or .txt.gz")
    if progress is not None:
        progress(1.0)


def _write_text(
    vocabulary: core.Vocabulary,
    target: Path,
    packed: Callable[[IO[bytes]], AbstractContextManager[_textio._Target]],
    progress: Progress | None,
) -> None:
    header = (
        vocabulary.branching,
        vocabulary.depth,
        int(vocabulary.scoring),
        int(vocabulary.weighting),
    )
    report = None if progress is None else lambda n: progress(n / vocabulary.n_nodes)
    try:
        with atomic_write(target, binary=True) as file, packed(file) as text:
            _textio.write_vocabulary_text(text, header, vocabulary.table(), report)
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise VocabularyError(f"{target}: cannot be written: {reason}") from error


def convert_vocabulary(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    progress: Progress | None = None,
) -> core.Vocabulary:
    """Read a vocabulary in any format and write it in another.

    Parameters
    ----------
    source : path
        As for :func:`load_vocabulary`.
    target : path
        As for :func:`save_vocabulary`: the name determines the format.
    progress : callable, optional
        Called with the completed fraction, 0 to 1.

    Returns
    -------
    Vocabulary
        What was read.

    Raises
    ------
    VocabularyError
        If one cannot be read or the other not be written.
    """
    source = path_of(source, "the vocabulary", VocabularyError)
    vocabulary = load_vocabulary(source, cache=False, progress=_half(progress, 0.0))
    comment = vocabulary.comment or f"Converted from {Path(source).name}."
    save_vocabulary(vocabulary, target, comment=comment, progress=_half(progress, 0.5))
    return vocabulary


def _half(progress: Progress | None, begin: float) -> Progress | None:
    return None if progress is None else lambda done: progress(begin + done / 2)


# ---- look ----------------------------------------------------------------------------------------
@dataclass(frozen=True)
class VocabularyInfo:
    """The properties of a vocabulary file."""

    path: Path
    format: VocabularyFormat
    size: int
    """Bytes on disk."""
    branching: int
    depth: int
    scoring: str
    weighting: str
    n_nodes: int
    """The root included."""
    n_words: int
    n_stopped: int
    """Words of weight 0, which are ignored."""
    sha256: str
    comment: str


def vocabulary_info(path: str | os.PathLike[str] | None = None) -> VocabularyInfo:
    """Read and check a whole vocabulary, and return its properties.

    Parameters
    ----------
    path : path, optional
        Default: as for :func:`load_vocabulary`.

    Raises
    ------
    VocabularyError
        If it is damaged or not a vocabulary.
    """
    if path is None:
        path = os.environ.get(ENVIRONMENT_VARIABLE) or default_vocabulary_path()
    chosen = path_of(path, "the vocabulary", VocabularyError)
    vocabulary = load_vocabulary(chosen, cache=False)
    vocabulary.check_content()
    _, is_word, _, weights = vocabulary.table()
    return VocabularyInfo(
        path=chosen,
        format=detect_format(chosen),
        size=chosen.stat().st_size,
        branching=vocabulary.branching,
        depth=vocabulary.depth,
        scoring=vocabulary.scoring.name,
        weighting=vocabulary.weighting.name,
        n_nodes=vocabulary.n_nodes,
        n_words=vocabulary.n_words,
        n_stopped=int(np.count_nonzero((is_word != 0) & (weights == 0))),
        sha256=vocabulary.sha256(),
        comment=vocabulary.comment,
    )
