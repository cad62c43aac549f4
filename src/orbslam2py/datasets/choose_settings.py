# SPDX-License-Identifier: BSD-3-Clause
"""Which settings a sequence is used with when the user names none."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from orbslam2py.errors import DatasetError
from orbslam2py.settings import BUILTIN_NAMES, Sensor, Settings, builtin_settings

#: What a caller may give: settings, a file, a built-in name, or None to let the folder decide.
SettingsChoice = Settings | str | Path | None

_SETTINGS_FILE = "settings.yaml"
_FREIBURG = re.compile(r"freiburg([123])", re.IGNORECASE)


def choose_settings(
    sensor: Sensor,
    folders: tuple[Path, ...],
    from_calibration: Callable[[], Settings | None],
) -> Settings:
    """Choose the settings for a sequence by its folder.

    In this order: ``settings.yaml`` in the folder, the calibration that came with the data, the
    TUM camera that the folder's name tells.

    Parameters
    ----------
    sensor
        What the settings are for.
    folders
        Where ``settings.yaml`` may lie; the first one's name may tell the camera.
    from_calibration
        Makes settings of the data's own calibration, None if there is none.

    Raises
    ------
    SettingsError
        If the file found is wrong.
    DatasetError
        If nothing was found, listing what can be done; or if the calibration
        is malformed.
    """
    for folder in folders:
        path = folder / _SETTINGS_FILE
        if path.is_file():
            return Settings.load(path, sensor)
    settings = from_calibration()
    if settings is not None:
        return settings
    named = _FREIBURG.search(folders[0].name)
    if named and sensor is not Sensor.STEREO:
        return builtin_settings(f"tum{named[1]}", sensor)
    raise DatasetError(
        f"no settings for {folders[0]}: give a settings file or one of the built-in names "
        f"{', '.join(BUILTIN_NAMES)}, or put {_SETTINGS_FILE} into the folder "
        "(KITTI's calib.txt and EuRoC's sensor.yaml are used if they are there)"
    )
