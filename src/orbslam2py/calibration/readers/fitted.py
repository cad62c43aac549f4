# SPDX-License-Identifier: BSD-3-Clause
"""Lenses of other models, to which one of ours is fitted: WoodScape's polynomial, and Aria's.

S. Yogamani et al., "WoodScape: a multi-task, multi-camera fisheye dataset for autonomous driving",
ICCV 2019; "Camera intrinsic models" in the documentation of Project Aria (FISHEYE624).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import checked_numbers, checked_size, pose_of_parts
from orbslam2py.calibration.families import LensFit, fit_lens
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    both_ways,
)
from orbslam2py.errors import SettingsError
from orbslam2py.trajectory.rotations import inverse_poses

#: Models that are tried; those with four coefficients or more come close to any smooth lens.
_FITTED = ("kannala_brandt", "mei", "double_sphere", "eucm")
#: Worse fits than this are refused [pixels, root mean square].
_MOST_RMS = 1.0
_MOST_ANGLE, _N_ANGLES, _N_AROUND = np.radians(115.0), 120, 72

#: Pixels (n, 2) of rays (n, 3).
Projection = Callable[[FloatArray], FloatArray]


def _rays() -> tuple[FloatArray, FloatArray]:
    """Directions over a wide field, angle by angle (a, b, 3), and their angles from the axis."""
    angle = np.linspace(0.002, _MOST_ANGLE, _N_ANGLES)
    around = np.linspace(0, 2 * np.pi, _N_AROUND, endpoint=False)
    sine = np.sin(angle)[:, None]
    x, y = sine * np.cos(around), sine * np.sin(around)
    return np.stack([x, y, np.broadcast_to(np.cos(angle)[:, None], x.shape)], axis=2), angle


def fitted_camera(
    where: str,
    name: str,
    number: int,
    project: Projection,
    size: tuple[int, int],
    T_camera_rig: FloatArray | None = None,
) -> tuple[ForeignCamera, str]:
    """Fit one of our lenses to a projection, where it shows something in the image.

    Returns
    -------
    ForeignCamera
        With the lens of least error.
    str
        How well it fits.

    Raises
    ------
    SettingsError
        If none of our lenses comes close.
    """
    grid, angles = _rays()
    pixels = project(grid.reshape(-1, 3)).reshape(*grid.shape[:2], 2)
    centre = pixels[0].mean(axis=0)
    radius = np.linalg.norm(pixels - centre, axis=2).mean(axis=1)
    # Beyond the angle at which the radius shrinks the polynomial says nothing.
    rising = np.cumprod(np.diff(radius, prepend=0.0) > 0).astype(bool)
    inside = ((pixels >= -0.5) & (pixels < np.array(size) - 0.5)).all(axis=2) & rising[:, None]
    if inside.sum() < _N_AROUND:
        raise SettingsError(
            f"{where} shows next to nothing in images of {size[0]} x {size[1]} pixels; give the "
            "size that was calibrated with --size"
        )
    rays, seen = grid[inside], pixels[inside]
    focal = float(radius[1] - radius[0]) / float(angles[1] - angles[0])
    fits = [_fit(family, rays, seen, size, focal, centre) for family in _FITTED]
    best = min((one for one in fits if one is not None), key=lambda one: one.rms, default=None)
    if best is None or not best.rms <= _MOST_RMS:
        error = "none shows all of it" if best is None else f"{best.rms:.2f} pixels at best"
        raise SettingsError(
            f"{where} has a lens that none of our models fits ({error}); calibrate the camera with "
            "orbslam2py calibrate, which chooses a model"
        )
    return _camera(best, name, number, T_camera_rig), _quality(name, best, rays, seen)


def _fit(
    family: str,
    rays: FloatArray,
    pixels: FloatArray,
    size: tuple[int, int],
    focal: float,
    centre: FloatArray,
) -> LensFit | None:
    try:
        middle = float(centre[0]), float(centre[1])
        return fit_lens(family, rays, pixels, size, (focal, focal), middle)
    except SettingsError:
        return None


def _camera(fit: LensFit, name: str, number: int, T_camera_rig: FloatArray | None) -> ForeignCamera:
    fx, fy, cx, cy, *lens = fit.camera.parameters
    return ForeignCamera(
        name,
        number,
        np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]),
        NO_DISTORTION,
        fit.camera.image_size,
        fit.camera.name,
        T_camera_rig,
        lens_numbers=tuple(lens),
    )


def _quality(name: str, fit: LensFit, rays: FloatArray, pixels: FloatArray) -> str:
    errors = np.linalg.norm(fit.camera.project(rays) - pixels, axis=1)
    found = fit.camera.unproject(pixels)
    angles = np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(found - rays, axis=1) / 2, 0, 1)))
    widest = np.degrees(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2]).max())
    return (
        f"the lens of {name} is fitted by {fit.camera.name}: {fit.rms:.3f} pixels (RMS), at most "
        f"{errors.max():.2f} pixels or {np.nanmax(angles):.3f} degrees, up to {widest:.0f} degrees "
        "from the axis"
    )


# ---- WoodScape -----------------------------------------------------------------------------------
def read_woodscape(source: CalibrationSource) -> CameraFile:
    """Read a camera of WoodScape: the radius in pixels is a polynomial of the angle."""
    path = source.path
    values = source.mapping(source.value("intrinsic"), "intrinsic")

    def number(key: str) -> float:
        given = source.value(key, values, "intrinsic.")
        return float(checked_numbers(path, f"intrinsic.{key}", given, (1,))[0])

    size = checked_size(path, [number("width"), number("height")], "intrinsic.width and height")
    coefficients = [number(f"k{power}") for power in range(1, 5)]
    aspect = number("aspect_ratio") if "aspect_ratio" in values else 1.0
    # The centre of the image is half a pixel before half of its size.
    centre = np.array(
        [number("cx_offset") + size[0] / 2 - 0.5, number("cy_offset") + size[1] / 2 - 0.5]
    )

    def project(rays: FloatArray) -> FloatArray:
        r = np.hypot(rays[:, 0], rays[:, 1])
        angle = np.arctan2(r, rays[:, 2])
        radius = sum(k * angle**power for power, k in enumerate(coefficients, start=1))
        along = rays[:, :2] / r[:, None] * np.asarray(radius)[:, None]
        return np.asarray(along * (1.0, aspect) + centre)

    name = str(source.values.get("name", "the camera"))
    camera, note = fitted_camera(f"{path}: {name}", name, 0, project, size)
    return CameraFile((camera,), note=note)


# ---- Project Aria --------------------------------------------------------------------------------
#: f, cx, cy, k0 to k5, p0, p1, s0 to s3; or fx and fy in place of f.
_ARIA_COUNTS = (15, 16)
_ARIA_MODELS = ("FisheyeRadTanThinPrism", "Fisheye624")


def read_aria(source: CalibrationSource) -> CameraFile:
    """Read the cameras of a calibration of Project Aria; the size of the images is to be given."""
    listed = source.mappings(source.value("CameraCalibrations"), "CameraCalibrations")
    if source.size is None:
        raise SettingsError(
            f"{source.path} is a calibration of Project Aria, which does not contain the size "
            "of the images; give it with --size WIDTHxHEIGHT"
        )
    cameras, notes = [], []
    for number, values in enumerate(listed):
        camera, note = _aria_camera(source, number, values, source.size)
        cameras.append(camera)
        notes.append(note)
    return CameraFile(
        tuple(cameras),
        prefix="camera ",
        pairs=both_ways(list(range(len(cameras)))),
        place_key="T_Device_Camera",
        note="; ".join(notes),
    )


def _aria_camera(
    source: CalibrationSource, number: int, values: Mapping[str, Any], size: tuple[int, int]
) -> tuple[ForeignCamera, str]:
    where = f"CameraCalibrations[{number}]"
    projection = source.mapping(
        source.value("Projection", values, f"{where}."), f"{where}.Projection"
    )
    model = source.value("Name", projection, f"{where}.Projection.")
    if model not in _ARIA_MODELS:
        raise SettingsError(
            f"{source.path}: {where}.Projection.Name is {model}; allowed: {', '.join(_ARIA_MODELS)}"
        )
    given = source.value("Params", projection, f"{where}.Projection.")
    params = checked_numbers(source.path, f"{where}.Projection.Params", given, _ARIA_COUNTS)
    fx, *rest = params.tolist()
    fy = rest.pop(0) if params.size == max(_ARIA_COUNTS) else fx
    name = str(values.get("Label", f"camera {number}"))
    T = _aria_pose(source, where, values.get("T_Device_Camera"))
    project = fisheye624((fx, fy, rest[0], rest[1]), np.array(rest[2:]))
    return fitted_camera(f"{source.path}: {name}", name, number, project, size, T)


def fisheye624(plane: tuple[float, float, float, float], lens: FloatArray) -> Projection:
    """Aria's projection: fx, fy, cx, cy [pixels] and k0 to k5, p0, p1, s0 to s3, (12,)."""
    k, p, s = lens[:6], lens[6:8], lens[8:12]

    def project(rays: FloatArray) -> FloatArray:
        r = np.hypot(rays[:, 0], rays[:, 1])
        angle = np.arctan2(r, rays[:, 2])
        radius = angle * (1 + sum(k[i] * angle ** (2 * i + 2) for i in range(6)))
        x, y = (rays[:, :2] / r[:, None] * radius[:, None]).T
        r2 = x * x + y * y
        u = x + p[0] * (2 * x * x + r2) + 2 * p[1] * x * y + s[0] * r2 + s[1] * r2 * r2
        v = y + p[1] * (2 * y * y + r2) + 2 * p[0] * x * y + s[2] * r2 + s[3] * r2 * r2
        return np.stack([plane[0] * u + plane[2], plane[1] * v + plane[3]], axis=1)

    return project


def _aria_pose(source: CalibrationSource, where: str, value: object) -> FloatArray | None:
    if not isinstance(value, Mapping):
        return None
    key = f"{where}.T_Device_Camera"
    t = source.value("Translation", value, f"{key}.")
    quaternion = source.value("UnitQuaternion", value, f"{key}.")
    try:
        w, vector = quaternion
        q = checked_numbers(source.path, f"{key}.UnitQuaternion", [w, *vector], (4,))
    except (TypeError, ValueError):
        raise SettingsError(
            f"{source.path}: {key}.UnitQuaternion must be [w, [x, y, z]], found {quaternion!r}"
        ) from None
    length = float(np.linalg.norm(q))
    if not 0.99 < length < 1.01:
        raise SettingsError(f"{source.path}: {key}.UnitQuaternion has the length {length:g}, not 1")
    axis, sine = q[1:] / length, float(np.linalg.norm(q[1:]) / length)
    angle = 2 * float(np.arctan2(sine, q[0] / length))
    turn = axis / sine * angle if sine > 0 else np.zeros(3)
    T = pose_of_parts(source.path, key, cv2.Rodrigues(turn)[0], t)
    return np.asarray(inverse_poses(T[None])[0])
