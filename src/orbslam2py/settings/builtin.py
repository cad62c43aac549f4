# SPDX-License-Identifier: BSD-3-Clause
"""Names of well-known data sets with built-in settings, and their files.

The files are in ``data/settings``, in the format of users' files.
"""

from __future__ import annotations

from pathlib import Path

from orbslam2py.errors import SettingsError
from orbslam2py.settings.keys import nearest
from orbslam2py.settings.sensor import Sensor

_FOLDER = Path(__file__).parent.parent / "data" / "settings"


def _one_file_for_rgbd_and_mono(name: str) -> dict[Sensor, str]:
    """Say that one file serves both: mono ignores keys that only RGB-D needs."""
    return {Sensor.RGBD: f"{name}.yaml", Sensor.MONOCULAR: f"{name}.yaml"}


def _files_for_stereo_and_mono(name: str) -> dict[Sensor, str]:
    return {Sensor.STEREO: f"{name}-stereo.yaml", Sensor.MONOCULAR: f"{name}-mono.yaml"}


_FILES: dict[str, dict[Sensor, str]] = {
    "tum1": _one_file_for_rgbd_and_mono("tum1"),
    "tum2": _one_file_for_rgbd_and_mono("tum2"),
    "tum3": _one_file_for_rgbd_and_mono("tum3"),
    "kitti00-02": _files_for_stereo_and_mono("kitti00-02"),
    "kitti03": _files_for_stereo_and_mono("kitti03"),
    "kitti04-12": _files_for_stereo_and_mono("kitti04-12"),
    "euroc": _files_for_stereo_and_mono("euroc"),
}

BUILTIN_NAMES: tuple[str, ...] = tuple(_FILES)

#: What data they are for.
BUILTIN_DATA: dict[str, str] = {
    "tum1": "TUM RGB-D, camera of freiburg1",
    "tum2": "TUM RGB-D, camera of freiburg2",
    "tum3": "TUM RGB-D, camera of freiburg3",
    "kitti00-02": "KITTI odometry, sequences 00 to 02",
    "kitti03": "KITTI odometry, sequence 03",
    "kitti04-12": "KITTI odometry, sequences 04 to 12",
    "euroc": "EuRoC MAV",
}

#: Single sequences of KITTI and the settings they share.
_KITTI_SEQUENCES = {
    f"kitti{number:02d}": "kitti00-02" if number < 3 else "kitti04-12" for number in range(13)
} | {"kitti03": "kitti03"}


def is_builtin_name(name: str) -> bool:
    """Return whether a name is one of `BUILTIN_NAMES` or of a KITTI sequence, in any case."""
    return name.lower() in _FILES or name.lower() in _KITTI_SEQUENCES


def builtin_sensors(name: str) -> tuple[Sensor, ...]:
    """Return the sensors with settings of a name, its own one first."""
    return tuple(_FILES[_KITTI_SEQUENCES.get(name.lower(), name.lower())])


def builtin_file(name: str, sensor: Sensor) -> Path:
    """Return the settings file of a name.

    Parameters
    ----------
    name
        One of `BUILTIN_NAMES`, or a single KITTI sequence (``kitti00`` ... ``kitti12``), in any
        case.
    sensor
        The variant.

    Raises
    ------
    SettingsError
        If there is no such name, or none for this sensor.
    """
    key = _KITTI_SEQUENCES.get(name.lower(), name.lower())
    if key not in _FILES:
        suggestion = nearest(name, (*BUILTIN_NAMES, *_KITTI_SEQUENCES))
        advice = f"; did you mean {suggestion}?" if suggestion else ""
        names = ", ".join(BUILTIN_NAMES)
        raise SettingsError(f"no built-in settings '{name}'{advice} (there are: {names})")
    files = _FILES[key]
    if sensor not in files:
        available = " and ".join(str(one) for one in files)
        raise SettingsError(
            f"built-in settings '{key}' are for {available}, not for {sensor}; take others, or "
            "another sensor"
        )
    return _FOLDER / files[sensor]
