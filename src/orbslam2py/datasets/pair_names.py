# SPDX-License-Identifier: BSD-3-Clause
"""Names of the left and the right camera of a pair: of folders, of topics, of files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

#: Words and numbers that names of the left and the right camera differ in, the clearest first.
_SIDES = (("left", "right"), ("l", "r"), ("0", "1"), ("1", "2"), ("2", "3"))
#: Words (also those of ``cameraLeft``), numbers, and what stands between them.
_TOKEN = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[0-9]+|[^A-Za-z0-9]+")
#: In names such as ``cam0`` or ``image_02`` the number is that of the camera, not of the recording.
_CAMERA = re.compile(
    r"(?<![a-z])(c|cam|camera|images?|img|infra|ir|rgb|colou?r|gr[ae]y|mono|fisheye)[^a-z0-9]*\d",
    re.IGNORECASE,
)
#: The same for files in one folder: there the number of an ``image`` may well be that of the frame.
_CAMERA_WORDS = ("c", "cam", "camera", "infra")
#: Most of a folder that may be in neither of two series.
_OTHERS = 0.5


def side_of_pair(left: str, right: str) -> int | None:
    """Return whether two names are those of the left and the right camera of a pair.

    Such names differ only in one word or number: ``left`` and ``right``, ``l`` and ``r``, 0 and 1,
    1 and 2, or 2 and 3, as in ``/infra1/image`` and ``/infra2/image``.

    Returns
    -------
    int or None
        Rank of the pair of words, the clearest first; None if they are no such names.
    """
    ours, theirs = _TOKEN.findall(left), _TOKEN.findall(right)
    if len(ours) != len(theirs):
        return None
    found = {(_plain(a), _plain(b)) for a, b in zip(ours, theirs, strict=True) if a != b}
    return _SIDES.index(found.pop()) if len(found) == 1 and found <= set(_SIDES) else None


def tells_camera(name: str, side: int) -> bool:
    """Return whether the word or number belongs to a camera: not in ``run1``, ``run2``."""
    return not _SIDES[side][0].isdecimal() or _CAMERA.search(name) is not None


@dataclass(frozen=True)
class Series:
    """Images of the left and of the right camera in one folder.

    Attributes
    ----------
    left, right
        The files by their names without the word for the side.
    sides
        These words.
    n_others
        Files that belong to neither side.
    """

    left: dict[str, Path]
    right: dict[str, Path]
    sides: tuple[str, str]
    n_others: int

    @property
    def common(self) -> list[str]:
        """Return the names without the side that both have; in the order of the left ones."""
        return [name for name in self.left if name in self.right]


def find_series(files: Sequence[Path]) -> Series | None:
    """Find two series of images in one folder: ``left_0000``, ``0000_r``, ``cam0_0000``.

    Parameters
    ----------
    files
        Images of one folder, in their order.

    Returns
    -------
    Series or None
        None if there are no two series, or if they are less than half of the files.
    """
    by_word: dict[str, dict[str, Path]] = {}
    for path in files:
        for word, rest in _without_side(path.stem):
            by_word.setdefault(word, {})[rest] = path
    found = []
    for sides in _SIDES:
        left, right = (by_word.get(word, {}) for word in sides)
        n_others = len(files) - len(set(left.values()) | set(right.values()))
        series = Series(left, right, sides, n_others)
        alike = {_form(name) for name in left} & {_form(name) for name in right}
        if alike and n_others <= _OTHERS * len(files):
            found.append(series)
    return max(found, key=lambda series: len(series.common), default=None)


def _without_side(stem: str) -> list[tuple[str, str]]:
    """Return the words for a side in a name, each with the rest of the name."""
    tokens = _TOKEN.findall(stem)
    found = []
    for k, token in enumerate(tokens):
        word = _plain(token)
        is_number = word.isdecimal()
        if not any(word in sides for sides in _SIDES):
            continue
        if is_number and not (k and tokens[k - 1].lower() in _CAMERA_WORDS and k + 1 < len(tokens)):
            continue
        found.append((word, "".join((*tokens[:k], *tokens[k + 1 :])).strip("_-. ")))
    return found


def _plain(token: str) -> str:
    """A word in lower case, a number without leading zeros: ``image_02`` is camera 2."""
    return token.lstrip("0") or "0" if token.isdecimal() and len(token) <= 2 else token.lower()


def _form(name: str) -> str:
    return re.sub(r"[0-9]+", "0", name)
