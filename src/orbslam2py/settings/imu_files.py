# SPDX-License-Identifier: BSD-3-Clause
"""IMU settings in files: ORB-SLAM3, Kalibr, EuRoC's ``sensor.yaml``, Basalt.

Some formats divide them among two files (Kalibr's ``imu.yaml`` and camchain, EuRoC's
``sensor.yaml`` of the IMU and of the camera): the statements of all given files are put together.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from orbslam2py._arguments import cannot_open
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.imu import ImuSettings, rigid_transform
from orbslam2py.settings.imu_presets import ImuNoise
from orbslam2py.settings.opencv_yaml import Entry, flat, parse_number, read_matrix, scan

_log = logging.getLogger(__name__)

_NOISE = ("gyro_noise", "accel_noise", "gyro_walk", "accel_walk")


@dataclass(frozen=True)
class _Stated:
    """A value with the file and the key that state it."""

    value: Any
    where: str


#: By the fields of `ImuSettings`; ``T_bi`` and ``T_bc`` are the places of IMU and camera on a body.
_Statements = dict[str, _Stated]


def read_imu_settings(*paths: str | PathLike[str], noise: ImuNoise | None = None) -> ImuSettings:
    """Read the settings of an IMU, and log their `ImuSettings.doubts` as warnings.

    Parameters
    ----------
    *paths
        One file or several that complete each other: settings of ORB-SLAM3 (``IMU.NoiseGyro``,
        ``IMU.T_b_c1`` or ``Tbc``, ...), Kalibr's ``imu.yaml`` and camchain (``T_cam_imu``,
        ``timeshift_cam_imu``), EuRoC's ``sensor.yaml`` of IMU and camera (``T_BS``), Basalt's
        JSON, or a folder of EuRoC.
    noise
        Used where the files state none, such as `imu_noise` gives it.

    Raises
    ------
    SettingsError
        Naming the file, the key and the remedy.
    """
    statements: _Statements = {}
    for path in _files_of(paths):
        for name, stated in _statements_of(path).items():
            before = statements.get(name)
            if before is not None and not np.allclose(before.value, stated.value, atol=1e-9):
                raise SettingsError(
                    f"{before.where} and {stated.where} differ; give only one of them"
                )
            statements[name] = stated
    settings = _settings_of(statements, noise, ", ".join(map(str, paths)))
    for doubt in settings.doubts():
        name = doubt.partition(" ")[0]
        stated_by = statements.get(name) or (statements.get("T_bc") if name == "T_ci" else None)
        _log.warning("%s", f"{stated_by.where}: {doubt}" if stated_by else doubt)
    return settings


def has_imu_keys(path: Path) -> bool:
    """Whether a settings file contains keys of an IMU."""
    try:
        return bool(_statements_of(path))
    except SettingsError:
        return False


def imu_of_settings_file(path: Path, noise: ImuNoise | None = None) -> ImuSettings | None:
    """Read the keys of an IMU in a settings file of a camera.

    Parameters
    ----------
    path
        The file.
    noise
        Used where the file states none.

    Returns
    -------
    ImuSettings or None
        None if there is no such file or it says nothing. Missing or wrong values are logged as a
        warning, because the camera can be used without them.
    """
    if not path.is_file() or not has_imu_keys(path):
        return None
    try:
        return read_imu_settings(path, noise=noise)
    except SettingsError as error:
        _log.warning("the IMU is not used: %s", error)
        return None


def _files_of(paths: tuple[str | PathLike[str], ...]) -> list[Path]:
    files: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir():
            files.append(path)
            continue
        root = path / "mav0" if (path / "mav0").is_dir() else path
        sensors = [root / name / "sensor.yaml" for name in ("imu0", "cam0")]
        missing = [sensor for sensor in sensors if not sensor.is_file()]
        if missing:
            raise SettingsError(
                f"{missing[0]} is missing; a folder must hold imu0/sensor.yaml and "
                "cam0/sensor.yaml as those of EuRoC do: add it, or give the files"
            )
        files += sensors
    return files


def _settings_of(statements: _Statements, noise: ImuNoise | None, source: str) -> ImuSettings:
    values = {name: stated.value for name, stated in statements.items()}
    missing = [name for name in _NOISE if name not in values]
    if missing and noise is not None:
        values.update({name: getattr(noise, name) for name in missing})
    elif missing:
        raise SettingsError(
            f"{source}: {', '.join(missing)} of the IMU is missing; add the file that has it "
            "(Kalibr's imu.yaml, EuRoC's imu0/sensor.yaml), or take that of a chip with "
            "--imu-noise"
        )
    if "T_ci" not in values:
        if "T_bc" not in values:
            raise SettingsError(
                f"{source}: no key gives the pose of the IMU relative to the camera; add "
                "IMU.T_b_c1 (ORB-SLAM3), or the file that has T_cam_imu (Kalibr's camchain) or "
                "the camera's T_BS (EuRoC's cam0/sensor.yaml)"
            )
        values["T_ci"] = np.linalg.inv(values["T_bc"]) @ values.get("T_bi", np.eye(4))
    fields = (*_NOISE, "T_ci", "time_offset", "rate")
    try:
        return ImuSettings(**{name: values[name] for name in fields if name in values})
    except SettingsError as error:
        raise SettingsError(f"{source}: {error}") from None


def _statements_of(path: Path) -> _Statements:
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise SettingsError(cannot_open(path, error, "IMU settings")) from error
    if text.lstrip().startswith("{"):
        return _of_basalt(path, text)
    entries = flat(scan(text))
    if any(name.startswith("IMU.") or name == "Tbc" for name in entries):
        return _of_entries(path, entries, _ORB_SLAM3)
    if "T_BS" in entries and "sensor_type" in entries:
        place = "T_bi" if entries["sensor_type"].value == "imu" else "T_bc"
        rate = {"rate_hz": ("rate", _number)} if place == "T_bi" else {}
        return _of_entries(path, entries, {**_EUROC, **rate, "T_BS": (place, _matrix)})
    return _of_kalibr(path, text)


# ---- OpenCV's YAML -------------------------------------------------------------------------------


def _number(entry: Entry) -> float:
    items = (entry.value,) if isinstance(entry.value, str) else entry.value
    if not isinstance(items, tuple) or len(items) != 1:
        raise ValueError("must hold one number")
    return parse_number(items[0])


def _matrix(entry: Entry) -> FloatArray:
    return rigid_transform(read_matrix(entry))


_Keys = Mapping[str, tuple[str, Callable[[Entry], Any]]]

_ORB_SLAM3: _Keys = {
    "IMU.NoiseGyro": ("gyro_noise", _number),
    "IMU.NoiseAcc": ("accel_noise", _number),
    "IMU.GyroWalk": ("gyro_walk", _number),
    "IMU.AccWalk": ("accel_walk", _number),
    "IMU.Frequency": ("rate", _number),
    "IMU.TimeOffset": ("time_offset", _number),
    "IMU.T_b_c1": ("T_bc", _matrix),
    "Tbc": ("T_bc", _matrix),
}
#: Keys of a settings file that describe the IMU.
IMU_KEYS = frozenset(_ORB_SLAM3)
_EUROC: _Keys = {
    "gyroscope_noise_density": ("gyro_noise", _number),
    "gyroscope_random_walk": ("gyro_walk", _number),
    "accelerometer_noise_density": ("accel_noise", _number),
    "accelerometer_random_walk": ("accel_walk", _number),
}


def _of_entries(path: Path, entries: Mapping[str, Entry], keys: _Keys) -> _Statements:
    statements: _Statements = {}
    for key, (name, read) in keys.items():
        entry = entries.get(key)
        if entry is None:
            continue
        where = f"{path}:{entry.line}: {key}"
        try:
            statements[name] = _Stated(read(entry), where)
        except ValueError as error:
            text = str(error).removeprefix(f"{key} ").removeprefix(f"{key}: ")
            raise SettingsError(f"{where} {text}") from None
    return statements


# ---- Kalibr and Basalt ---------------------------------------------------------------------------

_KALIBR = {
    "gyroscope_noise_density": "gyro_noise",
    "gyroscope_random_walk": "gyro_walk",
    "accelerometer_noise_density": "accel_noise",
    "accelerometer_random_walk": "accel_walk",
    "update_rate": "rate",
    "timeshift_cam_imu": "time_offset",
    "T_cam_imu": "T_ci",
}


def _of_kalibr(path: Path, text: str) -> _Statements:
    """Read ``imu.yaml``, alone or below ``imu0``, and ``cam0`` of a camchain."""
    try:
        document = yaml.safe_load(text)
    except yaml.YAMLError:
        document = None
    if not isinstance(document, Mapping):
        document = {}
    statements: _Statements = {}
    for block in ("", "imu0", "cam0"):
        values = document if not block else document.get(block)
        for key, name in _KALIBR.items() if isinstance(values, Mapping) else ():
            if key in values:
                where = f"{path}: {block}{block and '.'}{key}"
                statements[name] = _Stated(_plain(where, values[key], name), where)
    if not statements:
        raise SettingsError(
            f"{path} contains nothing about an IMU; give settings of ORB-SLAM3 with IMU.*, "
            "Kalibr's imu.yaml and camchain with T_cam_imu, EuRoC's sensor.yaml or Basalt's "
            "calibration"
        )
    return statements


def _plain(where: str, value: object, name: str) -> Any:
    try:
        return rigid_transform(value) if name == "T_ci" else float(str(value))
    except ValueError as error:
        text = str(error) if name == "T_ci" else f"is {value!r}; give a number"
        raise SettingsError(f"{where} {text}") from None


def _of_basalt(path: Path, text: str) -> _Statements:
    """Read ``value0`` of Basalt's calibration: densities per axis, of which the largest counts."""
    try:
        values = json.loads(text)["value0"]
        place = values["T_imu_cam"][0]
        x, y, z, w = (float(place[key]) for key in ("qx", "qy", "qz", "qw"))
        T = np.eye(4)
        T[:3, :3] = _rotation_of(x, y, z, w)
        T[:3, 3] = [float(place[key]) for key in ("px", "py", "pz")]
        numbers = {
            "gyro_noise": max(map(float, values["gyro_noise_std"])),
            "accel_noise": max(map(float, values["accel_noise_std"])),
            "gyro_walk": max(map(float, values["gyro_bias_std"])),
            "accel_walk": max(map(float, values["accel_bias_std"])),
            "rate": float(values["imu_update_rate"]),
            "time_offset": float(values.get("cam_time_offset_ns", 0)) * 1e-9,
            "T_bc": rigid_transform(T),
        }
    except (ValueError, KeyError, TypeError, IndexError) as error:
        raise SettingsError(
            f"{path} is no calibration of Basalt with an IMU ({type(error).__name__}: {error}); it "
            "needs value0 with T_imu_cam, gyro_noise_std, accel_noise_std, gyro_bias_std, "
            "accel_bias_std and imu_update_rate"
        ) from None
    return {name: _Stated(value, f"{path}: value0") for name, value in numbers.items()}


def _rotation_of(x: float, y: float, z: float, w: float) -> FloatArray:
    norm = np.sqrt(x * x + y * y + z * z + w * w)
    if abs(norm - 1) > 1e-2:
        raise ValueError(f"T_imu_cam has a quaternion of length {norm:.3g}; give one of length 1")
    v = np.array([x, y, z]) / norm
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + 2 * (w / norm) * cross + 2 * cross @ cross)
