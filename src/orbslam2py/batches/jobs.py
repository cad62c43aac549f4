# SPDX-License-Identifier: BSD-3-Clause
"""The runs of a batch: sequences, sensors, settings, options, sweeps and seeds, as a product."""

from __future__ import annotations

import dataclasses
import difflib
import glob
import itertools
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from orbslam2py._arguments import (
    float_of,
    is_number,
    is_whole,
    seed_of,
    shown,
)
from orbslam2py.batches.chosen_settings import require_usable, settings_name
from orbslam2py.batches.job import RUN_OPTIONS, SYSTEM_OPTIONS, Job
from orbslam2py.batches.job_file import read_document
from orbslam2py.batches.keys import with_labels_of_their_own
from orbslam2py.batches.remote import is_remote, name_of, require_protocols
from orbslam2py.batches.sweep import CONFIG_NAMES, Sweep, read_sweep
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings import Sensor

_KEYS = ("sequences", "sensors", "settings", "options", "seeds", "sweep", "output")
_SEQUENCE_KEYS = ("path", "name", "sensor", "settings", "topics")
#: Most runs of a batch: a larger table is not readable, and each job takes memory.
_MOST_RUNS = 100_000


def read_jobs(path: Path, *, elsewhere: bool = False) -> tuple[list[Job], Path | str | None]:
    """Read a job file.

    Parameters
    ----------
    path
        A YAML file; paths in it are relative to its folder.
    elsewhere
        Whether workers may see settings files that this computer does not see.

    Returns
    -------
    jobs, output
        The runs in their order, and the folder or address for the results if the file names one.

    Raises
    ------
    SettingsError
        If the file cannot be read or is invalid.
    DatasetError
        If a sequence is missing.
    """
    document = read_document(path)
    try:
        jobs = make_jobs(document, path.parent, elsewhere=elsewhere)
    except (SettingsError, DatasetError) as error:
        raise type(error)(f"{path}: {error}") from error
    output = document.get("output")
    if output is None or is_remote(str(output)):
        return jobs, output
    return jobs, path.parent / str(output)


def make_jobs(
    document: Mapping[str, Any], folder: Path | None = None, *, elsewhere: bool = False
) -> list[Job]:
    """Make the runs of a job file, or of a dictionary with the same keys.

    Parameters
    ----------
    document
        ``sequences`` and optionally ``sensors``, ``settings``, ``options``, ``seeds``, ``sweep``.
    folder
        The folder of relative paths; None: the present one.
    elsewhere
        Whether workers may see settings files that this computer does not see.

    Raises
    ------
    SettingsError
        For unknown keys and invalid values, for settings that are missing or wrong, or if two runs
        would have the same folder and only the caller can give them different names.
    DatasetError
        If a sequence is missing.
    """
    folder = folder or Path()
    _refuse_unknown(document, _KEYS, "key")
    sequences = _listed(document.get("sequences"))
    if not sequences:
        raise SettingsError("there are no sequences; name some with 'sequences: [PATH, ...]'")
    sensors = _listed(document.get("sensors")) or [None]
    settings = _listed(document.get("settings")) or [None]
    seeds = _seeds(document.get("seeds", 1))
    options = list(_options(document.get("options") or {}))
    sweep = read_sweep(document["sweep"]) if "sweep" in document else Sweep()
    kinds: list[Job] = []  # each stands for as many runs as there are seeds
    for one in itertools.chain.from_iterable(_sequences(entry, folder) for entry in sequences):
        mine = [one["sensor"]] if "sensor" in one else sensors
        own = [one["settings"]] if "settings" in one else settings
        for sensor, setting, option, parameters in itertools.product(
            mine, own, options, sweep.points()
        ):
            job = Job(
                one["path"],
                one["name"],
                None if sensor is None else str(Sensor(sensor)),
                None if setting is None else settings_name(setting, folder, elsewhere=elsewhere),
                one.get("topics"),
                option,
                parameters,
            )
            kinds.append(job)
            _require_few(len(kinds) * len(seeds))
    for kind in kinds:
        kind.run_options(Sensor.MONOCULAR)  # says now what would fail in every run
    require_usable(kinds)
    kinds = with_labels_of_their_own(kinds)
    return [dataclasses.replace(kind, seed=seed) for kind in kinds for seed in seeds]


def _sequences(entry: Any, folder: Path) -> Iterator[dict[str, Any]]:
    if isinstance(entry, Mapping):
        _refuse_unknown(entry, _SEQUENCE_KEYS, "key of a sequence")
        if "path" not in entry:
            raise SettingsError(f"a sequence has no path: {dict(entry)}; add 'path: ...'")
        values = dict(entry)
    else:
        values = {"path": entry}
    address = str(values["path"])
    if is_remote(address):
        require_protocols(address)
        yield {**values, "path": address, "name": str(values.get("name") or name_of(address))}
        return
    pattern = str(folder / address)
    # Not Path.glob: patterns may be absolute.
    found = sorted(glob.glob(pattern)) if glob.has_magic(pattern) else [pattern]  # noqa: PTH207
    if not found:
        raise DatasetError(f"nothing matches {pattern}; correct the pattern")
    if "name" in values and len(found) > 1:
        raise SettingsError(
            f"{len(found)} sequences match {pattern}, all to be called {values['name']}; leave "
            "out the name"
        )
    for path in found:
        if not Path(path).exists():
            raise DatasetError(f"{path} does not exist; correct the path of the sequence")
        name = values.get("name") or Path(path).resolve().name.partition(".")[0]
        yield {**values, "path": str(Path(path).absolute()), "name": str(name)}


def _options(values: Any) -> Iterator[tuple[tuple[str, Any], ...]]:
    """Yield all combinations of options; a list means several values."""
    if not isinstance(values, Mapping):
        raise SettingsError(
            f"options are {shown(values)}; give 'NAME: VALUE' in lines of their own"
        )
    _refuse_unknown(values, (*RUN_OPTIONS, *SYSTEM_OPTIONS, *CONFIG_NAMES), "option")
    names = sorted(values)
    for name in names:
        if _listed(values[name], keep=True) == []:
            raise SettingsError(f"option {name} has no value; give one, or leave it out")
    listed = ([_plain_value(one) for one in _listed(values[name], keep=True)] for name in names)
    for combination in itertools.product(*listed):
        yield tuple(zip(names, combination, strict=True))


def options_of(values: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """Return one set of options, as a `Job` has them.

    Raises
    ------
    SettingsError, DatasetError
        For an unknown option, and for values that would fail in every run.
    """
    _refuse_unknown(values, (*RUN_OPTIONS, *SYSTEM_OPTIONS, *CONFIG_NAMES), "option")
    given = tuple((name, _plain_value(values[name])) for name in sorted(values))
    Job("", "", options=given).run_options(Sensor.MONOCULAR)
    return given


def _plain_value(value: Any) -> Any:
    """Convert numbers of NumPy and others to Python's, which files can contain."""
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if is_whole(value):
        return int(value)
    return float_of(value) if is_number(value) else value


def _seeds(value: Any) -> list[int]:
    if is_whole(value):
        if value < 1:
            raise SettingsError(f"seeds is {value}; give how many runs, or a list of seeds")
        _require_few(value)
        return list(range(value))
    seeds = [seed_of(one, "a seed") for one in _listed(value)]
    if not seeds or len(set(seeds)) < len(seeds):
        raise SettingsError("seeds must be a number of runs, or a list of different seeds")
    return seeds


def _require_few(n_runs: int) -> None:
    if n_runs > _MOST_RUNS:
        raise SettingsError(
            f"that would be {n_runs} runs or more; make batches of at most {_MOST_RUNS}"
        )


def _listed(value: Any, *, keep: bool = False) -> list[Any]:
    if value is None:
        return [None] if keep else []
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else [value]


def _refuse_unknown(values: Mapping[str, Any], known: Sequence[str], what: str) -> None:
    for name in values:
        if name not in known:
            near = difflib.get_close_matches(str(name), known, 1)
            plain = [one for one in known if one not in CONFIG_NAMES]
            hint = f"; did you mean {near[0]}?" if near else f"; there are {', '.join(plain)}"
            raise SettingsError(f"unknown {what} '{name}'{hint}")
