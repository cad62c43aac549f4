# SPDX-License-Identifier: BSD-3-Clause
"""Message about a file that no format recognises: what was found in it, and what to do."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, NoReturn

from orbslam2py.calibration.camera_model import pinhole_matrix
from orbslam2py.calibration.foreign_cameras import CalibrationSource
from orbslam2py.calibration.lenses import lens_of, require_supported
from orbslam2py.errors import SettingsError
from orbslam2py.settings import Sensor
from orbslam2py.settings.foreign import FORMATS, filled_line, new_line

_SETTINGS_KEY = re.compile(r"^Camera1?\.(?:fx|type)\s*:", re.MULTILINE)
_CAMERA_TYPE = re.compile(r"^Camera\.type\s*:\s*\"?(\w+)", re.MULTILINE)
#: Words of lenses for which the numbers of a pinhole camera are wrong.
_OTHER_LENS = re.compile(
    r"fish.?eye|equi|kannala|\bkb[48]?\b|double.?sphere|eucm|omni|\bmei\b|ucm|\bxi\b|alpha|poly"
    r"|spherical|panor|theta|\bfov\b",
    re.IGNORECASE,
)
_DEPTH = 6


def refuse_unknown(source: CalibrationSource) -> NoReturn:
    """Raise `SettingsError` for a file of no known format.

    Parameters
    ----------
    source
        The file.
    """
    path, text = source.path, source.text
    if _SETTINGS_KEY.search(text):
        match = _CAMERA_TYPE.search(text)
        if match and match[1].lower() not in ("pinhole", "rectified"):
            lens = lens_of(str(path), "Camera.type", match[1])
            what = f"{path} is a settings file of ORB-SLAM3: its camera"
            require_supported(what, lens)
        raise SettingsError(
            f"{path} is a settings file already, not another program's calibration; give it with "
            f"--settings, and look at it with orbslam2py settings check {path}"
        )
    if text.lstrip().startswith("{") and not source.json:
        raise SettingsError(f"{path} is no readable JSON: {_json_problem(text)}; write it again")
    names = ", ".join(one.name for one in FORMATS)
    if not text.strip():
        raise SettingsError(f"{path} is no camera file we know: it is empty; give a calibration")
    values = _values(source)
    for place, lens in _lenses(values):
        require_supported(f"{path} is no camera file we know, and {place}", lens)
    found = [] if _OTHER_LENS.search(text) else list(_numbers(values))
    if len(found) == 1:
        place, camera = found[0]
        K = pinhole_matrix(path, place, [camera[key] for key in ("fx", "fy", "cx", "cy")])
        raise SettingsError(
            f"{path} is no camera file we know, but {place or 'it'} holds fx, fy, cx, cy; if they "
            "are pixels of a pinhole camera without distortion, make settings of them:\n"
            f"    {filled_line(K, None, Sensor.MONOCULAR)}"
        )
    raise SettingsError(
        f"{path} is no camera file we know ({names}). Name the format with --format if it is one "
        f"of them, or make settings of the camera's numbers:\n    {new_line(Sensor.MONOCULAR)}"
    )


def _json_problem(text: str) -> str:
    try:
        json.loads(text)
    except json.JSONDecodeError as error:
        return f"line {error.lineno}: {error.msg}"
    except (ValueError, RecursionError):
        return "it is nested too deeply"
    return "it holds no named values"


def _values(source: CalibrationSource) -> Mapping[str, Any]:
    try:
        return source.values
    except SettingsError:
        return {}


def _numbers(
    values: Mapping[str, Any], place: str = "", depth: int = _DEPTH
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Find where fx, fy, cx, cy stand."""
    if all(isinstance(values.get(key), int | float) for key in ("fx", "fy", "cx", "cy")):
        yield place, values
        return
    for key, value in values.items():
        if isinstance(value, Mapping) and depth:
            yield from _numbers(value, f"{place}.{key}" if place else str(key), depth - 1)


def _lenses(
    values: Mapping[str, Any], place: str = "", depth: int = _DEPTH
) -> Iterator[tuple[str, str]]:
    """Find the names of lenses that are known, and where they stand."""
    for key, value in values.items():
        inside = f"{place}.{key}" if place else str(key)
        if isinstance(value, Mapping) and depth:
            yield from _lenses(value, inside, depth - 1)
        elif str(key).lower().endswith(("model", "type")) and isinstance(value, str):
            try:
                yield f"its camera ({inside}: {value})", lens_of("", "", value)
            except SettingsError:
                continue
