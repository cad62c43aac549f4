# SPDX-License-Identifier: BSD-3-Clause
"""ROS's camera_info, as a file and as printed by ``rostopic echo``, and its ``ost.txt``."""

from __future__ import annotations

import re
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

_K, _D = ("camera_matrix", "K", "k"), ("distortion_coefficients", "D", "d")
_R, _P = ("rectification_matrix", "R", "r"), ("projection_matrix", "P", "p")


def read_camera_info(source: CalibrationSource) -> CameraFile:
    """Read the raw camera, for unrectified images after region of interest and binning."""
    path, values = source.path, source.values
    model = values.get("distortion_model", "plumb_bob") or "plumb_bob"
    lens = lens_of(f"{path}", "distortion_model", model)
    sides = [
        first_of(values, f"image_{side}", side) or source.value(f"image_{side}")
        for side in ("width", "height")
    ]
    size = checked_size(path, sides, "image_width and image_height")
    K = _matrix(source, _K, 9)
    R, P = (_matrix(source, names, count) for names, count in ((_R, 9), (_P, 12)))
    assert K is not None
    if not K.any():
        raise SettingsError(
            f"{path} is of a camera that is not calibrated (its camera matrix is 0); calibrate it "
            "with ROS's camera_calibration or orbslam2py calibrate"
        )
    K = K.reshape(3, 3)
    crop, size = _crop(source, size)
    K = crop @ K
    K = checked_camera_matrix(path, K)
    D = NO_DISTORTION
    numbers: tuple[float, ...] = ()
    if lens == PINHOLE:
        D = opencv_coefficients(path, _matrix(source, _D, None), K, size)
    elif lens == "kannala_brandt":
        numbers = kannala_brandt_numbers(path, "distortion", _matrix(source, _D, None))
    elif lens in LENS_PARAMETERS:
        raise SettingsError(
            f"{path}: ROS has no rule for the coefficients of distortion_model {model}; give the "
            "numbers with orbslam2py settings new --model"
        )
    name = str(values.get("camera_name", "the camera"))
    camera = ForeignCamera(
        name,
        0,
        K,
        D,
        size,
        lens,
        R=None if R is None else R.reshape(3, 3),
        P=None if P is None else crop @ P.reshape(3, 4),
        lens_numbers=numbers,
    )
    return CameraFile((camera,), place_key="projection_matrix")


def _crop(source: CalibrationSource, size: tuple[int, int]) -> tuple[FloatArray, tuple[int, int]]:
    """Find how pixels of the whole sensor become those of images (3, 3), and the images' size."""
    path, roi = source.path, source.values.get("roi") or {}
    roi = source.mapping(roi, "roi")
    keys = ("x_offset", "y_offset", "width", "height")
    region = checked_numbers(path, "roi", [roi.get(key, 0) for key in keys], (4,))
    x, y, width, height = (int(value) for value in region)
    width, height = width or size[0] - x, height or size[1] - y
    names = ("binning_x", "binning_y")
    given = checked_numbers(path, " and ".join(names), [source.values.get(k, 0) for k in names], ())
    bins = [max(1, int(value)) for value in given]
    if min(x, y, width, height) < 0 or x + width > size[0] or y + height > size[1]:
        raise SettingsError(
            f"{path}: roi is not inside of the image of {size[0]} x {size[1]}; give a region of "
            "interest in pixels of the whole image, or remove it"
        )
    A = np.eye(3)
    for i, (offset, factor) in enumerate(zip((x, y), bins, strict=True)):
        # The centre of a binned pixel lies in the middle of those it was made of.
        A[i, i], A[i, 2] = 1 / factor, (0.5 - offset) / factor - 0.5
    return A, (width // bins[0], height // bins[1])


def _matrix(
    source: CalibrationSource, names: tuple[str, ...], count: int | None
) -> FloatArray | None:
    """Take the numbers of a matrix; None if there is no matrix of rectification."""
    values: Mapping[str, Any] = source.values
    name = next((one for one in names if one in values), None)
    if name is None:
        return None if names in (_R, _P) else source.value(names[0])
    value = values[name]
    if isinstance(value, Mapping):
        value = source.value("data", value, f"{name}.")
    return checked_numbers(source.path, name, value, () if count is None else (count,))


# ---- ost.txt -------------------------------------------------------------------------------------
_SECTION = re.compile(r"^\[(.+)\]\s*$")
_LABELS = {
    "width": 1,
    "height": 1,
    "camera matrix": 9,
    "distortion": None,
    "rectification": 9,
    "projection": 12,
}


def read_ost(source: CalibrationSource) -> CameraFile:
    """Read the camera of an ost.txt, or both of a pair."""
    found = _sections(source)
    cameras = [_ost_camera(source, i, name, found[name]) for i, name in enumerate(found)]
    if not cameras:
        raise SettingsError(
            f"{source.path} has no camera matrix; is it an ost.txt of ROS? Name another --format"
        )
    if len(cameras) == 1:
        return CameraFile(tuple(cameras), place_key="projection")
    pairs = both_ways([camera.number for camera in cameras])[:1]
    return CameraFile(tuple(cameras), prefix="camera ", pairs=pairs, place_key="projection")


def _sections(source: CalibrationSource) -> dict[str, dict[str, list[float]]]:
    """Read the numbers below each label, camera by camera."""
    image: dict[str, list[float]] = {}
    cameras: dict[str, dict[str, list[float]]] = {}
    current, label = image, ""
    for number, line in enumerate(source.text.splitlines(), start=1):
        text = line.strip()
        if match := _SECTION.match(text):
            if match[1] == "image":
                current, label = image, ""
                image.clear()
            else:
                name = match[1] if match[1] not in cameras else f"{match[1]} {len(cameras)}"
                current = cameras[name] = dict(image)
        elif text in _LABELS:
            label = text
            current[label] = []
        elif text and not text.startswith("#"):
            try:
                current.setdefault(label, []).extend(float(word) for word in text.split())
            except ValueError:
                raise SettingsError(
                    f"{source.path}:{number}: expected numbers, found '{text[:60]}'; give an "
                    "ost.txt as ROS writes it"
                ) from None
    return cameras


def _ost_camera(
    source: CalibrationSource, number: int, name: str, values: dict[str, list[float]]
) -> ForeignCamera:
    path = source.path
    for label in ("width", "height", "camera matrix", "distortion"):
        source.value(label, values, f"{name}: ")
    size = checked_size(path, [values["width"], values["height"]], "width and height")
    K = checked_camera_matrix(path, np.array(values["camera matrix"]))
    D = opencv_coefficients(path, values["distortion"], K, size)
    R, P = (
        checked_numbers(path, f"{name}: {label}", values[label], (_LABELS[label] or 0,))
        if label in values
        else None
        for label in ("rectification", "projection")
    )
    return ForeignCamera(
        name,
        number,
        K,
        D,
        size,
        R=None if R is None else R.reshape(3, 3),
        P=None if P is None else P.reshape(3, 4),
    )
