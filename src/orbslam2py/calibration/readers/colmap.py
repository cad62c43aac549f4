# SPDX-License-Identifier: BSD-3-Clause
"""COLMAP's ``cameras.txt``."""

from __future__ import annotations

from orbslam2py.calibration.camera_model import (
    checked_numbers,
    checked_size,
    opencv_coefficients,
    pinhole_matrix,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
)
from orbslam2py.calibration.lenses import PINHOLE, lens_of
from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import LENS_PARAMETERS

#: Where fx, fy, cx, cy and the coefficients are among the parameters of a model; -1: zero.
_MODELS: dict[str, tuple[int, ...]] = {
    "SIMPLE_PINHOLE": (0, 0, 1, 2),
    "PINHOLE": (0, 1, 2, 3),
    "SIMPLE_RADIAL": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV": (0, 1, 2, 3, 4, 5, 6, 7),
    "FULL_OPENCV": (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11),
}
#: The same of fisheye models: the parameters after cy are those of the lens; -1: zero.
_FISHEYES: dict[str, tuple[int, ...]] = {
    "SIMPLE_FISHEYE": (0, 0, 1, 2, -1, -1, -1, -1),
    "FISHEYE": (0, 1, 2, 3, -1, -1, -1, -1),
    "SIMPLE_RADIAL_FISHEYE": (0, 0, 1, 2, 3, -1, -1, -1),
    "RADIAL_FISHEYE": (0, 0, 1, 2, 3, 4, -1, -1),
    "OPENCV_FISHEYE": (0, 1, 2, 3, 4, 5, 6, 7),
    "FOV": (0, 1, 2, 3, 4),
}


def read_colmap(source: CalibrationSource) -> CameraFile:
    """Read all cameras of the list; their numbers are the CAMERA_ID."""
    cameras: dict[int, ForeignCamera] = {}
    for line_number, line in enumerate(source.text.splitlines(), start=1):
        fields = line.split()
        if not fields or fields[0].startswith("#"):
            continue
        if len(fields) < 5 or not fields[0].isdecimal():
            raise SettingsError(
                f"{source.path}:{line_number}: expected 'CAMERA_ID MODEL WIDTH HEIGHT PARAMS...'; "
                "is it cameras.txt of COLMAP?"
            )
        number = int(fields[0])
        cameras[number] = _camera(f"{source.path}:{line_number}", number, fields[1], fields[2:])
    if not cameras:
        raise SettingsError(f"{source.path} lists no camera; give cameras.txt of COLMAP")
    return CameraFile(tuple(cameras.values()), prefix="camera ")


def _camera(where: str, number: int, model: str, values: list[str]) -> ForeignCamera:
    lens = lens_of(where, "the camera model", model)
    try:
        width, height, *parameters = [float(value) for value in values]
    except ValueError as error:
        raise SettingsError(
            f"{where}: {error}; give the numbers of {model} as COLMAP writes them"
        ) from None
    size = checked_size(where, [width, height])
    places = (_MODELS | _FISHEYES).get(model)
    if places is None:
        if lens == PINHOLE or lens in LENS_PARAMETERS:
            raise SettingsError(
                f"{where}: COLMAP has no camera model {model}; give one of "
                f"{', '.join(_MODELS | _FISHEYES)}, with COLMAP's parameters"
            )
        return ForeignCamera(str(number), number, None, NO_DISTORTION, size, lens)
    checked_numbers(where, f"parameters of {model}", parameters, (max(places) + 1,))
    fx, fy, cx, cy, *D = (0.0 if i < 0 else parameters[i] for i in places)
    # COLMAP's pixels begin at their corner: the centre of the first one is (0.5, 0.5).
    K = pinhole_matrix(where, model, [fx, fy, cx - 0.5, cy - 0.5])
    if lens != PINHOLE:
        return ForeignCamera(
            str(number), number, K, NO_DISTORTION, size, lens, lens_numbers=tuple(D)
        )
    return ForeignCamera(str(number), number, K, opencv_coefficients(where, D, K, size), size, lens)
