# SPDX-License-Identifier: BSD-3-Clause
"""Reads an ORB-SLAM settings file into groups of settings, and reports all problems at once.

The caller makes `Settings` from the groups, so that nothing here depends on it.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from orbslam2py._arguments import cannot_open
from orbslam2py.errors import SettingsError
from orbslam2py.settings import keys as schema
from orbslam2py.settings.foreign import (
    FOREIGN_FORMATS,
    import_line,
    new_line,
    recognise_camera_file,
)
from orbslam2py.settings.groups import (
    CameraRectification,
    CameraSettings,
    DepthSettings,
    OrbSettings,
    StereoRectification,
    ViewerSettings,
    thresholds_swapped,
)
from orbslam2py.settings.lens_model import FileLens, lens_of_file, take_lens
from orbslam2py.settings.opencv_yaml import (
    Document,
    Entry,
    Problem,
    flat,
    read_matrix,
    read_number,
    scan,
)
from orbslam2py.settings.right_camera import SettingsGroups
from orbslam2py.settings.sensor import WITHOUT_RIG, Sensor
from orbslam2py.settings.translation import Translated, is_translated, translate
from orbslam2py.settings.unknown_keys import problem_of_unknown_key, unused_keys

_log = logging.getLogger(__name__)
_MOST_PROBLEMS = 30


#: What text files do not hold: control characters.
_NO_TEXT = re.compile(r"[\x00-\x08\x0e-\x1a\x1c-\x1f]")


def read_text(path: Path) -> str:
    """Read a settings file.

    Raises
    ------
    SettingsError
        If it cannot be read.
    """
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise SettingsError(
            f"{cannot_open(path, error, 'settings file')}; there are built-in ones, too: "
            "orbslam2py settings list"
        ) from error
    if _NO_TEXT.search(text):
        raise SettingsError(
            f"{path} is no text file, so it holds no settings; make a file with orbslam2py "
            "settings new"
        )
    return text


def read_groups(
    path: Path,
    sensor: Sensor,
    *,
    allow_unknown: bool,
    warn: Callable[[str], None] = _log.warning,
) -> SettingsGroups:
    """Read a settings file for a sensor.

    Values that are allowed but probably wrong are not checked here: see `Settings.doubts`.

    Parameters
    ----------
    path
        The file, in OpenCV's YAML dialect.
    sensor
        The sensor: keys that only other sensors use are ignored.
    allow_unknown
        Log unknown keys as warnings instead of refusing the file.
    warn
        Gets the warnings; by default the log.

    Raises
    ------
    SettingsError
        If the file cannot be read, or with a list of all errors: file, line, key, allowed values,
        nearest key.
    """
    return groups_of_text(read_text(path), path, sensor, allow_unknown=allow_unknown, warn=warn)


def groups_of_text(
    text: str,
    path: Path,
    sensor: Sensor,
    *,
    allow_unknown: bool,
    warn: Callable[[str], None] = _log.warning,
) -> SettingsGroups:
    """Read the text of a settings file; the path is its source. See `read_groups`."""
    document = translate(scan(text), sensor)
    given = flat(scan(text))
    if not any(schema.is_known(name) or is_translated(name) for name in given):
        _refuse_camera_file(path, text, sensor)
    lens = lens_of_file(given, path, sensor)
    problems = document.problems
    if not document.entries:
        raise SettingsError(
            f"{path} holds no settings, not a line 'key: value'; make a file with "
            f"{new_line(sensor)}"
        )
    notes = _check_names(document, path, allow_unknown=allow_unknown)
    # The rectified camera of a raw fisheye pair is a pinhole.
    fisheye = {} if document.rectification is not None else take_lens(document, lens)
    values = _read_values(document, sensor)
    missing = sum(" is missing; " in problem.text for problem in problems)
    rectification = _read_rectification(document) if sensor is Sensor.STEREO else None
    advice = []
    # With one key missing it was forgotten; with several the file has another purpose.
    if 1 < missing == len(problems) and (served := _served_by(document)):
        names = " and ".join(map(str, served))
        advice.append(
            f"The file is complete for {names}, not for {sensor}: take it for {served[0]} "
            f"(--sensor {served[0]}), or add what is missing"
        )
    if missing > 1:
        advice.append(f"A complete file is written by\n    {new_line(sensor)}")
    _raise_if_any(path, problems, advice)
    camera = _camera(values["camera"] | fisheye, lens, path)
    if sensor is not Sensor.STEREO and "LEFT.K" in document.entries:
        notes.append(
            f"{path}: LEFT.* and RIGHT.* are for stereo and not used for {sensor}: Camera.* must "
            "describe the images as they come, so for raw images it must have the numbers of "
            "LEFT.K and LEFT.D"
        )
    for note in notes:
        warn(note)

    return SettingsGroups(
        camera=camera,
        orb=OrbSettings(**values["orb"]),
        depth=DepthSettings(**values["depth"]) if sensor.has_depth else None,
        rectification=rectification,
        viewer=ViewerSettings(**values["viewer"]),
        right=document.right,
        rig=None,
    )


def _camera(values: dict[str, Any], lens: FileLens, path: Path) -> CameraSettings:
    try:
        return CameraSettings(**values)
    except SettingsError as error:  # of the lens; the single values are right
        line = None if lens.entry is None else lens.entry.line
        raise SettingsError(Problem(line, str(error)).located(path)) from None


def _served_by(document: Document) -> list[Sensor]:
    """Return the sensors whose required keys exist."""
    required = [key for key in schema.KEYS if key.required]
    return [
        sensor
        for sensor in WITHOUT_RIG
        if all(key.name in document.entries for key in required if sensor in key.sensors)
    ]


def _raise_if_any(path: Path, problems: list[Problem], advice: list[str]) -> None:
    if not problems:
        return
    ordered = sorted(problems, key=lambda problem: (problem.line is None, problem.line or 0))
    lines = [problem.located(path) for problem in ordered[:_MOST_PROBLEMS]]
    if len(ordered) > _MOST_PROBLEMS:
        lines.append(f"... and {len(ordered) - _MOST_PROBLEMS} more")
    if len(ordered) > 1:
        lines.insert(0, f"{len(ordered)} problems in settings file {path}:")
    raise SettingsError("\n".join(lines + advice))


def _refuse_camera_file(path: Path, text: str, sensor: Sensor) -> None:
    """Raise `SettingsError` with the right command, if this is another program's calibration."""
    file_format = recognise_camera_file(text)
    if file_format is not None:
        raise SettingsError(
            f"{path} is {FOREIGN_FORMATS[file_format]}, not a settings file; make one of it with\n"
            f"    {import_line(path, file_format, sensor, text)}"
        )


def _check_names(document: Document, path: Path, *, allow_unknown: bool) -> list[str]:
    """Return the unknown keys that are errors, and warnings about the others."""
    unused, notes = [], []
    for name, entry in document.entries.items():
        if schema.is_known(name):
            continue
        text = problem_of_unknown_key(entry)
        if text is None:
            unused.append(entry)
        elif allow_unknown:
            notes.append(Problem(entry.line, text).located(path))
        else:
            document.problems.append(Problem(entry.line, text))
    note = unused_keys(unused)
    return notes if note is None else [*notes, f"{path}: {note}"]


def _read_values(document: Translated, sensor: Sensor) -> dict[str, dict[str, Any]]:
    """Read the checked values of the scalar keys by group and field."""
    values: dict[str, dict[str, Any]] = {key.group: {} for key in schema.KEYS}
    for key in schema.KEYS:
        if sensor not in key.sensors:
            continue
        entry = document.entries.get(key.name)
        if entry is None:
            if key.required and key.name not in document.unreadable:
                document.problems.append(_missing(key, sensor))
            continue
        try:
            number = _number(key, entry)
            # ORB-SLAM's files may say 0 for "unknown rate".
            if not (key.name == "Camera.fps" and number == 0):
                named = replace(key, name=entry.key)
                values[key.group][key.field] = schema.convert(named, number)
        except ValueError as error:
            document.problems.append(Problem(entry.line, str(error)))
    orb = values["orb"]
    if orb.get("min_th_fast", 0) > orb.get("ini_th_fast", 255):
        line = document.entries["ORBextractor.minThFAST"].line
        text = thresholds_swapped(orb["min_th_fast"], orb["ini_th_fast"])
        document.problems.append(Problem(line, text))
    return values


def _missing(key: schema.Key, sensor: Sensor) -> Problem:
    return Problem(None, f"{key.name} is missing; {sensor} needs it: {key.allowed}")


def _number(key: schema.Key, entry: Entry) -> float:
    try:
        return read_number(entry)
    except ValueError as error:
        raise ValueError(f"{error}; allowed: {key.allowed}") from None


def _read_rectification(document: Translated) -> StereoRectification | None:
    if document.rectification is not None:
        return document.rectification
    present = [name for name in schema.RECTIFICATION_KEYS if name in document.entries]
    if not present:
        return None
    missing = [name for name in schema.RECTIFICATION_KEYS if name not in document.entries]
    if missing:
        text = f"calibration parameters to rectify stereo are missing: {', '.join(missing)}"
        document.problems.append(Problem(document.entries[present[0]].line, text))
        return None
    cameras = [_read_camera_rectification(document, side) for side in ("LEFT", "RIGHT")]
    left, right = cameras
    return StereoRectification(left, right) if left and right else None


def _read_camera_rectification(document: Document, side: str) -> CameraRectification | None:
    values: dict[str, Any] = {}
    first_line = document.entries[f"{side}.K"].line
    for name in ("K", "D", "R", "P", "width", "height"):
        entry = document.entries[f"{side}.{name}"]
        try:
            if name in ("width", "height"):
                number = read_number(entry)
                if not number.is_integer() or not 1 <= number <= 65535:
                    raise ValueError(
                        f"{entry.key} is {number:g}; allowed: whole numbers 1 to 65535"
                    )
                values[name] = int(number)
            else:
                values[name] = read_matrix(entry)
        except ValueError as error:
            document.problems.append(Problem(entry.line, str(error)))
    if len(values) < 6:
        return None
    model = document.entries.get(f"{side}.model")
    if model is not None:
        values["model"] = str(model.value).lower()
    try:
        return CameraRectification(**values)
    except SettingsError as error:
        document.problems.append(Problem(first_line, f"{side}: {error}"))
        return None
