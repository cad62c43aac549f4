# SPDX-License-Identifier: BSD-3-Clause
"""Settings files of rigs: keys of each camera as of a single one, and how it is mounted.

``Camera1.fx`` to ``Camera8.k4`` describe the cameras with the keys of `Camera.*`, and
``Camera2.T_c1_c2`` maps coordinates of camera 2 into those of camera 1, metres.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from pathlib import Path

from orbslam2py.errors import SettingsError
from orbslam2py.settings.groups import DISTORTION_FIELDS, CameraSettings, DepthSettings
from orbslam2py.settings.opencv_yaml import Document, Problem, read_matrix, read_number, scan
from orbslam2py.settings.reader import groups_of_text, read_text
from orbslam2py.settings.rig import USUAL_CLOSE_FACTOR, RigCamera
from orbslam2py.settings.right_camera import SettingsGroups
from orbslam2py.settings.sensor import Sensor
from orbslam2py.settings.writer import format_settings, lens_lines, matrix_lines

_log = logging.getLogger(__name__)
_OF_CAMERA = re.compile(r"^Camera(?P<number>\d+)\.(?P<key>[\w.]+)\s*:")
_MOUNT = re.compile(r"^Camera\d+\.T_c1_c\d+\s*:")
#: Keys of `Camera.*` that all cameras have in common.
_COMMON = ("fps", "RGB", "bf")
_OWN = re.compile(r"\bCamera\.(?!(?:" + "|".join(_COMMON) + r")\b)")


def is_rig_text(text: str) -> bool:
    """Return whether a settings file contains poses of the cameras of a rig."""
    return any(_MOUNT.match(line) for line in text.splitlines())


def read_rig_groups(
    path: Path,
    sensor: Sensor = Sensor.RIG,
    *,
    allow_unknown: bool,
    warn: Callable[[str], None] = _log.warning,
) -> SettingsGroups:
    """Read a settings file of a rig as `read_groups` reads one of other sensors."""
    text = read_text(path)
    return rig_of_text(text, path, sensor, allow_unknown=allow_unknown, warn=warn)


def rig_of_text(
    text: str,
    path: Path,
    sensor: Sensor = Sensor.RIG,
    *,
    allow_unknown: bool,
    warn: Callable[[str], None] = _log.warning,
) -> SettingsGroups:
    """Read the text of a settings file of a rig; the path is its source.

    Raises
    ------
    SettingsError
        If the file names no cameras of a rig, with all errors of the first wrong camera, or if how
        a camera is mounted is missing.
    """
    document = scan(text)
    lines = text.splitlines()
    numbers = sorted(
        {int(found["number"]) for line in lines if (found := _OF_CAMERA.match(line)) is not None}
    )
    if len(numbers) < 2:
        raise SettingsError(
            f"{path} describes no rig: it needs the cameras as Camera1.*, Camera2.*, ... (fx, fy, "
            "cx, cy, width, height, lens) and Camera2.T_c1_c2 for how camera 2 is mounted. A "
            "camchain of Kalibr becomes such a file with\n"
            "    orbslam2py import-camera camchain.yaml --sensor rig -o my_rig.yaml"
        )
    if numbers != list(range(1, len(numbers) + 1)):
        raise SettingsError(
            f"{path} has the cameras {', '.join(map(str, numbers))}; number them from 1 without "
            "gaps"
        )
    cameras, groups = [], None
    for number in numbers:
        own = _groups_of_camera(lines, number, path, allow_unknown=allow_unknown, warn=warn)
        groups = groups or own
        cameras.append(_camera_of(document, number, own["camera"], path))
    assert groups is not None
    groups["rig"] = tuple(cameras)
    groups["depth"] = _depth_of(document, path)
    return groups


def _groups_of_camera(
    lines: list[str],
    number: int,
    path: Path,
    *,
    allow_unknown: bool,
    warn: Callable[[str], None],
) -> SettingsGroups:
    """Read the file as if it had one of the cameras alone; lines keep their numbers."""
    kept, skipping = [], False
    for line in lines:
        found = _OF_CAMERA.match(line)
        if found is not None:
            own = int(found["number"]) == number
            skipping = not own or found["key"] == "depth" or found["key"].startswith("T_")
        elif line[:1].strip() and not line.startswith("#"):
            skipping = False
        kept.append("" if skipping else re.sub(rf"^Camera{number}\.", "Camera.", line))
    try:
        return groups_of_text(
            "\n".join(kept),
            path,
            Sensor.MONOCULAR,
            allow_unknown=allow_unknown,
            warn=warn if number == 1 else _say_nothing,  # the first one reported common faults
        )
    except SettingsError as error:
        text = _OWN.sub(f"Camera{number}.", str(error))
        raise SettingsError(f"camera {number} of the rig: {text}") from None


def _say_nothing(text: str) -> None:
    """Take a warning that was given before."""


def _camera_of(document: Document, number: int, camera: CameraSettings, path: Path) -> RigCamera:
    depth = False
    name = f"Camera{number}.T_c1_c{number}"
    pose = {}
    line = None
    try:
        if (entry := document.entries.get(f"Camera{number}.depth")) is not None:
            line, value = entry.line, read_number(entry)
            if value not in (0, 1):
                raise SettingsError(f"{entry.key} is {value:g}; give 1 for depth images, else 0")
            depth = value == 1
        wrong = [key for key in document.entries if key.startswith(f"Camera{number}.T_")]
        if number > 1 and name not in wrong:
            line = document.entries[wrong[0]].line if wrong else None
            raise SettingsError(
                f"{name} is missing: 4 x 4 numbers that map coordinates of camera {number} into "
                "those of camera 1, metres" + (f"; {wrong[0]} is no such key" if wrong else "")
            )
        if name in document.entries:
            line = document.entries[name].line
            pose["T_body_camera"] = read_matrix(document.entries[name])
        return RigCamera(camera, depth=depth, **pose)
    except (SettingsError, ValueError) as error:
        text = str(error).replace("T_body_camera", name).replace("Camera1.", f"Camera{number}.")
        raise SettingsError(Problem(line, text).located(path)) from None


def _depth_of(document: Document, path: Path) -> DepthSettings:
    """Read limits and units of depths; units are needed with depth images alone."""
    numbers: dict[str, float] = {}
    for name, key in (("close_factor", "ThDepth"), ("raw_per_metre", "DepthMapFactor")):
        entry = document.entries.get(key)
        if entry is None:
            continue
        try:
            numbers[name] = read_number(entry)
        except ValueError as error:
            raise SettingsError(Problem(entry.line, str(error)).located(path)) from None
    return DepthSettings(**({"close_factor": USUAL_CLOSE_FACTOR} | numbers))


def format_rig(groups: SettingsGroups) -> str:
    """Return a text that reads back as equal settings of a rig."""
    rig, depth = groups["rig"], groups["depth"]
    assert rig is not None
    has_unit = depth is not None and depth.raw_per_metre is not None
    whole = format_settings(Sensor.RGBD if has_unit else Sensor.STEREO, groups)
    lines = [f"%YAML:1.0\n# Settings for a rig of {len(rig)} cameras"]
    lines += [
        line
        for line in whole.splitlines()[2:]
        if not _OWN.match(line) and not line.startswith(("Camera.bf", "# Camera"))
    ]
    for number, camera in enumerate(rig, 1):
        lines += ["", f"# Camera {number}" + ("" if number > 1 else ", the body of the rig")]
        lines += _camera_lines(camera, f"Camera{number}")
        if number > 1:
            lines += matrix_lines(f"Camera{number}.T_c1_c{number}", camera.T_body_camera)
    return "\n".join(lines) + "\n"


def _camera_lines(member: RigCamera, key: str) -> list[str]:
    camera = member.camera
    if camera.is_fisheye:
        lines = lens_lines(camera, key)
    else:
        names = zip(DISTORTION_FIELDS, camera.distortion.tolist(), strict=False)
        lines = [f"{key}.type: PinHole", *(f"{key}.{n}: {value!r}" for n, value in names)]
    lines += [f"{key}.{n}: {getattr(camera, n)!r}" for n in ("fx", "fy", "cx", "cy")]
    lines += [f"{key}.width: {member.size[0]}", f"{key}.height: {member.size[1]}"]
    return lines + ([f"{key}.depth: 1"] if member.depth else [])
