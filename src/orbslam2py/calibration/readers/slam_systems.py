# SPDX-License-Identifier: BSD-3-Clause
"""Cameras in the files of other SLAM systems: EuRoC, VINS, stella_vslam, Basalt and neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_numbers,
    checked_pose,
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
    both_ways,
    in_order,
)
from orbslam2py.calibration.lenses import PINHOLE, UNIFIED, lens_of
from orbslam2py.errors import SettingsError
from orbslam2py.settings.fisheye import LENS_PARAMETERS
from orbslam2py.trajectory.rotations import inverse_poses, rotations_from_quaternions

_FIVE = ("k1", "k2", "p1", "p2", "k3")
_EIGHT = (*_FIVE, "k4", "k5", "k6")
_PINHOLE = ("fx", "fy", "cx", "cy")


def named_camera(
    source: CalibrationSource,
    values: Mapping[str, Any],
    where: str,
    lens: str,
    size: tuple[int, int] | None,
    coefficients: list[Any],
    *,
    number: int = 0,
    T_camera_rig: FloatArray | None = None,
) -> ForeignCamera:
    """Make a camera of values fx, fy, cx, cy and, for a fisheye, its parameters by their names.

    Parameters
    ----------
    source
        The file.
    values, where
        The values and their place in the file, with a point at the end.
    lens
        As `orbslam2py.calibration.lenses.lens_of` returns it.
    size
        Width and height [pixels].
    coefficients
        In OpenCV's order; not used for a fisheye.
    number, T_camera_rig
        As `ForeignCamera` has them.
    """
    name = where.rstrip(".") or "the camera"
    names = lens_parameters(lens)
    if names is None:
        return ForeignCamera(name, number, None, NO_DISTORTION, size, lens, T_camera_rig)
    given = [source.value(key, values, where) for key in _PINHOLE]
    K = pinhole_matrix(source.path, f"{where}fx, fy, cx, cy", given)
    D, numbers = NO_DISTORTION, named_lens(source, values, where, names)
    if lens == PINHOLE:
        D = opencv_coefficients(f"{source.path}: {name}", coefficients, K, size)
    return ForeignCamera(name, number, K, D, size, lens, T_camera_rig, lens_numbers=numbers)


def lens_parameters(lens: str) -> tuple[str, ...] | None:
    """Names of the parameters of a lens that is supported; None for another one."""
    if lens == PINHOLE:
        return ()
    return ("alpha",) if lens == UNIFIED else LENS_PARAMETERS.get(lens)


def named_lens(
    source: CalibrationSource, values: Mapping[str, Any], where: str, names: tuple[str, ...]
) -> tuple[float, ...]:
    """Take the parameters of a fisheye lens by their names.

    Raises
    ------
    SettingsError
        If one is missing or no number.
    """
    found = []
    for name in names:
        # Basalt and others call the angle of the field-of-view model w.
        key = "w" if name == "omega" and name not in values and "w" in values else name
        given = source.value(key, values, where)
        found.append(float(checked_numbers(source.path, f"{where}{key}", given, (1,))[0]))
    return tuple(found)


# ---- EuRoC ---------------------------------------------------------------------------------------
def read_euroc(source: CalibrationSource) -> CameraFile:
    """Read a sensor.yaml; T_BS is the pose of the camera on the vehicle."""
    path, values = source.path, source.values
    lens = lens_of(f"{path}", "camera_model", values.get("camera_model", "pinhole"))
    if lens == PINHOLE:
        model = values.get("distortion_model", "none")
        lens = lens_of(f"{path}", "distortion_model", model)
    size = checked_size(path, source.value("resolution"), "resolution")
    given = checked_numbers(path, "intrinsics", source.value("intrinsics"), ())
    numbers = dict(zip(_PINHOLE, given, strict=False)) if given.size == 4 else {}
    if lens_parameters(lens) is not None and not numbers:
        raise SettingsError(f"{path}: intrinsics must hold 4 numbers; give fx, fy, cx, cy")
    rate = values.get("rate_hz")
    T = None
    if isinstance(place := values.get("T_BS"), Mapping):
        T_BS = checked_pose(path, "T_BS", source.value("data", place, "T_BS."))
        T = inverse_poses(T_BS[None])[0]
    coefficients = values.get("distortion_coefficients", [])
    numbers = numbers | _euroc_lens(source, lens, coefficients)
    camera = named_camera(source, numbers, "", lens, size, coefficients, T_camera_rig=T)
    fps = None if rate is None else float(checked_numbers(path, "rate_hz", rate, (1,))[0])
    return CameraFile((camera,), place_key="T_BS", fps=fps)


def _euroc_lens(source: CalibrationSource, lens: str, coefficients: object) -> dict[str, float]:
    """Name the coefficients of a fisheye lens."""
    names = lens_parameters(lens)
    if not names:
        return {}
    if lens == "kannala_brandt":
        given = kannala_brandt_numbers(source.path, "distortion_coefficients", coefficients)
    elif lens == "fov":
        found = checked_numbers(source.path, "distortion_coefficients", coefficients, (1,))
        given = tuple(found.tolist())
    else:
        raise SettingsError(
            f"{source.path}: a sensor.yaml has no rule for the numbers of the {lens} lens; give "
            "them with orbslam2py settings new --model"
        )
    return dict(zip(names, given, strict=True))


# ---- VINS ----------------------------------------------------------------------------------------
#: What camodocal calls the parameters of fisheye lenses.
_CAMODOCAL = {
    "kannala_brandt": {
        **{"fx": "mu", "fy": "mv", "cx": "u0", "cy": "v0"},
        **{"k1": "k2", "k2": "k3", "k3": "k4", "k4": "k5"},
    },
    "mei": {
        **{"fx": "gamma1", "fy": "gamma2", "cx": "u0", "cy": "v0"},
        **{name: name for name in ("xi", "k1", "k2", "p1", "p2")},
    },
}


def read_vins(source: CalibrationSource) -> CameraFile:
    """Read a camera of camodocal: PINHOLE, PINHOLE_FULL (rational), KANNALA_BRANDT, MEI."""
    lens = lens_of(f"{source.path}", "model_type", source.value("model_type"))
    sides = [source.value("image_width"), source.value("image_height")]
    size = checked_size(source.path, sides, "image_width and image_height")
    numbers: Mapping[str, Any] = {}
    D: Mapping[str, Any] = {}
    if lens in (PINHOLE, *_CAMODOCAL):
        key = "projection_parameters"
        numbers = source.mapping(source.value(key), key)
    if lens in (PINHOLE, "mei"):
        key = "distortion_parameters"
        D = source.mapping(source.values.get(key, {}), key)
    if lens in _CAMODOCAL:
        if lens == "mei":
            key = "mirror_parameters"
            numbers = {**numbers, **D, **source.mapping(source.value(key), key)}
        names = _CAMODOCAL[lens]
        numbers = {ours: source.value(theirs, numbers) for ours, theirs in names.items()}
    camera = named_camera(source, numbers, "", lens, size, in_order(D, *_EIGHT))
    return CameraFile((camera,))


# ---- stella_vslam --------------------------------------------------------------------------------
def read_stella(source: CalibrationSource) -> CameraFile:
    """Read the camera of a configuration of stella_vslam."""
    values = source.mapping(source.value("Camera"), "Camera")
    where = "Camera."
    lens = lens_of(f"{source.path}", "Camera.model", source.value("model", values, where))
    size = None
    if "cols" in values and "rows" in values:
        size = checked_size(source.path, in_order(values, "cols", "rows"), "Camera.cols and rows")
    camera = named_camera(source, values, where, lens, size, in_order(values, *_FIVE))
    fps = values.get("fps")
    rate = None if fps is None else float(checked_numbers(source.path, "Camera.fps", fps, (1,))[0])
    return CameraFile((camera,), fps=rate, rgb=values.get("color_order") == "RGB")


# ---- Basalt --------------------------------------------------------------------------------------
def read_basalt(source: CalibrationSource) -> CameraFile:
    """Read all cameras; T_imu_cam is their pose."""
    path = source.path
    inner = source.mapping(source.value("value0"), "value0")
    intrinsics = source.mappings(source.value("intrinsics", inner, "value0."), "value0.intrinsics")
    sizes, places = (
        listed if isinstance(listed := inner.get(key), list) else []
        for key in ("resolution", "T_imu_cam")
    )
    cameras = []
    for i, one in enumerate(intrinsics):
        where = f"value0.intrinsics[{i}]."
        name = source.value("camera_type", one, where)
        lens = lens_of(f"{path}", f"{where}camera_type", name)
        size = checked_size(path, sizes[i], f"value0.resolution[{i}]") if i < len(sizes) else None
        T = None
        if i < len(places):
            place = f"value0.T_imu_cam[{i}]"
            T = inverse_poses(_pose(source, source.mapping(places[i], place), place)[None])[0]
        numbers = source.mapping(source.value("intrinsics", one, where), f"{where}intrinsics")
        coefficients = in_order(numbers, *_EIGHT)
        cameras.append(
            named_camera(
                source, numbers, f"cam{i}.", lens, size, coefficients, number=i, T_camera_rig=T
            )
        )
    pairs = both_ways([camera.number for camera in cameras])
    return CameraFile(tuple(cameras), prefix="cam", pairs=pairs, place_key="T_imu_cam")


def _pose(source: CalibrationSource, values: Mapping[str, Any], where: str) -> FloatArray:
    t, q = (
        checked_numbers(
            source.path,
            where,
            [source.value(key, values, f"{where}.") for key in keys],
            (len(keys),),
        )
        for keys in (("px", "py", "pz"), ("qx", "qy", "qz", "qw"))
    )
    norm = float(np.linalg.norm(q))
    if abs(norm - 1) > 1e-2:
        raise SettingsError(
            f"{source.path}: {where} has a quaternion of length {norm:.3g}; give one of length 1"
        )
    return pose_of_parts(source.path, where, rotations_from_quaternions(q[None] / norm)[0], t)


# ---- Fisheye-Calib-Adapter -----------------------------------------------------------------------
def read_fca(source: CalibrationSource) -> CameraFile:
    """Read a camera of the Fisheye-Calib-Adapter, whose keys determine the lens model."""
    image = source.mapping(source.value("image"), "image")
    sides = [source.value(side, image, "image.") for side in ("width", "height")]
    values = source.mapping(source.value("parameter"), "parameter")
    size = checked_size(source.path, sides)
    lens = lens_by_keys(values)
    if lens == PINHOLE and "alpha" in values:
        lens = UNIFIED
    where = "parameter."
    camera = named_camera(source, values, where, lens, size, in_order(values, *_FIVE))
    return CameraFile((camera,))


def lens_by_keys(values: Mapping[str, Any]) -> str:
    """Return the lens model that has parameters of these names."""
    if "alpha" in values and ("xi" in values or "beta" in values):
        return "double_sphere" if "xi" in values else "eucm"
    if "xi" in values:
        return "mei"
    if "omega" in values:
        return "fov"
    if "k4" in values and not {"p1", "p2", "k5"} & set(values):
        return "kannala_brandt"
    return PINHOLE
