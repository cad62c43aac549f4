# SPDX-License-Identifier: BSD-3-Clause
"""Raw stereo pairs in the formats of ORB-SLAM3 and stella_vslam, and their rectification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import LENS_PARAMETERS, PINHOLE
from orbslam2py.settings.groups import (
    DISTORTION_FIELDS,
    CameraRectification,
    CameraSettings,
    StereoRectification,
)
from orbslam2py.settings.opencv_yaml import Entry, Problem, parse_number, read_matrix, read_number
from orbslam2py.settings.pair_cameras import cameras_of_pair
from orbslam2py.settings.right_camera import RightCamera

_INTRINSICS = ("fx", "fy", "cx", "cy")
#: Numbers that describe one camera, after ``Camera1.`` or ``Camera2.``.
LENS_NUMBERS = (*_INTRINSICS, *DISTORTION_FIELDS)
#: Camera 2 to camera 1, in metres.
RELATIVE_POSE = "Stereo.T_c1_c2"
#: The same, as ORB-SLAM3 0.x calls it; 3 x 4 numbers.
OLD_POSE = "Tlr"
RECTIFIER_KEYS = tuple(
    f"StereoRectifier.{name}_{side}" for side in ("left", "right") for name in "KDR"
)


@dataclass(frozen=True)
class RawPair:
    """The rectification of a raw pair, and its rectified cameras.

    Attributes
    ----------
    rectification
        Of both cameras; None for a fisheye pair.
    camera
        fx, fy, cx, cy [pixels] and bf [pixel metres] of the rectified images; of a fisheye pair bf
        alone.
    right
        The right camera of a fisheye pair.
    """

    rectification: StereoRectification | None
    camera: dict[str, float]
    right: RightCamera | None = None


def rectified_pair(
    entries: Mapping[str, Entry],
    second: Mapping[str, Entry],
    problems: list[Problem],
    models: tuple[str, str] = (PINHOLE, PINHOLE),
) -> RawPair | None:
    """Find how a pair with its pose is used, by the rules of ORB-SLAM3 1.0.

    Parameters
    ----------
    entries
        The entries of the file by our names: the first camera and the size of the images.
    second
        ``Camera2.*`` and ``Stereo.T_c1_c2``, or ``Tlr``.
    problems
        Receives the faults, except those of the first camera, which is read elsewhere.
    models
        Of both cameras: "pinhole" or a fisheye model.

    Returns
    -------
    RawPair or None
        None if there is an error.
    """
    line = min(entry.line for entry in second.values())
    pose_entry = second.get(RELATIVE_POSE) or second.get(OLD_POSE)
    lens = LENS_PARAMETERS.get(models[1], ())
    wanted = [f"Camera2.{name}" for name in (*_INTRINSICS, *lens)]
    wanted += [] if pose_entry is not None else [RELATIVE_POSE]
    missing = [name for name in wanted if name not in second]
    missing += [name for name in ("Camera.width", "Camera.height") if name not in entries]
    if missing or pose_entry is None:
        text = (
            f"{', '.join(missing)} missing: a raw pair needs Camera1.* and Camera2.* with fx, fy, "
            f"cx, cy, Camera.width, Camera.height and {RELATIVE_POSE} (camera 2 to camera 1, in "
            "metres)"
        )
        problems.append(Problem(line, text))
        return None
    first_camera = _camera(entries, "Camera", [], models[0])
    second_camera = _camera(second, "Camera2", problems, models[1])
    pose = _pose(pose_entry, problems)
    size = _size(entries)
    if first_camera is None or second_camera is None or pose is None or size is None:
        return None
    T_right_left = np.asarray(np.linalg.inv(pose), dtype=np.float64)
    try:
        found = cameras_of_pair(first_camera, second_camera, T_right_left, size, pose_entry.key)
    except (SettingsError, cv2.error) as error:
        text = f"{pose_entry.key} and the two cameras make no pair: {error}"
        problems.append(Problem(pose_entry.line, text))
        return None
    if found.right is not None:
        right = replace(found.right, T_left_right=pose)  # with all its digits
        return RawPair(None, {"bf": found.camera.bf}, right)
    assert found.rectification is not None
    P_right = found.rectification.right.P
    bf = -float(P_right[0, 3])
    if bf <= 0 or abs(float(P_right[1, 3])) > 1e-3 * bf:
        text = (
            f"{pose_entry.key} does not put camera 2 to the right of camera 1 (its translation is "
            f"{', '.join(f'{value:g}' for value in pose[:3, 3])}); it must map points of camera 2 "
            "into camera 1: take the inverse, if it maps from camera 1 to camera 2"
        )
        problems.append(Problem(pose_entry.line, text))
        return None
    numbers = {name: float(getattr(found.camera, name)) for name in _INTRINSICS}
    return RawPair(found.rectification, numbers | {"bf": bf})


def stella_pair(
    entries: Mapping[str, Entry],
    given: Mapping[str, Entry],
    problems: list[Problem],
    model: str = PINHOLE,
) -> RawPair | None:
    """Read the rectification of stella_vslam's ``StereoRectifier``; see `rectified_pair`.

    The first camera is the rectified one there; `model` is that of the raw ones.
    """
    line = min(entry.line for entry in given.values())
    missing = [name for name in RECTIFIER_KEYS if name not in given]
    missing += [
        f"Camera.{name}" for name in ("width", "height", "bf") if f"Camera.{name}" not in entries
    ]
    if missing:
        text = f"{', '.join(missing)} missing: the rectification of a pair needs them all"
        problems.append(Problem(line, text))
        return None
    camera = _camera(entries, "Camera", [])
    size = _size(entries)
    bf = _read(entries["Camera.bf"], [])
    if camera is None or size is None or bf is None:
        return None  # an error elsewhere names it
    cameras = []
    for side, shift in (("left", 0.0), ("right", -bf)):
        try:
            K, D, R = (_numbers(given[f"StereoRectifier.{name}_{side}"]) for name in "KDR")
            P = np.column_stack([camera.matrix, [shift, 0.0, 0.0]])
            cameras.append(
                CameraRectification(
                    K=_square(K, "K"),
                    D=D,
                    R=_square(R, "R"),
                    P=P,
                    width=size[0],
                    height=size[1],
                    model=model,
                )
            )
        except (SettingsError, ValueError) as error:
            problems.append(Problem(given[f"StereoRectifier.K_{side}"].line, f"{side}: {error}"))
    if len(cameras) < 2:
        return None
    numbers = {name: float(getattr(camera, name)) for name in _INTRINSICS}
    return RawPair(StereoRectification(*cameras), numbers | {"bf": bf})


def stella_raw_camera(
    given: Mapping[str, Entry], problems: list[Problem], *, fisheye: bool = False
) -> dict[str, float] | None:
    """Read fx, fy, cx, cy and the distortion of the raw left camera of a ``StereoRectifier``.

    The distortion of a fisheye is k1, k2, k3, k4.
    """
    names = ("StereoRectifier.K_left", "StereoRectifier.D_left")
    missing = [name for name in names if name not in given]
    if missing:
        line = min(entry.line for name, entry in given.items() if name in RECTIFIER_KEYS)
        text = f"{', '.join(missing)} missing: images of one camera alone are not rectified"
        problems.append(Problem(line, text))
        return None
    try:
        K, D = _square(_numbers(given[names[0]]), "K_left"), _numbers(given[names[1]])
    except ValueError as error:
        problems.append(Problem(given[names[0]].line, str(error)))
        return None
    if D.size not in ((4,) if fisheye else (4, 5, 8)):
        wanted = "4 coefficients of a fisheye lens" if fisheye else "4, 5 or 8 coefficients"
        text = f"{names[1]} must have {wanted}, not {D.size}"
        problems.append(Problem(given[names[1]].line, text))
        return None
    intrinsics = (K[0, 0], K[1, 1], K[0, 2], K[1, 2])
    values = dict(zip(_INTRINSICS, map(float, intrinsics), strict=True))
    fields = LENS_PARAMETERS["kannala_brandt"] if fisheye else DISTORTION_FIELDS
    return values | dict(zip(fields, D.tolist(), strict=False))


def _camera(
    entries: Mapping[str, Entry], prefix: str, problems: list[Problem], model: str = PINHOLE
) -> CameraSettings | None:
    values: dict[str, float] = {}
    lens = LENS_PARAMETERS.get(model)
    for name in LENS_NUMBERS if lens is None else (*_INTRINSICS, *lens):
        entry = entries.get(f"{prefix}.{name}")
        number = None if entry is None else _read(entry, problems)
        if number is not None:
            values[name] = number
        elif entry is not None or lens is not None or name in _INTRINSICS:
            return None
    fields: dict[str, Any] = dict(values)
    if lens is not None:
        for name in set(LENS_NUMBERS) - {*_INTRINSICS, *lens}:
            other = entries.get(f"{prefix}.{name}")
            if other is not None and _read(other, problems) != 0:
                text = (
                    f"{other.key} is {other.value}, and the lens {model} has "
                    f"{', '.join(lens)} alone; name the model to which all coefficients belong"
                )
                problems.append(Problem(other.line, text))
                return None
        fields = {name: values[name] for name in _INTRINSICS}
        fields |= {"model": model, "lens": tuple(values[name] for name in lens)}
    try:
        return CameraSettings(**fields)
    except SettingsError as error:
        line = entries[f"{prefix}.fx"].line
        problems.append(Problem(line, str(error).replace("Camera.", f"{prefix}.")))
        return None


def _read(entry: Entry, problems: list[Problem]) -> float | None:
    try:
        return read_number(entry)
    except ValueError as error:
        problems.append(Problem(entry.line, str(error)))
        return None


def _size(entries: Mapping[str, Entry]) -> tuple[int, int] | None:
    sides = [_read(entries[name], []) for name in ("Camera.width", "Camera.height")]
    whole = [int(side) for side in sides if side is not None and side >= 1 and side.is_integer()]
    return (whole[0], whole[1]) if len(whole) == 2 else None


def _pose(entry: Entry, problems: list[Problem]) -> FloatArray | None:
    try:
        T = read_matrix(entry)
    except ValueError as error:
        problems.append(Problem(entry.line, str(error)))
        return None
    if T.shape == (3, 4):
        T = np.vstack([T, [0.0, 0.0, 0.0, 1.0]])
    rigid = T.shape == (4, 4) and np.abs(T[:3, :3] @ T[:3, :3].T - np.eye(3)).max() < 1e-3
    if not rigid or np.linalg.det(T[:3, :3]) < 0 or np.abs(T[3] - (0, 0, 0, 1)).max() > 1e-6:
        text = (
            f"{entry.key} is no rigid transform: give 4 x 4 numbers, a rotation and a translation "
            "in metres, with the last row 0, 0, 0, 1"
        )
        problems.append(Problem(entry.line, text))
        return None
    return T


def _numbers(entry: Entry) -> FloatArray:
    if not isinstance(entry.value, tuple):
        raise ValueError(f"{entry.key} must be a list [...]")
    try:
        return np.array([parse_number(item) for item in entry.value])
    except ValueError as error:
        raise ValueError(f"{entry.key}: {error}") from None


def _square(values: FloatArray, name: str) -> FloatArray:
    if values.size != 9:
        raise ValueError(f"{name} must have 9 numbers, not {values.size}")
    return values.reshape(3, 3)
