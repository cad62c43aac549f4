# SPDX-License-Identifier: BSD-3-Clause
"""Cameras in JSON: of scanning apps, of renderers, and plain numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_camera_matrix,
    checked_numbers,
    checked_size,
    kannala_brandt_numbers,
    opencv_coefficients,
    pinhole_matrix,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    first_of,
    in_order,
)
from orbslam2py.calibration.lenses import PINHOLE, lens_of
from orbslam2py.calibration.readers.slam_systems import lens_by_keys, lens_parameters, named_lens
from orbslam2py.errors import SettingsError
from orbslam2py.settings.foreign import MATRIX_KEYS

_FIVE = ("k1", "k2", "p1", "p2", "k3")
_EIGHT = (*_FIVE, "k4", "k5", "k6")
_RADIAL = ("k1", "k2", "k3", "k4")
_NAME = "the camera"


# ---- nerfstudio ----------------------------------------------------------------------------------
_LENS_KEYS = (*("fl_x", "fl_y", "cx", "cy", "w", "h", "camera_model"), *_EIGHT)


def read_nerfstudio(source: CalibrationSource) -> CameraFile:
    """Read the camera of a transforms.json, which all frames must share."""
    path, shared = source.path, source.values
    frames = source.mappings(source.value("frames"), "frames")
    all_of_them = [{key: one[key] for key in _LENS_KEYS if key in one} for one in frames]
    if any(one != all_of_them[0] for one in all_of_them):
        raise SettingsError(
            f"{path}: its frames have different cameras; take the images of one camera, and a "
            "file of their frames alone"
        )
    values = {**shared, **all_of_them[0]}
    model = "fisheye" if values.get("is_fisheye") else values.get("camera_model", "OPENCV")
    lens = lens_of(f"{path}", "camera_model", model)
    size = None
    if "w" in values and "h" in values:
        size = checked_size(path, [values["w"], values["h"]], "w and h")
    if lens not in (PINHOLE, "kannala_brandt"):
        if lens_parameters(lens) is not None:
            raise SettingsError(
                f"{path}: nerfstudio has no camera_model {model}; give OPENCV or OPENCV_FISHEYE"
            )
        return _one(ForeignCamera(_NAME, 0, None, NO_DISTORTION, size, lens))
    # The centre of the first pixel is (0.5, 0.5), as in COLMAP, from where the numbers come.
    cx, cy = (_middle(source, values, key, size, i) - 0.5 for i, key in enumerate(("cx", "cy")))
    fx = _focal(source, values, "x", size)
    fy = _focal(source, values, "y", size) if {"fl_y", "camera_angle_y"} & set(values) else fx
    K = pinhole_matrix(path, "fl_x, fl_y, cx, cy", [fx, fy, cx, cy])
    note = "cx and cy of nerfstudio count from the image's corner; half a pixel is taken off"
    if lens == "kannala_brandt":
        numbers = kannala_brandt_numbers(path, "k1, k2, k3, k4", in_order(values, *_RADIAL))
        fisheye = ForeignCamera(_NAME, 0, K, NO_DISTORTION, size, lens, lens_numbers=numbers)
        return CameraFile((fisheye,), note=note)
    if values.get("k4"):
        raise SettingsError(
            f"{path}: k4 is {values['k4']}, and only k1, k2, k3, p1, p2 of a pinhole camera are "
            "supported; name the camera_model if it is a fisheye camera, or export the images "
            "undistorted"
        )
    D = opencv_coefficients(path, in_order(values, *_FIVE), K, size)
    return CameraFile((ForeignCamera(_NAME, 0, K, D, size),), note=note)


def _middle(
    source: CalibrationSource,
    values: Mapping[str, Any],
    key: str,
    size: tuple[int, int] | None,
    axis: int,
) -> float:
    if key not in values and size is not None:
        return size[axis] / 2
    return float(checked_numbers(source.path, key, source.value(key, values), (1,))[0])


def _focal(
    source: CalibrationSource, values: Mapping[str, Any], axis: str, size: tuple[int, int] | None
) -> float:
    key, angle = f"fl_{axis}", f"camera_angle_{axis}"
    if key in values or angle not in values or size is None:
        return float(checked_numbers(source.path, key, source.value(key, values), (1,))[0])
    half = float(checked_numbers(source.path, angle, values[angle], (1,))[0]) / 2
    return 0.5 * size["xy".index(axis)] / math.tan(half) if math.tan(half) else 0.0


# ---- apps and renderers --------------------------------------------------------------------------
def read_open3d(source: CalibrationSource) -> CameraFile:
    """Read an intrinsic, whose matrix is written column by column."""
    values = source.mapping(source.values.get("intrinsic", source.values), "intrinsic")
    sides = [source.value(side, values) for side in ("width", "height")]
    matrix = _column_by_column(source, "intrinsic_matrix", values)
    size = checked_size(source.path, sides, "width and height")
    return _one(ForeignCamera(_NAME, 0, matrix, NO_DISTORTION, size))


def read_record3d(source: CalibrationSource) -> CameraFile:
    """Read the metadata of a recording, whose matrix is written column by column."""
    size = checked_size(source.path, [source.value("w"), source.value("h")], "w and h")
    K = _column_by_column(source, "K", source.values)
    camera = ForeignCamera(_NAME, 0, K, NO_DISTORTION, size)
    return CameraFile((camera,), fps=_rate(source, "fps"))


def read_replica(source: CalibrationSource) -> CameraFile:
    """Read the rendered camera, and the units of its depth images per metre."""
    values, where = source.mapping(source.value("camera"), "camera"), "camera."
    sides = [source.value(side, values, where) for side in ("w", "h")]
    camera = _named(source, values, where, checked_size(source.path, sides, "camera.w and h"))
    scale = checked_numbers(source.path, "camera.scale", source.value("scale", values, where), (1,))
    return CameraFile((camera,), depth_factor=float(scale[0]))


def read_polycam(source: CalibrationSource) -> CameraFile:
    """Read the camera of a frame."""
    sides = [source.value(side) for side in ("width", "height")]
    size = checked_size(source.path, sides, "width and height")
    return _one(_named(source, source.values, "", size))


def _one(camera: ForeignCamera) -> CameraFile:
    return CameraFile((camera,))


def _named(
    source: CalibrationSource, values: Mapping[str, Any], where: str, size: tuple[int, int]
) -> ForeignCamera:
    given = [source.value(key, values, where) for key in ("fx", "fy", "cx", "cy")]
    K = pinhole_matrix(source.path, f"{where}fx, fy, cx, cy", given)
    return ForeignCamera(_NAME, 0, K, NO_DISTORTION, size)


def _column_by_column(source: CalibrationSource, key: str, values: Mapping[str, Any]) -> FloatArray:
    found = checked_numbers(source.path, key, source.value(key, values), (9,))
    return checked_camera_matrix(source.path, _upright(found.reshape(3, 3)), key)


def _upright(K: FloatArray) -> FloatArray:
    """Bring a matrix that may be written column by column to rows; the last one is 0, 0, 1."""
    return K.T if K[2, :2].any() and not K[:2, 2].any() else K


def _rate(source: CalibrationSource, key: str) -> float | None:
    given = source.values.get(key)
    return None if given is None else float(checked_numbers(source.path, key, given, (1,))[0])


# ---- numbers -------------------------------------------------------------------------------------
_SIZES = (("width", "w", "image_width", "cols"), ("height", "h", "image_height", "rows"))
_CENTRES = (("cx", "ppx", "u0", "px"), ("cy", "ppy", "v0", "py"))
_COEFFICIENTS = (
    *("dist_coeffs", "dist_coeff", "distCoeffs", "distortion_coefficients", "distortion"),
    *("dist", "coeffs", "D", "distortion_coeffs"),
)
_MODELS = ("distortion_model", "camera_model", "model", "lens", "camera_type")


def read_numbers(source: CalibrationSource) -> CameraFile:
    """Read fx, fy, cx, cy or a camera matrix, and coefficients in OpenCV's order or by names."""
    path, values = source.path, source.values
    lens, given = _lens_of_numbers(source)
    size = source.size
    sides = [first_of(values, *names) for names in _SIZES]
    if None not in sides:
        size = checked_size(path, sides, "width and height")
    names = lens_parameters(lens)
    if names is None:
        return _one(ForeignCamera(_NAME, 0, None, NO_DISTORTION, size, lens))
    K = _numbers_matrix(source)
    if names:
        if isinstance(given, Mapping):
            numbers = named_lens(source, given, "", names)
        elif lens == "kannala_brandt":
            numbers = kannala_brandt_numbers(path, "the distortion", given)
        else:
            numbers = tuple(checked_numbers(path, "the distortion", given, (len(names),)).tolist())
        return _one(ForeignCamera(_NAME, 0, K, NO_DISTORTION, size, lens, lens_numbers=numbers))
    return _one(ForeignCamera(_NAME, 0, K, opencv_coefficients(path, given, K, size), size))


def _lens_of_numbers(source: CalibrationSource) -> tuple[str, Any]:
    """Find the lens, and its coefficients: a list, or named values of a fisheye lens."""
    values = source.values
    listed = first_of(values, *_COEFFICIENTS)
    named = listed if isinstance(listed, Mapping) else values if listed is None else {}
    model, by_keys = first_of(values, *_MODELS), lens_by_keys(named or values)
    lens = by_keys
    # Without coefficients RealSense's models are the same.
    plain = "brown_conrady" in str(model) and not (
        named or np.any(checked_numbers(source.path, "coeffs", listed, ()))
    )
    if model is not None and not plain:
        lens = lens_of(f"{source.path}", "the model", str(model).rpartition(".")[2])
        if lens == PINHOLE and by_keys != PINHOLE:
            raise SettingsError(
                f"{source.path}: the model {model} is a pinhole's, and the numbers are those of a "
                f"{by_keys} lens; name the right model"
            )
    if lens == PINHOLE and named:
        return lens, _coefficients_by_name(source, named)
    return lens, named or listed


def _coefficients_by_name(source: CalibrationSource, values: Mapping[str, Any]) -> list[Any]:
    if values.get("k4") and not {"k5", "k6"} <= set(values):
        raise SettingsError(
            f"{source.path}: k4 is {values['k4']}, but k5 and k6 are missing; add them (0, if "
            'there are none), or name the lens with "model": "fisheye" if it is one'
        )
    return in_order(values, *_EIGHT)


def _numbers_matrix(source: CalibrationSource) -> FloatArray:
    path, values = source.path, source.values
    matrix = first_of(values, *MATRIX_KEYS)
    if matrix is not None and "fx" not in values:
        if isinstance(matrix, Mapping):
            matrix = source.value("data", matrix, "the camera matrix: ")
        found = checked_numbers(path, "the camera matrix", matrix, (4, 9))
        if found.size == 4:
            return pinhole_matrix(path, "fx, fy, cx, cy", found)
        return checked_camera_matrix(path, _upright(np.asarray(found).reshape(3, 3)))
    given = [source.value("fx"), source.value("fy")]
    for names in _CENTRES:
        centre = first_of(values, *names)
        given.append(source.value(names[0]) if centre is None else centre)
    return pinhole_matrix(path, "fx, fy, cx, cy", given)
