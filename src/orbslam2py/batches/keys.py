# SPDX-License-Identifier: BSD-3-Clause
"""What the folders of runs are called: by what they are of, no two alike, and none too long.

A batch is gone on with by these names, so whatever could be called in the plain way still is.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbslam2py.errors import SettingsError

if TYPE_CHECKING:
    from orbslam2py.batches.jobs import Job

#: Bytes of a name on the usual file systems; names are ASCII.
_LONGEST = 255
#: What is kept of longer ones: with a fingerprint and the largest seed they have less than 120.
_KEPT = 80
#: Digits of the fingerprints in names.
_DIGITS = 12
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
    if len(key) <= _LONGEST:
        return key
    fingerprint = hashlib.sha256(label.encode()).hexdigest()[:_DIGITS]
    return f"{label[:_KEPT]}-{fingerprint}-seed{seed}"


def with_labels_of_their_own(jobs: Sequence[Job]) -> list[Job]:
    """Give jobs that would be called alike labels that say more.

    Parameters
    ----------
    jobs
        All of a batch, each once whatever its seeds, without labels.

    Raises
    ------
    SettingsError
        If it is for the user to tell them apart: two sequences of one name, or one run twice.
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
    return told


def _require_differences(label: str, group: list[Job]) -> None:
    """See that runs of one label are of one sequence, and that none is there twice."""
    first = group[0]
    clash = f"two runs would have the folder {key_of(label, first.seed)}: "
    for job in group[1:]:
        if job.name != first.name:
            raise SettingsError(
                f"{clash}the names '{first.name}' and '{job.name}' are one in names of folders; "
                "give names that differ in letters from a to z, digits, or one of _ . = +"
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
    """Leave only what is harmless in names of files."""
    return re.sub(r"[^A-Za-z0-9_.=+]+", "_", text)
