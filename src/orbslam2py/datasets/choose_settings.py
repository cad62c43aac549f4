# SPDX-License-Identifier: BSD-3-Clause
"""The settings of a sequence if the user gives none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from orbslam2py.errors import DatasetError
from orbslam2py.settings import Sensor, Settings, builtin_settings, resolve_settings

#: Values that a caller may give: settings, a file, a built-in name, or None to let the folder
#: decide.
SettingsChoice = Settings | str | Path | None

_SETTINGS_FILE = "settings.yaml"
#: ``rgbd_dataset_freiburg1_desk``, ``fr1_desk``.
_FREIBURG = re.compile(r"(?:freiburg|(?<![a-z0-9])fr)([123])(?![0-9])", re.IGNORECASE)


def choose_settings(
    sensor: Sensor,
    folders: tuple[Path, ...],
    from_calibration: Callable[[], Settings | None],
    advice: str,
) -> Settings:
    """Choose the settings for a sequence by its folder.

    In this order: ``settings.yaml`` in the folder, the calibration of the data, the TUM camera in
    the name of the folder or of a link to it.

    Parameters
    ----------
    sensor
        The sensor of the settings.
    folders
        Folders that may contain ``settings.yaml``. The name of the first one, as given and without
        links, may tell the camera.
    from_calibration
        Makes settings of the data's own calibration; returns None if there is none.
    advice
        What is missing in data of this layout, and the remedy, for the message.

    Raises
    ------
    SettingsError
        If the file is invalid.
    DatasetError
        If nothing was found, with the advice; or if the calibration is malformed.
    """
    for folder in folders:
        path = folder / _SETTINGS_FILE
        if path.is_file():
            return resolve_settings(path, sensor)
    settings = from_calibration()
    if settings is not None:
        return settings
    names = (folders[0].resolve().name, folders[0].absolute().name)
    named = next(filter(None, map(_FREIBURG.search, names)), None)
    if named and sensor is not Sensor.STEREO:
        return builtin_settings(f"tum{named[1]}", sensor)
    shown = folders[0] if folders[0].name else folders[0].resolve()
    raise DatasetError(
        f"no settings for {shown}: {advice}; for another camera give a file of its own, or put it "
        f"into the folder as {_SETTINGS_FILE}; 'orbslam2py settings new' makes one of the "
        "numbers of "
        "the camera"
    )
