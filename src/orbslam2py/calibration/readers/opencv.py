# SPDX-License-Identifier: BSD-3-Clause
"""OpenCV's YAML and XML: one camera, or the pair of ``stereoCalibrate``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    kannala_brandt_numbers,
    opencv_coefficients,
    pose_of_parts,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    both_ways,
    first_of,
)
from orbslam2py.calibration.lenses import PINHOLE, lens_of
from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import LENS_PARAMETERS

_ONE = (
    ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "mtx", "intrinsic_matrix"),
    (
        *("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs"),
        *("distortion", "dist", "D", "dist_coeff"),
    ),
)
#: Of a pair: n is 1 or 2, side "left" or "right", s its first letter in upper case.
_OF_PAIR = (
    (
        *("M{n}", "K{n}", "cameraMatrix{n}", "camera_matrix{n}", "camera_matrix_{n}", "mtx{n}"),
        *("{side}_camera_matrix", "camera_matrix_{side}", "K_{side}", "M_{side}", "{side}_K"),
        *("cameraMatrix{s}", "camera_matrix_{s}", "mtx{s}", "K{s}", "M{s}"),
    ),
    (
        *("D{n}", "distCoeffs{n}", "dist_coeffs{n}", "distortion_coefficients{n}", "dist{n}"),
        *("dist_coeffs_{n}", "distortion_coefficients_{n}", "{side}_distortion_coefficients"),
        *("distortion_coefficients_{side}", "dist_coeffs_{side}", "{side}_dist_coeffs"),
        *("D_{side}", "dist_{side}", "{side}_D", "distCoeffs{s}", "dist{s}", "D{s}"),
    ),
)
_LEFT, _RIGHT = (
    [tuple(name.format(n=n, side=side, s=side[0].upper()) for name in names) for names in _OF_PAIR]
    for n, side in ((1, "left"), (2, "right"))
)
_ROTATION = ("R", "rotation_matrix", "rotation", "R_stereo", "rotationMatrix")
_TRANSLATION = ("T", "translation_vector", "translation", "T_stereo", "translationVector", "t")
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "img_size", "size")


def read_opencv(source: CalibrationSource) -> CameraFile:
    """Read one camera, or both of a pair and where the right one stands (in metres).

    OpenCV's own reader is not used: files with a damaged matrix make it write beyond its memory.
    """
    path = source.path
    values = _xml_values(source) if source.text.lstrip().startswith("<") else source.values
    fisheye = str(values.get("fisheye_model", 0)) not in ("0", "0.0", "False")
    one, left, right = (
        [_matrix(source, values, names) for names in camera] for camera in (_ONE, _LEFT, _RIGHT)
    )
    R, T = (_matrix(source, values, names) for names in (_ROTATION, _TRANSLATION))
    sides = _sides(values)
    size = source.size if sides is None else checked_size(path, sides)
    lens = "kannala_brandt" if fisheye else PINHOLE
    if not fisheye and isinstance(model := values.get("distortion_model"), str):
        lens = lens_of(f"{path}", "distortion_model", model)
    if left[0] is None or right[0] is None:
        K, D = one if one[0] is not None else left
        return CameraFile((_camera(source, "the camera", 0, (K, D), size, lens, None),))
    place = None
    if R is not None and T is not None:
        rotation = cv2.Rodrigues(R)[0] if R.size == 3 else R
        place = pose_of_parts(path, "the right camera (R, T)", rotation, T)
    cameras = (
        _camera(source, "camera 0", 0, (left[0], left[1]), size, lens, np.eye(4)),
        _camera(source, "camera 1", 1, (right[0], right[1]), size, lens, place),
    )
    return CameraFile(cameras, prefix="camera ", pairs=both_ways([0, 1]), place_key="R and T")


def _camera(
    source: CalibrationSource,
    name: str,
    number: int,
    matrices: tuple[FloatArray | None, FloatArray | None],
    size: tuple[int, int] | None,
    lens: str,
    T: FloatArray | None,
) -> ForeignCamera:
    path, (K, D) = source.path, matrices
    if K is None:
        names = ", ".join(_ONE[0])
        raise SettingsError(
            f"{path} has no camera matrix (looked for {names}); is it a file of OpenCV? Add "
            "camera_matrix, or name another --format"
        )
    K = checked_camera_matrix(path, K)
    given = np.zeros(0) if D is None else D
    if lens == PINHOLE:
        known = opencv_coefficients(path, given, K, size)
        return ForeignCamera(name, number, K, known, size, lens, T)
    numbers: tuple[float, ...] = ()
    if lens == "kannala_brandt":
        numbers = kannala_brandt_numbers(path, "the distortion", given.tolist())
    elif lens in LENS_PARAMETERS:
        raise SettingsError(
            f"{path}: OpenCV has no {lens} lens; give the numbers with orbslam2py settings new "
            "--model"
        )
    return ForeignCamera(name, number, K, NO_DISTORTION, size, lens, T, lens_numbers=numbers)


def _sides(values: Mapping[str, Any]) -> object:
    """Take width and height; None if there are none."""
    sides = [first_of(values, *names) for names in (_WIDTH, _HEIGHT)]
    if None not in sides:
        return sides
    size = first_of(values, *_SIZE)
    return size.get("data") if isinstance(size, Mapping) else size


def _matrix(
    source: CalibrationSource, values: Mapping[str, Any], names: tuple[str, ...]
) -> FloatArray | None:
    """Take the numbers of a matrix; None if there is none of these names."""
    name = next((one for one in names if one in values), None)
    if name is None:
        return None
    value = values[name]
    if not isinstance(value, Mapping):
        return checked_numbers(source.path, name, value, ())
    keys = ["sizes"] if "sizes" in value else ["rows", "cols"]
    given = [source.value(key, value, f"{name}.") for key in keys]
    sizes = checked_numbers(source.path, f"{name}.{' and '.join(keys)}", given, ())
    found = checked_numbers(source.path, name, source.value("data", value, f"{name}."), ())
    if found.size != np.prod(sizes):
        shape = " x ".join(f"{side:g}" for side in sizes)
        raise SettingsError(
            f"{source.path}: {name} has {found.size} numbers, but says that they are {shape}; "
            "write the file again with cv2.FileStorage"
        )
    return found


def _xml_values(source: CalibrationSource) -> Mapping[str, Any]:
    """Read named values of XML as those of YAML."""
    try:
        root = ElementTree.fromstring(source.text.strip())
    except ElementTree.ParseError as error:
        raise SettingsError(
            f"{source.path} is damaged XML: {error}; write it again with cv2.FileStorage"
        ) from error
    values: dict[str, Any] = {}
    for node in root:
        parts = {part.tag: (part.text or "").split() for part in node}
        words = (node.text or "").split()
        values[node.tag] = parts or (words[0] if len(words) == 1 else words)
    return values
