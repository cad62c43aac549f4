# SPDX-License-Identifier: BSD-3-Clause
"""The keys of a settings file, their allowed values, and the sensors that need them.

One table is used by the reader, the checks of the dataclasses and the writer.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from orbslam2py._arguments import float_of, is_number, shown
from orbslam2py._arrays import FloatArray
from orbslam2py.settings.fisheye import FISHEYE_PARAMETERS
from orbslam2py.settings.sensor import WITHOUT_RIG, Sensor

_ALL = frozenset(WITHOUT_RIG)
_DEPTH_SENSORS = frozenset({Sensor.STEREO, Sensor.RGBD})
_RGBD = frozenset({Sensor.RGBD})


@dataclass(frozen=True)
class Rule:
    """The allowed values of a key: a sentence for the user, and a test."""

    text: str
    allows: Callable[[float], bool]


@dataclass(frozen=True)
class Key:
    """One key of a settings file.

    Attributes
    ----------
    name
        As written in the file.
    group, field
        Field of the value in `orbslam2py.settings.Settings`.
    kind
        ``float``, ``int`` or ``bool`` (written 0 or 1).
    rule
        Allowed values.
    sensors
        Sensors that use the key; others ignore it.
    required
        Whether these sensors need it.
    usual
        Usual values, for messages.
    """

    name: str
    group: str
    field: str
    kind: type[float] | type[int] | type[bool]
    rule: Rule
    sensors: frozenset[Sensor] = _ALL
    required: bool = False
    usual: str = ""

    @property
    def allowed(self) -> str:
        """Return the allowed and the usual values, for a message."""
        return f"{self.rule.text} (usual: {self.usual})" if self.usual else self.rule.text


def _above_zero(limit: float, unit: str = "") -> Rule:
    text = f"greater than 0 and at most {limit:g}{unit and ' '}{unit}"
    return Rule(text, lambda value: 0 < value <= limit)


def _between(low: float, high: float, unit: str = "") -> Rule:
    return Rule(f"{low:g} to {high:g}{unit and ' '}{unit}", lambda value: low <= value <= high)


def _key(
    name: str, group: str, field: str, kind: type[float] | type[int], rule: Rule, usual: str
) -> Key:
    """A key that every sensor needs."""
    return Key(name, group, field, kind, rule, required=True, usual=usual)


#: Of a focal length, also of those in matrices.
FOCAL = _above_zero(1e5, "pixels")
_CENTRE = _between(-1e5, 1e5, "pixels")
_COEFFICIENT = _between(-1e4, 1e4)
_SIZE = _between(1, 65535, "pixels")
_WIDTH = _above_zero(1e6)
_PLACE = _between(-1e6, 1e6)
_ORIGINAL = Rule("0 (true places) or 1 (as the original)", lambda value: value in (0, 1))

#: Where keypoints of coarse levels lie. Files from before it was known are of the original's way.
ORIGINAL_COORDINATES = "ORBextractor.originalCoordinates"

KEYS: tuple[Key, ...] = (
    _key("Camera.fx", "camera", "fx", float, FOCAL, "0.5 to 1.5 times the image's width"),
    _key("Camera.fy", "camera", "fy", float, FOCAL, "nearly Camera.fx"),
    _key("Camera.cx", "camera", "cx", float, _CENTRE, "near half the image's width"),
    _key("Camera.cy", "camera", "cy", float, _CENTRE, "near half the image's height"),
    Key("Camera.k1", "camera", "k1", float, _COEFFICIENT),
    Key("Camera.k2", "camera", "k2", float, _COEFFICIENT),
    Key("Camera.p1", "camera", "p1", float, _COEFFICIENT),
    Key("Camera.p2", "camera", "p2", float, _COEFFICIENT),
    Key("Camera.k3", "camera", "k3", float, _COEFFICIENT),
    Key("Camera.k4", "camera", "k4", float, _COEFFICIENT),
    Key("Camera.k5", "camera", "k5", float, _COEFFICIENT),
    Key("Camera.k6", "camera", "k6", float, _COEFFICIENT),
    Key("Camera.width", "camera", "width", int, _SIZE),
    Key("Camera.height", "camera", "height", int, _SIZE),
    Key("Camera.fps", "camera", "fps", float, _above_zero(1e5, "Hz")),
    Key(
        "Camera.bf",
        "camera",
        "bf",
        float,
        # A smaller value is no real distance, and the depth of close points becomes 0.
        _between(1e-6, 1e6, "pixel metres (baseline times fx)"),
        _DEPTH_SENSORS,
        True,
        "40 for rgbd",
    ),
    Key("Camera.RGB", "camera", "rgb", bool, Rule("0 (BGR) or 1 (RGB)", lambda v: v in (0, 1))),
    Key(
        "ThDepth",
        "depth",
        "close_factor",
        float,
        _above_zero(1e6, "baselines"),
        _DEPTH_SENSORS,
        True,
        "35 to 40",
    ),
    Key(
        "DepthMapFactor",
        "depth",
        "raw_per_metre",
        float,
        # A smaller value counts as 1 in the core: "already metres" in the files of ORB-SLAM.
        _between(1e-5, 1e9, "raw units per metre"),
        _RGBD,
        True,
        "1000 for millimetres, 5000 for TUM, 1 for metres",
    ),
    _key(
        "ORBextractor.nFeatures",
        "orb",
        "n_features",
        int,
        _between(1, 1e6),
        "1000, or 2000 for large images",
    ),
    _key(
        "ORBextractor.scaleFactor",
        "orb",
        "scale_factor",
        float,
        Rule("greater than 1 and at most 2", lambda value: 1 < value <= 2),
        "1.2",
    ),
    _key("ORBextractor.nLevels", "orb", "n_levels", int, _between(1, 16), "8"),
    _key("ORBextractor.iniThFAST", "orb", "ini_th_fast", int, _between(1, 254), "20"),
    _key("ORBextractor.minThFAST", "orb", "min_th_fast", int, _between(1, 254), "7"),
    Key(ORIGINAL_COORDINATES, "orb", "original_coordinates", bool, _ORIGINAL),
    Key("Viewer.KeyFrameSize", "viewer", "keyframe_size", float, _WIDTH),
    Key("Viewer.KeyFrameLineWidth", "viewer", "keyframe_line_width", float, _WIDTH),
    Key("Viewer.GraphLineWidth", "viewer", "graph_line_width", float, _WIDTH),
    Key("Viewer.PointSize", "viewer", "point_size", float, _WIDTH),
    Key("Viewer.CameraSize", "viewer", "camera_size", float, _WIDTH),
    Key("Viewer.CameraLineWidth", "viewer", "camera_line_width", float, _WIDTH),
    Key("Viewer.ViewpointX", "viewer", "viewpoint_x", float, _PLACE),
    Key("Viewer.ViewpointY", "viewer", "viewpoint_y", float, _PLACE),
    Key("Viewer.ViewpointZ", "viewer", "viewpoint_z", float, _PLACE),
    Key("Viewer.ViewpointF", "viewer", "viewpoint_f", float, _WIDTH),
)

RECTIFICATION_KEYS: tuple[str, ...] = tuple(
    f"{side}.{name}"
    for side in ("LEFT", "RIGHT")
    for name in ("K", "D", "R", "P", "width", "height")
)
#: Models of the raw cameras of a pair; pinholes if they are missing.
RECTIFICATION_MODEL_KEYS = ("LEFT.model", "RIGHT.model")

#: Of fisheye lenses, which have other numbers than pinholes.
FISHEYE_KEYS = tuple(f"Camera.{name}" for name in FISHEYE_PARAMETERS)

_NAMES = (
    *(key.name for key in KEYS),
    *FISHEYE_KEYS,
    *RECTIFICATION_KEYS,
    *RECTIFICATION_MODEL_KEYS,
)


def is_known(name: str) -> bool:
    """Return whether a key is one of ours."""
    return name in _NAMES


#: Names of a key in other programs, without the signs between words.
_OTHER_NAMES = {
    "baseline": "Camera.bf",
    "depthfactor": "DepthMapFactor",
    "depthscale": "DepthMapFactor",
    "pngdepthscale": "DepthMapFactor",
    "framerate": "Camera.fps",
    "imagewidth": "Camera.width",
    "imageheight": "Camera.height",
    "features": "ORBextractor.nFeatures",
} | {key.name.rpartition(".")[2].lower(): key.name for key in KEYS}


def nearest_key(name: str, *, spelling: bool = True) -> str | None:
    """Find the intended key: ``fx`` is ``Camera.fx``; None if nothing is similar.

    Parameters
    ----------
    name
        The key as written.
    spelling
        Also accept keys with a similar spelling.
    """
    plain = name.rpartition(".")[2].replace("_", "").replace("-", "").lower()
    return _OTHER_NAMES.get(plain) or (nearest(name, _NAMES) if spelling else None)


def nearest(name: str, candidates: Iterable[str]) -> str | None:
    """Find the candidate with the most similar spelling; None if nothing is similar."""
    by_lower = {candidate.lower(): candidate for candidate in sorted(candidates)}
    matches = difflib.get_close_matches(name.lower(), by_lower, n=1, cutoff=0.6)
    return by_lower[matches[0]] if matches else None


def convert(key: Key, value: float) -> float | int | bool:
    """Check a finite number by the rule of its key, and convert it to the key's type.

    Raises
    ------
    ValueError
        The message is a sentence for the user.
    """
    if not math.isfinite(value):
        raise ValueError(f"{key.name} is not finite; allowed: {key.allowed}")
    if key.kind is not float and not float(value).is_integer():
        raise ValueError(f"{key.name} is {value:g}, but must be a whole number: {key.allowed}")
    if not key.rule.allows(value):
        raise ValueError(f"{key.name} is {value:g}; allowed: {key.allowed}")
    return key.kind(value)


#: Fields that may be None: image size and unit of depth are not known of every camera.
_MAY_BE_UNKNOWN = ("width", "height", "raw_per_metre")


def focal_problems(what: str, K: FloatArray) -> list[str]:
    """Return faults of the focal lengths of a camera matrix."""
    lengths = float(K[0, 0]), float(K[1, 1])
    if all(map(FOCAL.allows, lengths)):
        return []
    return [
        f"{what} has the focal lengths {lengths[0]:g}, {lengths[1]:g} (fx, fy); give numbers "
        f"{FOCAL.text}"
    ]


def check_group(group: str, values: object) -> list[str]:
    """Return faults of the values of one settings dataclass.

    Valid values are converted to the type of their key, so that NumPy's numbers become Python's.
    """
    problems = []
    for key in KEYS:
        if key.group != group:
            continue
        value = getattr(values, key.field)
        if value is None and key.field in _MAY_BE_UNKNOWN:
            continue
        number = isinstance(value, bool | np.bool_) if key.kind is bool else is_number(value)
        if not number and not (key.kind is bool and is_number(value)):
            problems.append(f"{key.name} ({key.field}) is {shown(value)}; give {key.allowed}")
            continue
        if key.name == "Camera.bf" and value == 0:
            continue  # a camera without depth
        try:
            object.__setattr__(values, key.field, convert(key, float_of(value)))
        except ValueError as error:
            problems.append(str(error))
    return problems
