# SPDX-License-Identifier: BSD-3-Clause
"""A small vocabulary of the reference, in several formats, whole and damaged."""

from __future__ import annotations

import io
import random
import tarfile
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import VocabularyError, load_vocabulary
from orbslam2py import _core as core
from support.data import GOLDEN

BOW = GOLDEN / "bow"
TEXT = BOW / "voc_small_k10L3.txt"


def golden(name: str) -> np.ndarray:
    return np.load(BOW / f"{name}.npy")


def with_line(path: Path, number: int, line: str | None) -> Path:
    """Replace a line (1 = the header), or drop it."""
    lines = path.read_text().splitlines()
    lines[number - 1 : number] = [] if line is None else line.split("\n")
    path.write_text("\n".join(lines) + "\n")
    return path


def error_of(path: Path) -> str:
    with pytest.raises(VocabularyError) as caught:
        load_vocabulary(path, cache=False)
    message = str(caught.value)
    assert str(path) in message
    return message


def to_yaml(vocabulary: core.Vocabulary) -> str:
    parents, is_word, centres, weights = vocabulary.table()
    lines = ["%YAML:1.0", "---", "vocabulary:", "   k: 10", "   L: 3", "   scoringType: 0"]
    lines += ["   weightingType: 0", "   nodes:"]
    order = list(range(len(parents)))
    random.Random(3).shuffle(order)
    for row in order:
        numbers = f"nodeId:{row + 1}, parentId:{parents[row]}, weight:{float(weights[row])!r}"
        centre = " ".join(map(str, centres[row]))
        lines += [f"      - {{ {numbers},", f'          descriptor:"{centre} " }}']
    lines.append("   words:")
    for word, row in enumerate(np.flatnonzero(is_word)):
        lines.append(f"      - {{ wordId:{word}, nodeId:{row + 1} }}")
    return "\n".join(lines) + "\n"


def packed(data: bytes) -> bytes:
    stream = io.BytesIO()
    with tarfile.open(fileobj=stream, mode="w:gz") as archive:
        folder = tarfile.TarInfo("Vocabulary")
        folder.type = tarfile.DIRTYPE
        archive.addfile(folder)
        member = tarfile.TarInfo("Vocabulary/words.txt")
        member.size = len(data)
        archive.addfile(member, io.BytesIO(data))
    return stream.getvalue()


BYTES = " ".join(["7"] * 32)
