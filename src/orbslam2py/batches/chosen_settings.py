# SPDX-License-Identifier: BSD-3-Clause
"""Settings of the runs of a batch, checked before the first run."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from orbslam2py._arguments import path_of
from orbslam2py.batches.job import Job
from orbslam2py.errors import SettingsError
from orbslam2py.settings import BUILTIN_NAMES, Sensor, Settings, builtin_settings
from orbslam2py.settings.builtin import is_builtin_name
from orbslam2py.settings.reader import read_groups
from orbslam2py.settings.rig_file import read_rig_groups
from orbslam2py.settings.settings import looks_like_path


def settings_name(choice: Any, folder: Path, *, elsewhere: bool) -> str:
    """Return the settings of a choice: a file beside the job file, or built-in settings.

    Parameters
    ----------
    choice
        A path or a name.
    folder
        The folder of relative paths.
    elsewhere
        Accept missing paths: workers on other computers may see them.

    Raises
    ------
    SettingsError
        If it is neither.
    """
    if isinstance(choice, Settings):
        raise SettingsError(
            "settings are a Settings object, which the table cannot name; save it "
            "(settings.save('camera.yaml')) and give the path"
        )
    name = path_of(choice, "settings", SettingsError)
    path = folder / name
    if path.exists():
        return str(path.absolute())
    if is_builtin_name(str(name)):
        return str(choice)
    if not looks_like_path(name):
        raise SettingsError(
            f"settings '{name}' are no file in {folder} and none of the built-in ones "
            f"({', '.join(BUILTIN_NAMES)}); correct the name"
        )
    if not elsewhere:
        raise SettingsError(
            f"settings file {path.absolute()} does not exist; correct the path, or give the name "
            f"of built-in settings ({', '.join(BUILTIN_NAMES)})"
        )
    return str(choice)


def require_usable(jobs: Iterable[Job]) -> None:
    """Check that all settings fit at least one of their sensors.

    A job file combines everything with everything, so settings for another sensor are no mistake:
    these runs fail, and the table says why.

    Raises
    ------
    SettingsError
        If no run with some settings could begin; the message says what is wrong with them.
    """
    sensors: dict[str, dict[Sensor, None]] = {}
    for job in jobs:
        if job.settings is not None:
            # The richest that a sequence has images for is known when it is opened.
            wanted = list(Sensor) if job.sensor is None else [Sensor(job.sensor)]
            sensors.setdefault(job.settings, {}).update(dict.fromkeys(wanted))
    for name, wanted_for in sensors.items():
        if not is_builtin_name(name) and not Path(name).exists():
            continue  # it may be where the workers are
        problems = [_problem_of(name, sensor) for sensor in wanted_for]
        # The first sensor is the one that needs least, if none is named.
        if problems[0] is not None and all(problems):
            raise problems[0]


def _problem_of(name: str, sensor: Sensor) -> SettingsError | None:
    """Return why settings do not fit a sensor; the runs report mere doubts."""
    try:
        if is_builtin_name(name):
            builtin_settings(name, sensor)
        else:
            read = read_rig_groups if sensor is Sensor.RIG else read_groups
            groups = read(Path(name), sensor, allow_unknown=False, warn=lambda _: None)
            Settings(sensor=sensor, **groups)
    except SettingsError as error:
        return error
    return None
