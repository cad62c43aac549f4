# SPDX-License-Identifier: BSD-3-Clause
"""The keys of ORB-SLAM3 (0.x and 1.0) and stella_vslam, translated to our keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from orbslam2py.settings.fisheye import FISHEYE_PARAMETERS, PINHOLE, fisheye_model
from orbslam2py.settings.groups import StereoRectification, usual_n_features
from orbslam2py.settings.lens_model import LENS_KEYS, RECTIFIER_MODEL, models_of_pair
from orbslam2py.settings.opencv_yaml import Document, Entry, Problem, flat, parse_number
from orbslam2py.settings.raw_pairs import (
    LENS_NUMBERS,
    OLD_POSE,
    RECTIFIER_KEYS,
    RELATIVE_POSE,
    RawPair,
    rectified_pair,
    stella_pair,
    stella_raw_camera,
)
from orbslam2py.settings.right_camera import RightCamera
from orbslam2py.settings.sensor import Sensor

#: Other names of our keys, with values of the same meaning and unit.
_RENAMED = {
    f"Camera1.{name}": f"Camera.{name}" for name in (*LENS_NUMBERS, *FISHEYE_PARAMETERS)
} | {
    # ORB-SLAM3 1.0
    "Stereo.ThDepth": "ThDepth",
    "RGBD.DepthMapFactor": "DepthMapFactor",
    # stella_vslam, OpenVSLAM
    "Camera.cols": "Camera.width",
    "Camera.rows": "Camera.height",
    "Camera.focal_x_baseline": "Camera.bf",
    "Camera.depth_threshold": "ThDepth",
    "depth_threshold": "ThDepth",
    "Camera.depthmap_factor": "DepthMapFactor",
    "Preprocessing.depthmap_factor": "DepthMapFactor",
    "depthmap_factor": "DepthMapFactor",
    "Feature.max_num_keypoints": "ORBextractor.nFeatures",
    "Feature.scale_factor": "ORBextractor.scaleFactor",
    "Feature.num_levels": "ORBextractor.nLevels",
    "Feature.ini_fast_threshold": "ORBextractor.iniThFAST",
    "Feature.min_fast_threshold": "ORBextractor.minThFAST",
}
_BASELINE = "Stereo.b"
_COLOUR_ORDER = "Camera.color_order"
_COLOUR_ORDERS = {"gray": "0", "grey": "0", "bgr": "0", "bgra": "0", "rgb": "1", "rgba": "1"}
#: What ORB-SLAM3 makes of the images before it tracks them, and the key that says how they are.
_RESIZED = {"Camera.newWidth": "Camera.width", "Camera.newHeight": "Camera.height"}
_SCALE = "Camera.imageScale"
#: Of the second camera, which only a pair has.
_SECOND_CAMERA = (
    *(f"Camera2.{name}" for name in (*LENS_NUMBERS, *FISHEYE_PARAMETERS)),
    *(RELATIVE_POSE, OLD_POSE),
    *RECTIFIER_KEYS,
)

_TAKEN = frozenset(
    {*_RENAMED, *LENS_KEYS, *_RESIZED, *_SECOND_CAMERA} | {_BASELINE, _COLOUR_ORDER, _SCALE}
)


@dataclass
class Translated(Document):
    """The entries of a settings file by our names; each keeps its key in the file.

    Attributes
    ----------
    rectification
        Of a raw pair that is described as other programs do it.
    right
        The right camera of a fisheye pair.
    unreadable
        Our keys whose values are missing because of a problem that is in the list.
    """

    rectification: StereoRectification | None = None
    right: RightCamera | None = None
    unreadable: set[str] = field(default_factory=set)


def is_translated(name: str) -> bool:
    """Return whether a key of another program is used here."""
    return name in _TAKEN


def translate(document: Document, sensor: Sensor) -> Translated:
    """Translate the entries of a file to our keys.

    Parameters
    ----------
    document
        The scanned file, with its problems.
    sensor
        The sensor: the second camera is read only for a pair.
    """
    given = flat(document)
    result = Translated(problems=document.problems)
    for name, entry in given.items():
        if name not in _TAKEN:
            result.entries[name] = entry
    for name, ours in _RENAMED.items():
        if name in given:
            _put(result, ours, given[name])
    _translate_colour_order(result, given)
    _check_size_kept(result, given)
    if _BASELINE in given:
        _translate_baseline(result, given[_BASELINE], sensor)
    if sensor is Sensor.STEREO:
        _translate_pair(result, given)
    elif any(name in RECTIFIER_KEYS for name in given):
        _take_raw_camera(result, given)
    if "Camera.model" in given or any(name.startswith("Feature.") for name in given):
        _add_usual_features(result)
    return result


def _put(result: Translated, name: str, entry: Entry) -> None:
    other = result.entries.setdefault(name, entry)
    if other is not entry and _number(other) != _number(entry):
        text = (
            f"{entry.key} is {entry.value}, and {other.key} (line {other.line}), which says the "
            f"same, {other.value}; keep the right one"
        )
        result.problems.append(Problem(entry.line, text))


def _translate_colour_order(result: Translated, given: Mapping[str, Entry]) -> None:
    entry = given.get(_COLOUR_ORDER)
    if entry is None:
        return
    order = _COLOUR_ORDERS.get(str(entry.value).lower())
    if order is None:
        text = f"{entry.key} is {entry.value}; allowed: Gray, RGB, RGBA, BGR, BGRA"
        result.problems.append(Problem(entry.line, text))
        return
    _put(result, "Camera.RGB", Entry(entry.key, entry.line, order))


def _check_size_kept(result: Translated, given: Mapping[str, Entry]) -> None:
    """Refuse images that should be reduced in size: they are tracked in their size."""
    remedy = (
        "ORB-SLAM3 scales the images by it, orbslam2py tracks them as they come. Begin the line "
        "with # to track them at the size that the calibration is for"
    )
    for name, size in _RESIZED.items():
        entry = given.get(name)
        full = result.entries.get(size)
        if entry is not None and (full is None or _number(entry) != _number(full)):
            of = "" if full is None else f" and {full.key} {full.value}"
            text = f"{name} is {entry.value}{of}: {remedy}"
            result.problems.append(Problem(entry.line, text))
    scale = given.get(_SCALE)
    if scale is not None and _number(scale) != 1:
        text = f"{_SCALE} is {scale.value}: {remedy}"
        result.problems.append(Problem(scale.line, text))


def _translate_baseline(result: Translated, entry: Entry, sensor: Sensor) -> None:
    """Compute ``Camera.bf`` from the baseline in metres."""
    if not sensor.has_depth:
        result.entries.setdefault("Camera.bf", entry)  # not checked
        return
    baseline, fx = _number(entry), _number(result.entries.get("Camera.fx"))
    if baseline is None or not 0 < baseline <= 1e6:
        text = f"{entry.key} is {entry.value}; give the baseline in metres, above 0, such as 0.11"
        result.problems.append(Problem(entry.line, text))
        result.unreadable.add("Camera.bf")
        return
    if fx is None:  # an error elsewhere names it
        result.unreadable.add("Camera.bf")
        return
    bf = baseline * fx
    other = result.entries.get("Camera.bf")
    told = _number(other)
    if other is not None and (told is None or abs(told - bf) > 1e-2 * bf):
        text = (
            f"{entry.key} {entry.value} m makes Camera.bf {bf:g} with Camera.fx {fx:g}, and "
            f"{other.key} (line {other.line}) is {other.value}; keep the right one"
        )
        result.problems.append(Problem(entry.line, text))
    result.entries.setdefault("Camera.bf", Entry(entry.key, entry.line, repr(bf)))


def _translate_pair(result: Translated, given: Mapping[str, Entry]) -> None:
    second = {name: entry for name, entry in given.items() if name in _SECOND_CAMERA}
    if not second:
        return
    line = min(entry.line for entry in second.values())
    pair: RawPair | None
    if any(name.startswith("LEFT.") or name.startswith("RIGHT.") for name in given):
        names = ", ".join(second)
        text = f"{names} and LEFT.*, RIGHT.* both say how the pair is rectified; keep one of them"
        result.problems.append(Problem(line, text))
        return
    kind = given.get("Camera.type")
    if kind is not None and str(kind.value).lower() == "rectified":
        _check_rectified(result, second)
        return
    if any(name in RECTIFIER_KEYS for name in second):
        raw_model = given.get(RECTIFIER_MODEL)
        model = None if raw_model is None else fisheye_model(raw_model.value)
        pair = stella_pair(result.entries, second, result.problems, model or PINHOLE)
    else:
        pair = rectified_pair(result.entries, second, result.problems, models_of_pair(given))
    if pair is None:
        result.unreadable.add("Camera.bf")
        return
    result.rectification, result.right = pair.rectification, pair.right
    if pair.right is not None:  # bf follows from where it stands
        result.entries["Camera.bf"] = Entry("Camera.bf", line, repr(pair.camera["bf"]))
        return
    for name in (*LENS_NUMBERS, *FISHEYE_PARAMETERS):
        result.entries.pop(f"Camera.{name}", None)
    for name, value in pair.camera.items():
        result.entries[f"Camera.{name}"] = Entry(f"Camera.{name}", line, repr(value))


def _take_raw_camera(result: Translated, given: Mapping[str, Entry]) -> None:
    """Use the raw left camera instead of the rectified one, for a single camera."""
    model = given.get(RECTIFIER_MODEL)
    fisheye = model is not None and fisheye_model(model.value) is not None
    values = stella_raw_camera(given, result.problems, fisheye=fisheye)
    if values is None:
        return
    for name in LENS_NUMBERS:
        result.entries.pop(f"Camera.{name}", None)
    line = given["StereoRectifier.K_left"].line
    for name, value in values.items():
        result.entries[f"Camera.{name}"] = Entry(f"Camera.{name}", line, repr(value))


def _check_rectified(result: Translated, second: Mapping[str, Entry]) -> None:
    """Check that the second camera of rectified images equals the first."""
    for name, entry in second.items():
        first = result.entries.get(name.replace("Camera2.", "Camera."))
        if first is not None and _number(first) == _number(entry):
            continue
        text = (
            f"{entry.key} goes with a raw pair, whose cameras differ, and Camera.type says that "
            "the images are Rectified; write PinHole if they are not, or, if they are, begin the "
            "line with #"
        )
        result.problems.append(Problem(entry.line, text))


def _add_usual_features(result: Translated) -> None:
    """Add values that stella_vslam may omit."""
    width, height = (_number(result.entries.get(f"Camera.{name}")) for name in ("width", "height"))
    n_features = usual_n_features(int(width or 0), int(height or 0))
    usual = {
        "nFeatures": str(n_features),
        "scaleFactor": "1.2",
        "nLevels": "8",
        "iniThFAST": "20",
        "minThFAST": "7",
    }
    for name, value in usual.items():
        key = f"ORBextractor.{name}"
        result.entries.setdefault(key, Entry(key, 0, value))


def _number(entry: Entry | None) -> float | None:
    """Return the number of an entry; None if it has none."""
    if entry is None or not isinstance(entry.value, str):
        return None
    try:
        return parse_number(entry.value)
    except ValueError:
        return None
