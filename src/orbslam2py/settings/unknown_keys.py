# SPDX-License-Identifier: BSD-3-Clause
"""Unknown keys of a settings file: which are errors, and suggestions.

The rule uses families of names. A key that describes the camera is used or refused, because an
ignored number would give a wrong map without a message. A key that is similar to one of ours is
refused, with the right name. All others belong to other programs; one warning names them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from difflib import SequenceMatcher

from orbslam2py.settings.imu_files import IMU_KEYS
from orbslam2py.settings.keys import FISHEYE_KEYS, KEYS, RECTIFICATION_KEYS, nearest_key
from orbslam2py.settings.opencv_yaml import Entry, parse_number

#: Groups of keys that describe a camera or how two of them stand.
_CAMERA_GROUP = re.compile(r"(camera|cam)\d*|left|right|stereo|rgbd|stereorectifier", re.IGNORECASE)
_ONE_OF_SEVERAL = re.compile(r".*\d|left|right", re.IGNORECASE)
#: Names in groups of their own that describe one all the same.
_CAMERA_WORD = re.compile(
    r"[fc][xy]|k\d|p\d|bf|baseline|(?-i:[KDRP])|T_?c\d\w*|Tlr|T_?(lr|rl|cn_cnm1|left_right|right_left)"
    r"|cameras?\d*|(camera_?)?(intrinsics|matrix)|dist(ortion)?(_?(coeffs?|coefficients|model))?",
    re.IGNORECASE,
)
#: Groups of keys that never concern a camera.
_OTHER_GROUPS = ("imu", "system", "file")
#: Keys of a camera that do not describe its images.
_OF_NO_EFFECT = re.compile(r"name|setup|(over)?lapping(begin|end)", re.IGNORECASE)

_OURS = (*(key.name for key in KEYS), *FISHEYE_KEYS, *RECTIFICATION_KEYS)
_OUR_GROUPS = {name.rpartition(".")[0].lower() for name in _OURS}
#: From here on two names, or two of a camera, are spelt alike.
_ALIKE, _ALIKE_OF_CAMERA = 0.8, 0.6
_MOST_NAMED = 6


def problem_of_unknown_key(entry: Entry) -> str | None:
    """Return the fault of an unknown key; None if the file may have it."""
    group, _, last = entry.key.rpartition(".")
    if group.partition(".")[0].lower() in _OTHER_GROUPS:
        return None
    of_camera = bool(_CAMERA_GROUP.fullmatch(group.partition(".")[0])) or bool(
        _CAMERA_WORD.fullmatch(last)
    )
    if of_camera and _OF_NO_EFFECT.fullmatch(last):
        return None
    meant = _meant(entry.key, of_camera=of_camera)
    if meant is not None:
        return f"unknown key {entry.key}; {_advice(meant, entry)}"
    if of_camera:
        return (
            f"unknown key {entry.key}, which by its name describes the camera, so it is not "
            "ignored; express it by a key of orbslam2py ('orbslam2py settings show tum1' "
            "prints a complete file), or, if it changes nothing about the images, begin the line "
            "with #"
        )
    return None


def unused_keys(entries: Iterable[Entry]) -> str | None:
    """Return warnings about ignored keys, one for each group; None if no warning is needed."""
    names: dict[str, None] = {}
    for entry in entries:
        group, dot, last = entry.key.rpartition(".")
        if entry.key in IMU_KEYS:
            continue  # read_imu_settings takes them
        if group.lower() != "file" and not _OF_NO_EFFECT.fullmatch(last):
            of_ours = group.lower() in (*_OUR_GROUPS, "imu")
            names[entry.key if of_ours or not dot else f"{group}.*"] = None
    if not names:
        return None
    listed = list(names)
    more = len(listed) - _MOST_NAMED
    rest = f" and {more} more" if more > 0 else ""
    return (
        "not used, as these keys of other programs do not describe the camera: "
        f"{', '.join(listed[:_MOST_NAMED])}{rest}"
    )


def _meant(name: str, *, of_camera: bool) -> str | None:
    group, _, last = name.rpartition(".")
    if _ONE_OF_SEVERAL.fullmatch(group):
        return None  # our name would be that of the first camera
    if _plain(last) == "baseline":
        return "Stereo.b"
    of_ours = group.lower() in _OUR_GROUPS  # also without a group
    known = nearest_key(last, spelling=False) if of_ours or of_camera else None
    if known is not None and (of_camera or not group or _group(known) == group.lower()):
        return known
    if of_camera and _CAMERA_GROUP.fullmatch(group):
        return _most_alike(last, _in_group("camera"), _ALIKE_OF_CAMERA)
    if group and of_ours:
        return _most_alike(last, _in_group(group.lower()), _ALIKE)
    groups = {group: group for group in _OUR_GROUPS}
    nearest_group = _most_alike(group, groups, _ALIKE)
    return None if nearest_group is None else _most_alike(last, _in_group(nearest_group), _ALIKE)


def _in_group(group: str) -> dict[str, str]:
    return {name.rpartition(".")[2].lower(): name for name in _OURS if _group(name) == group}


def _most_alike(name: str, candidates: dict[str, str], least: float) -> str | None:
    ratios = {
        ours: SequenceMatcher(None, name.lower(), candidate).ratio()
        for candidate, ours in candidates.items()
    }
    best = max(ratios, key=ratios.__getitem__)
    return best if ratios[best] >= least else None


def _group(name: str) -> str:
    return name.rpartition(".")[0].lower()


def _plain(word: str) -> str:
    return word.replace("_", "").replace("-", "").lower()


def _advice(meant: str, entry: Entry) -> str:
    """Return the right key, and its value if that has another unit."""
    if meant == "Stereo.b":
        return f"did you mean {meant} (the baseline in metres)?"
    if meant == "DepthMapFactor" and isinstance(entry.value, str):
        try:
            scale = parse_number(entry.value)
        except ValueError:
            scale = 1.0
        if 0 < scale < 1:  # metres per unit
            return f"did you mean {meant}: {1 / scale:g} (units per metre)?"
    return f"did you mean {meant}?"
