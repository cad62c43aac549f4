# SPDX-License-Identifier: BSD-3-Clause
"""What the folders of runs are called: by what they are of, no two alike, and none too long.

A batch is gone on with by these names, so whatever could be called in the plain way still is.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import unicodedata
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbslam2py.errors import SettingsError

if TYPE_CHECKING:
    from orbslam2py.batches.jobs import Job

#: Bytes of a name on the usual file systems, where letters beyond ASCII have several.
_LONGEST = 255
#: Bytes that are kept of longer ones: with fingerprint and the largest seed they are less than 120.
_KEPT = 80
#: Digits of the fingerprints in names.
_DIGITS = 12
#: What is harmless in names of files beside letters and digits.
_SIGNS = "_.=+"
_OWN_NAMES = "give the sequences names of their own ('path: ..., name: ...')"


def label_of(job: Job, settings: str | None = None, *, exact: bool = False) -> str:
    """Say what a run is of, but for its seed.

    Parameters
    ----------
    job
        The run.
    settings
        What its settings are called; as their file without its ending if None.
    exact
        Write all digits of numbers, not only six.
    """
    parts = [job.name, job.sensor or "", settings or Path(job.settings or "").stem]
    values = (*job.options, *job.parameters)
    parts += [f"{name}={_short(value, exact=exact)}" for name, value in values]
    return "-".join(_plain(part) for part in parts if part)


def key_of(label: str, seed: int) -> str:
    """Name the folder of a run; of a name that no disk takes the end is a fingerprint of it."""
    key = f"{label}-seed{seed}"
    if len(key.encode()) <= _LONGEST:
        return key
    fingerprint = hashlib.sha256(label.encode()).hexdigest()[:_DIGITS]
    kept = label.encode()[:_KEPT].decode(errors="ignore")  # no half of a letter
    return f"{kept}-{fingerprint}-seed{seed}"


def with_labels_of_their_own(jobs: Sequence[Job]) -> list[Job]:
    """Give jobs that would be called alike labels that say more.

    Parameters
    ----------
    jobs
        All of a batch, each once whatever its seeds, without labels.

    Raises
    ------
    SettingsError
        If it is for the user to tell them apart: two sequences of one name, or one run twice; or
        if the file system cannot spell a name.
    """
    places: dict[str, list[int]] = {}
    for place, job in enumerate(jobs):
        places.setdefault(job.setting, []).append(place)
    taken, told = set(places), list(jobs)
    for label, alike in places.items():
        if len(alike) == 1:
            continue
        group = [jobs[place] for place in alike]
        _require_differences(label, group)
        taken.discard(label)
        settings = _names_of({job.settings for job in group if job.settings is not None})
        values = [(job.options, job.parameters) for job in group]
        exact = any(one != values[0] for one in values)
        longer = [label_of(job, settings.get(job.settings or ""), exact=exact) for job in group]
        times = Counter(longer)
        for place, job, one in zip(alike, group, longer, strict=True):
            is_its_own = times[one] == 1 and one not in taken
            own = one if is_its_own else f"{one}-{job.fingerprint[:_DIGITS]}"
            taken.add(own)
            told[place] = replace(job, label=own)
    for job in told:
        _require_spelling(job.key)
    return told


def _require_spelling(key: str) -> None:
    """See that this system can write a name, as in an ASCII locale it could not all letters."""
    try:
        os.fsencode(key)
    except UnicodeEncodeError as error:
        raise SettingsError(
            f"{key} cannot be the name of a folder where names are in "
            f"{sys.getfilesystemencoding()}; give names in letters from a to z, or set LC_ALL to "
            "a locale with UTF-8, such as C.UTF-8"
        ) from error


def _require_differences(label: str, group: list[Job]) -> None:
    """See that runs of one label are of one sequence, and that none is there twice."""
    first = group[0]
    clash = f"two runs would have the folder {key_of(label, first.seed)}: "
    for job in group[1:]:
        if job.name != first.name:
            raise SettingsError(
                f"{clash}the names '{first.name}' and '{job.name}' are one in names of folders; "
                f"give names that differ in letters, digits, or one of {' '.join(_SIGNS)}"
            )
        if job.path != first.path:
            raise SettingsError(f"{clash}{first.path} and {job.path}; {_OWN_NAMES}")
        if job.topics != first.topics:
            raise SettingsError(
                f"{clash}{first.path} with the topics {first.topics} and {job.topics}; {_OWN_NAMES}"
            )
    if any(job in group[:number] for number, job in enumerate(group)):
        raise SettingsError(
            f"{clash}{first.path} twice with the same settings and options; leave one out, or "
            f"{_OWN_NAMES}"
        )


def _names_of(settings: set[str]) -> dict[str, str]:
    """Name files by as much of their paths as tells them apart; nothing if their paths do not."""
    deepest = max((len(Path(one).parts) for one in settings), default=0)
    for depth in range(1, deepest + 1):
        for with_ending in (False, True):
            names = {one: _end_of(Path(one), depth, with_ending=with_ending) for one in settings}
            if _all_differ(names.values()):
                return names
    return {}


def _end_of(path: Path, depth: int, *, with_ending: bool) -> str:
    """Join the last parts of a path, as far as names of folders can hold them."""
    *folders, _ = path.parts[-depth:]
    return _plain("_".join([*folders, path.name if with_ending else path.stem]))


def _all_differ(names: Iterable[str]) -> bool:
    names = list(names)
    return len(set(names)) == len(names)


def _short(value: Any, *, exact: bool) -> str:
    if isinstance(value, float):
        return repr(value) if exact else f"{value:g}"
    return str(value).lower()


def _plain(text: str) -> str:
    """Leave only what is harmless in names of files: letters and digits of any script, few signs.

    Letters with accents are one character each, whichever way they were typed: some file systems
    take both ways for one name.
    """
    if not text.isascii():
        text = unicodedata.normalize("NFC", text)
        pairs = zip(f" {text}", text, strict=False)
        text = "".join(letter if _is_harmless(letter, before) else "/" for before, letter in pairs)
        return re.sub("/+", "_", text)
    return re.sub(r"[^A-Za-z0-9_.=+]+", "_", text)


def _is_harmless(letter: str, before: str) -> bool:
    """Whether a character may stay, behind another one: marks belong to letters in many scripts."""
    if _is_mark(letter):
        return before.isalnum() or _is_mark(before)
    return letter.isalnum() or letter in _SIGNS


def _is_mark(letter: str) -> bool:
    return unicodedata.category(letter).startswith("M")
