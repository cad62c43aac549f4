# SPDX-License-Identifier: BSD-3-Clause
"""Families of lenses that are calibrated: their names, and the member that fits given rays best."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from orbslam2py import _core
from orbslam2py._arguments import shown
from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.bundle import parameter_jacobian, rms_of, with_parameters
from orbslam2py.errors import SettingsError
from orbslam2py.settings.camera_model import CameraModel

#: Lenses whose images OpenCV undistorts to a pinhole, those with fewer parameters first.
PERSPECTIVE = ("pinhole", "radtan4", "radtan5", "rational")
#: Lenses that may see 180 degrees, those that most programs read first.
WIDE = ("kannala_brandt", "eucm", "double_sphere", "mei", "fov")
#: Only calibrated if it is asked for: many views are needed to determine its 16 parameters.
FAMILIES = (*PERSPECTIVE, *WIDE, "thin_prism")
#: Names of the number of coefficients of OpenCV's models.
OPENCV_FAMILIES = (*PERSPECTIVE, "thin_prism")

#: Where the search for the parameters after fx, fy, cx, cy begins, and the focal length per pixels
#: per radian in the middle that belongs to these.
_STARTS: dict[str, tuple[tuple[tuple[float, ...], float], ...]] = {
    "pinhole": (((), 1.0),),
    "radtan4": (((0.0,) * 4, 1.0), ((-0.25, 0.05, 0.0, 0.0), 1.0)),
    "radtan5": (((0.0,) * 5, 1.0), ((-0.25, 0.05, 0.0, 0.0, 0.0), 1.0)),
    "rational": (((0.0,) * 8, 1.0), ((0.0, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0, 0.0), 1.0)),
    "thin_prism": (((0.0,) * 12, 1.0), ((0.0,) * 5 + (0.3,) + (0.0,) * 6, 1.0)),
    "kannala_brandt": (((0.0,) * 4, 1.0),),
    "double_sphere": (((-0.2, 0.6), 0.8), ((0.0, 0.5), 1.0), ((0.3, 0.6), 1.3)),
    "eucm": (((0.6, 1.1), 1.0), ((0.3, 1.0), 1.0), ((0.8, 0.6), 1.0)),
    "mei": (((1.0, 0.0, 0.0, 0.0, 0.0), 2.0), ((0.3, 0.0, 0.0, 0.0, 0.0), 1.3)),
    "fov": (((0.9,), 0.9 / (2 * np.tan(0.45))), ((0.3,), 0.3 / (2 * np.tan(0.15)))),
}
#: Coefficients of OpenCV's models without a denominator: k1, k2, p1, p2, k3.
_RADIAL_TANGENTIAL = 5
_ITERATIONS = 25
#: Points farther from the axis than this are left to the wide lenses at first.
_STEEP = np.radians(80.0)


class LensFit(NamedTuple):
    """A lens and how well it shows given rays.

    Attributes
    ----------
    camera
        The camera.
    rms
        Root mean square of the distances [pixels]; infinite if it cannot show all of the rays.
    """

    camera: CameraModel
    rms: float


def family_of(name: str) -> str:
    """Take the name of a family, or another program's name of it.

    Raises
    ------
    SettingsError
        If there is no such family.
    """
    if isinstance(name, str):
        for own, aliases, _ in _core.camera_models():
            if name.lower() in (own, *(alias.lower() for alias in aliases)):
                return own
    raise SettingsError(f"the lens model is {shown(name)}; give one of {', '.join(FAMILIES)}")


def wanted_family(model: str | None, *, k3: bool = False) -> str | None:
    """Return the family of lenses that was asked for, or None for the best one."""
    family = None if model is None else family_of(model)
    if k3 and family not in (None, "radtan5"):
        raise SettingsError(f"k3 goes with the model radtan5, not with {family}; leave k3 out")
    return "radtan5" if k3 else family


def padded(camera: CameraModel, values: FloatArray) -> FloatArray:
    """Fill up what models of the radial-tangential lens lack, with zeros."""
    if camera.name not in ("pinhole", "radtan4", "radtan5"):
        return values
    return np.concatenate([values, np.zeros(4 + _RADIAL_TANGENTIAL - len(values))])


def fit_lens(
    family: str,
    rays: FloatArray,
    pixels: FloatArray,
    size: tuple[int, int],
    focal: tuple[float, float],
    centre: tuple[float, float],
) -> LensFit:
    """Find the lens of a family that shows rays at their pixels.

    Parameters
    ----------
    family
        One of `FAMILIES`.
    rays
        Directions in the camera frame, (n, 3).
    pixels
        Where they are seen, (n, 2).
    size
        Width and height of the images [pixels].
    focal
        Pixels per radian in the middle of the image, in x and y.
    centre
        About where the optical axis is seen [pixels].

    Raises
    ------
    SettingsError
        If no lens of the family shows any of it.
    """
    angles = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    near = angles < _STEEP if family in OPENCV_FAMILIES else np.ones(len(rays), bool)
    best: LensFit | None = None
    for lens, slope in _STARTS[family]:
        begin = (slope * focal[0], slope * focal[1], *centre, *lens)
        found = _fit(CameraModel(family, begin, size), rays, pixels, near)
        if found is not None and (best is None or found.rms < best.rms):
            best = found
    if best is None:
        raise SettingsError(f"no {family} lens shows these rays")
    return best


def _fit(
    camera: CameraModel, rays: FloatArray, pixels: FloatArray, near: np.ndarray
) -> LensFit | None:
    """Levenberg-Marquardt over the intrinsics."""
    used = near & np.isfinite(camera.project(rays)).all(axis=1)
    if used.sum() < len(camera.parameters):
        return None
    some, seen = rays[used], pixels[used]
    cost, damping = float(((seen - camera.project(some)) ** 2).sum()), 1e-3
    for _ in range(_ITERATIONS):
        shown = camera.project(some)
        J = parameter_jacobian(camera, some, shown).reshape(-1, len(camera.parameters))
        r = (seen - shown).ravel()
        A = J.T @ J
        A += np.diag(damping * np.maximum(np.diag(A), 1e-9))
        try:
            tried = with_parameters(
                camera, np.array(camera.parameters) + np.linalg.solve(A, J.T @ r)
            )
        except (np.linalg.LinAlgError, SettingsError):
            damping *= 10
            continue
        new_cost = float(((seen - tried.project(some)) ** 2).sum())
        if not new_cost < cost:
            damping *= 10
            if damping > 1e8:
                break
            continue
        done = cost - new_cost < 1e-6 * cost
        camera, cost, damping = tried, new_cost, max(damping / 10, 1e-12)
        if done:
            break
    return LensFit(camera, rms_of(pixels - camera.project(rays)))
