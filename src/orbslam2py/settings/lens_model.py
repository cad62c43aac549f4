# SPDX-License-Identifier: BSD-3-Clause
"""The lens of a settings file, and the parameters of a fisheye lens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import (
    FISHEYE_PARAMETERS,
    LENS_PARAMETERS,
    PINHOLE,
    TYPES,
    fisheye_model,
    needs_right_camera,
)
from orbslam2py.settings.foreign import new_line
from orbslam2py.settings.opencv_yaml import Document, Entry, Problem, parse_number, read_number
from orbslam2py.settings.sensor import Sensor

#: Keys that name the model of the lens, and a flag of a fisheye.
RECTIFIER_MODEL = "StereoRectifier.model"
_MODEL_KEYS = ("Camera.type", "Camera1.type", "Camera.model")
_FISHEYE_FLAG = "Camera.bFishEye"
LENS_KEYS = (*_MODEL_KEYS, "Camera2.type", RECTIFIER_MODEL, _FISHEYE_FLAG)

_PINHOLES = ("pinhole", "rectified", "perspective")
_OTHER_LENSES = {
    "equirectangular": "images of all directions (equirectangular)",
    "radial_division": "a lens with the division model of distortion",
}
#: Distortion of a pinhole, in the order of the fields of `CameraSettings`.
_COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")


@dataclass(frozen=True)
class FileLens:
    """The lens that a settings file names.

    Attributes
    ----------
    model
        "pinhole", or a fisheye model of `orbslam2py.settings.fisheye.LENS_PARAMETERS`.
    entry
        The entry with its name; None if there is none.
    """

    model: str
    entry: Entry | None = None

    @property
    def named(self) -> str:
        """Return the name in the file."""
        return "" if self.entry is None else f"{self.entry.key} {self.entry.value}"


def lens_of_file(entries: Mapping[str, Entry], path: Path, sensor: Sensor) -> FileLens:
    """Find the lens of a settings file.

    Parameters
    ----------
    entries
        The entries of the file, nested ones by their path.
    path, sensor
        The settings file's path, and the sensor.

    Raises
    ------
    SettingsError
        If the model is unknown or not supported, the file contradicts itself, or it has
        coefficients of a fisheye lens without naming one; the message gives the remedy.
    """
    keys: tuple[str, ...] = _MODEL_KEYS
    if sensor is not Sensor.STEREO and RECTIFIER_MODEL in entries:  # the raw left camera is taken
        keys = (RECTIFIER_MODEL,)
    elif sensor is Sensor.STEREO:
        for key in ("Camera2.type", RECTIFIER_MODEL):  # of the raw cameras
            if key in entries:
                _lens_of_entry(entries[key], path, sensor)
    found = [_lens_of_entry(entries[key], path, sensor) for key in keys if key in entries]
    flag = entries.get(_FISHEYE_FLAG)
    if flag is not None and _value(flag) != 0:
        found.append(FileLens("kannala_brandt", flag))
    lens = found[0] if found else FileLens(PINHOLE)
    has_right = "Camera2.fx" in entries
    if sensor is Sensor.STEREO and lens.model != PINHOLE and not has_right:
        _refuse(lens.entry, f"{lens.named}: {needs_right_camera()}", path)
    for other in found[1:]:
        if other.model != lens.model:
            text = f"{other.named} contradicts {lens.named}; keep the one that is right"
            _refuse(other.entry, text, path)
    if lens.model == PINHOLE:
        _refuse_unnamed_fisheye(entries, lens, path)
    return lens


def models_of_pair(entries: Mapping[str, Entry]) -> tuple[str, str]:
    """Name the models of both cameras of a raw pair; without ``Camera2.type`` they have one."""
    named = [entries[key] for key in _MODEL_KEYS if key in entries]
    flag = entries.get(_FISHEYE_FLAG)
    if not named and flag is not None and _value(flag) != 0:
        return "kannala_brandt", "kannala_brandt"
    first = _model_of(named[0]) if named else PINHOLE
    second = entries.get("Camera2.type")
    return first, first if second is None else _model_of(second)


def _model_of(entry: Entry) -> str:
    return fisheye_model(entry.value) or PINHOLE


def _lens_of_entry(entry: Entry, path: Path, sensor: Sensor) -> FileLens:
    name = str(entry.value)
    if name.lower() in _PINHOLES:
        return FileLens(PINHOLE, entry)
    model = fisheye_model(name)
    if model is not None:
        return FileLens(model, entry)
    what = _OTHER_LENSES.get(name.lower(), f"a lens of the model {name}")
    text = (
        f"{entry.key} is {name}: the file is for {what}, which is not supported; allowed: PinHole, "
        f"Rectified, perspective, {', '.join(TYPES.values())}. Make pinhole images of them first "
        f"(undistorted, or cut out), and settings of these:\n    {new_line(sensor)}"
    )
    raise SettingsError(Problem(entry.line, text).located(path))


def _refuse(entry: Entry | None, text: str, path: Path) -> None:
    raise SettingsError(Problem(None if entry is None else entry.line, text).located(path))


def _refuse_unnamed_fisheye(entries: Mapping[str, Entry], lens: FileLens, path: Path) -> None:
    """Refuse coefficients of a fisheye lens in the file of a pinhole."""
    named = f"write {TYPES['kannala_brandt']} in place of {lens.entry.value}" if lens.entry else ""
    second = entries.get("Camera2.type")
    is_fisheye = second is not None and _model_of(second) != PINHOLE
    for camera in ("Camera", "Camera1", *(() if is_fisheye else ("Camera2",))):
        if _has_four_radial(entries, camera):
            key = f"{camera}.k4"
            _refuse(
                entries[key],
                f"{key} without k5 and k6 belongs to a fisheye calibration (Kannala-Brandt, k1 to "
                f"k4). If it is one, {named or 'add the line Camera.type: KannalaBrandt8'}; if it "
                "is a rational distortion, add k5 and k6 (0 if there are none)",
                path,
            )
        for name in FISHEYE_PARAMETERS:
            entry = entries.get(f"{camera}.{name}")
            if entry is None:
                continue
            models = [TYPES[m] for m, names in LENS_PARAMETERS.items() if name in names]
            has = f"{lens.named} has no such parameter" if lens.entry else "Camera.type is missing"
            text = f"{entry.key} belongs to a fisheye lens, and {has}; give Camera.type: "
            _refuse(entry, f"{text}{' or '.join(models)}", path)


def _has_four_radial(entries: Mapping[str, Entry], camera: str) -> bool:
    """Return whether the fourth coefficient does not belong to the six of the rational model."""
    k4 = entries.get(f"{camera}.k4")
    if k4 is None or any(f"{camera}.{name}" in entries for name in ("k5", "k6")):
        return False
    tangential = any(f"{camera}.{name}" in entries for name in ("p1", "p2"))
    return _value(k4) != 0 or not tangential


def take_lens(document: Document, lens: FileLens) -> dict[str, Any]:
    """Read the parameters of a fisheye lens from the entries of a file.

    Parameters
    ----------
    document
        The entries by our names; those of the lens are removed. Takes the problems.
    lens
        As `lens_of_file` finds it.

    Returns
    -------
    dict
        The fields ``model`` and ``lens`` of `CameraSettings`; empty for a pinhole, and if there is
        an error.
    """
    if lens.model == PINHOLE:
        return {}
    names, line = LENS_PARAMETERS[lens.model], lens.entry.line if lens.entry else None
    listed = ", ".join(f"Camera.{name}" for name in names)
    given = {
        name: document.entries.pop(f"Camera.{name}")
        for name in (*_COEFFICIENTS, *FISHEYE_PARAMETERS)
        if f"Camera.{name}" in document.entries
    }
    n_before = len(document.problems)
    for name, entry in given.items():
        if name not in names and _value(entry) != 0:
            text = (
                f"{entry.key} is {entry.value}, and the lens of {lens.named} has {listed} alone; "
                "name the model to which all coefficients belong"
            )
            document.problems.append(Problem(entry.line, text))
    lacking = [f"Camera.{name}" for name in names if name not in given]
    if lacking:
        text = f"{lens.named} needs {listed}; add {', '.join(lacking)}"
        document.problems.append(Problem(line, text))
    numbers = []
    for name in names:
        try:
            numbers += [read_number(given[name])] if name in given else []
        except ValueError as error:
            document.problems.append(Problem(given[name].line, f"{error}; give a finite number"))
    if len(document.problems) > n_before:
        return {}
    return {"model": lens.model, "lens": tuple(numbers)}


def _value(entry: Entry) -> float:
    """Return the number of an entry; NaN, which is not 0, if it has none."""
    try:
        return parse_number(entry.value) if isinstance(entry.value, str) else float("nan")
    except ValueError:
        return float("nan")
