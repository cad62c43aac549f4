# SPDX-License-Identifier: BSD-3-Clause
"""Names of the folders of runs: descriptive, all different, and not too long.

A batch is continued by these names, so the plain name is kept where it is possible.
"""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from orbslam2py.batches.job import Job, label_of
from orbslam2py.batches.names import DIGITS, SIGNS, key_of, plain_name
from orbslam2py.errors import SettingsError

_OWN_NAMES = "give the sequences names of their own ('path: ..., name: ...')"


def with_labels_of_their_own(jobs: Sequence[Job]) -> list[Job]:
    """Give jobs with equal names labels that distinguish them.

    Parameters
    ----------
    jobs
        All jobs of a batch without seeds and labels.

    Raises
    ------
    SettingsError
        If only the user can distinguish them: two sequences of one name, or one run twice; or if
        the file system cannot write a name.
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
            own = one if is_its_own else f"{one}-{job.fingerprint[:DIGITS]}"
            taken.add(own)
            told[place] = replace(job, label=own)
    for job in told:
        _require_spelling(job.key)
    return told


def _require_spelling(key: str) -> None:
    """Check that this system can write a name; in an ASCII locale, some letters are impossible."""
    try:
        os.fsencode(key)
    except UnicodeEncodeError as error:
        raise SettingsError(
            f"{key} cannot be the name of a folder where names are in "
            f"{sys.getfilesystemencoding()}; give names in letters from a to z, or set LC_ALL to "
            "a locale with UTF-8, such as C.UTF-8"
        ) from error


def _require_differences(label: str, group: list[Job]) -> None:
    """Check that runs of one label are of one sequence, and that none is repeated."""
    first = group[0]
    clash = f"two runs would have the folder {key_of(label, first.seed)}: "
    for job in group[1:]:
        if job.name != first.name:
            raise SettingsError(
                f"{clash}the names '{first.name}' and '{job.name}' are one in names of folders; "
                f"give names that differ in letters, digits, or one of {' '.join(SIGNS)}"
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
    """Name files by as much of their paths as distinguishes them; empty if the paths do not."""
    deepest = max((len(Path(one).parts) for one in settings), default=0)
    for depth in range(1, deepest + 1):
        for with_ending in (False, True):
            names = {one: _end_of(Path(one), depth, with_ending=with_ending) for one in settings}
            if _all_differ(names.values()):
                return names
    return {}


def _end_of(path: Path, depth: int, *, with_ending: bool) -> str:
    """Join the last parts of a path, within the length of a folder's name."""
    *folders, _ = path.parts[-depth:]
    return plain_name("_".join([*folders, path.name if with_ending else path.stem]))


def _all_differ(names: Iterable[str]) -> bool:
    names = list(names)
    return len(set(names)) == len(names)
