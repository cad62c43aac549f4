# SPDX-License-Identifier: BSD-3-Clause
"""Factory calibrations of RealSense cameras, as ``rs-enumerate-devices -c`` prints them."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_numbers,
    checked_size,
    kannala_brandt_numbers,
    opencv_coefficients,
    pinhole_matrix,
    pose_of_parts,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
)
from orbslam2py.calibration.lenses import PINHOLE
from orbslam2py.datasets.bags.calibration import inverted_distortion
from orbslam2py.errors import SettingsError
from orbslam2py.trajectory.rotations import inverse_poses

_INTRINSIC = re.compile(
    r'^\s*Intrinsic of\s+"(?P<name>[^"]+)"\s*/\s*(?P<width>\d+)\s*x\s*(?P<height>\d+)[^\n]*\n'
    r"(?P<body>(?:[ \t]+\S[^\n]*\n?)+)",
    re.MULTILINE,
)
_FIELD = re.compile(r"^\s*([^:\n]+?)\s*:\s*(.*?)\s*$", re.MULTILINE)
_EXTRINSIC = re.compile(
    r'Extrinsic from\s+"(?P<first>[^"]+)"\s+To\s+"(?P<second>[^"]+)"\s*:\s*'
    r"Rotation Matrix:(?P<R>.*?)Translation Vector:(?P<t>[^\n]*)",
    re.DOTALL | re.IGNORECASE,
)
#: Names of the cameras of the stereo pairs.
_PAIRS = (("Infrared 1", "Infrared 2"), ("Fisheye 1", "Fisheye 2"))
_NO_LENS, _INVERSE = "none", "inverse brown conrady"
_BROWN = (_NO_LENS, "brown conrady", "modified brown conrady")
_KANNALA_BRANDT = "kannala brandt4"


def read_realsense(source: CalibrationSource) -> CameraFile:
    """Read the cameras at one resolution; extrinsics are in metres."""
    blocks = list(_INTRINSIC.finditer(source.text))
    sizes = {(int(one["width"]), int(one["height"])) for one in blocks}
    size = _resolution(source, sizes)
    fields: dict[str, Mapping[str, str]] = {}
    for one in blocks:
        if (int(one["width"]), int(one["height"])) == size:
            fields.setdefault(one["name"], dict(_FIELD.findall(one["body"])))
    places = _places(source, list(fields))
    cameras = tuple(
        _camera(source, number, name, values, size, places.get(name))
        for number, (name, values) in enumerate(fields.items())
    )
    numbers = {camera.name: camera.number for camera in cameras}
    pairs = tuple(
        (numbers[a], numbers[b])
        for left, right in _PAIRS
        if left in numbers and right in numbers
        for a, b in ((left, right), (right, left))
    )
    return CameraFile(cameras, prefix="camera ", pairs=pairs, place_key="the Extrinsic")


def _resolution(source: CalibrationSource, sizes: set[tuple[int, int]]) -> tuple[int, int]:
    listed = ", ".join(f"{width}x{height}" for width, height in sorted(sizes))
    if not sizes:
        raise SettingsError(
            f'{source.path} has no block "Intrinsic of"; print it again with '
            "rs-enumerate-devices -c"
        )
    if source.size is None and len(sizes) > 1:
        raise SettingsError(
            f"{source.path} holds calibrations for images of {listed}; choose yours with --size"
        )
    if source.size is not None and source.size not in sizes:
        raise SettingsError(
            f"{source.path} holds no calibration for images of {source.size[0]}x{source.size[1]}; "
            f"give --size with one there is: {listed}"
        )
    return source.size or next(iter(sizes))


def _camera(
    source: CalibrationSource,
    number: int,
    name: str,
    values: Mapping[str, str],
    size: tuple[int, int],
    T: FloatArray | None,
) -> ForeignCamera:
    where = f"{source.path}: {name}"
    size = checked_size(where, size)
    numbers = [source.value(key, values, f"{name}: ") for key in ("Fx", "Fy", "PPX", "PPY")]
    K = pinhole_matrix(where, "Fx, Fy, PPX, PPY", numbers)
    model = values.get("Distortion", "None").lower()
    given = checked_numbers(where, "Coeffs", values.get("Coeffs", "").split(), ())
    if model == _KANNALA_BRANDT:
        lens = kannala_brandt_numbers(where, "Coeffs", given)
        return ForeignCamera(
            name, number, K, NO_DISTORTION, size, "kannala_brandt", T, lens_numbers=lens
        )
    if not given.any():
        return ForeignCamera(name, number, K, NO_DISTORTION, size, PINHOLE, T)
    if model == _INVERSE:
        D = inverted_distortion(K, opencv_coefficients(where, given, K, size), size)
    elif model in _BROWN:
        D = opencv_coefficients(where, given, K, size)
    else:
        raise SettingsError(
            f"{where} has the distortion {values.get('Distortion')}, which is not supported; "
            "calibrate the camera with orbslam2py calibrate"
        )
    return ForeignCamera(name, number, K, D, size, PINHOLE, T)


def _places(source: CalibrationSource, names: list[str]) -> dict[str, FloatArray]:
    """First camera to each camera that an Extrinsic names with one that is known, (4, 4)."""
    links: dict[tuple[str, str], FloatArray] = {}
    for one in _EXTRINSIC.finditer(source.text):
        first, second = one["first"], one["second"]
        where = f"the Extrinsic from {first} to {second}"
        T = pose_of_parts(source.path, where, one["R"].split(), one["t"].split())
        links.setdefault((first, second), T)
        links.setdefault((second, first), inverse_poses(T[None])[0])
    places = {names[0]: np.eye(4)} if names else {}
    for _ in names:
        for (known, new), T in links.items():
            if known in places and new not in places:
                places[new] = np.asarray(T @ places[known])
    return places
