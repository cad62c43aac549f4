# SPDX-License-Identifier: BSD-3-Clause
"""How two calibrated cameras are used as a pair: rectified or unrectified.

A fisheye image is rectified by stretching it to a plane. At the angle t from the optical axis a
pixel becomes 1 / cos(t)^2 times as long as in the middle. Pairs whose borders would be stretched by
more than 3, which is 55 degrees from the axis, are matched without rectification. Pinhole models
are always rectified: their images are nearly planes already.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.camera_model import CameraModel
from orbslam2py.settings.extrinsics import checked_extrinsics, inverse_of
from orbslam2py.settings.groups import (
    CameraRectification,
    CameraSettings,
    StereoRectification,
)
from orbslam2py.settings.rectify import rectification_of_pair
from orbslam2py.settings.right_camera import RightCamera

#: Most stretching of a fisheye image, at the middle of its borders and along the radius.
MOST_STRETCH = 3.0
_SAMPLES = 60
_INTRINSICS = ("fx", "fy", "cx", "cy")

_Two = tuple[CameraModel, CameraModel]


@dataclass(frozen=True)
class PairCameras:
    """What settings hold of a raw pair.

    Attributes
    ----------
    camera
        The camera that is tracked: the rectified one, or the left fisheye camera; with its bf.
    rectification
        How the images are rectified; None for a fisheye pair.
    right
        The right camera of a fisheye pair, else None.
    """

    camera: CameraSettings
    rectification: StereoRectification | None = None
    right: RightCamera | None = None

    @property
    def fields(self) -> dict[str, Any]:
        """As arguments of `Settings`."""
        return {
            "camera": self.camera,
            "rectification": self.rectification,
            "right": self.right,
        }


def cameras_of_pair(
    left: CameraSettings,
    right: CameraSettings,
    T_right_left: FloatArray,
    size: tuple[int, int],
    name: str = "T_right_left",
) -> PairCameras:
    """Decide how a raw pair is used.

    Parameters
    ----------
    left, right
        Both unrectified cameras; the rate and the colour order are those of the left one.
    T_right_left
        From left to right camera coordinates, (4, 4), metres.
    size
        Width and height of the images, pixels.
    name
        Name of the transform in the calibration, for messages.

    Raises
    ------
    SettingsError
        If the transform is not rigid, the right camera stands to the left, or the cameras look
        different ways.
    """
    T = checked_extrinsics(T_right_left, name)
    models = left.camera_model(*size), right.camera_model(*size)
    whole = replace(left, width=size[0], height=size[1])
    if not (left.is_fisheye or right.is_fisheye):
        found = rectification_of_pair(
            (left.matrix, right.matrix), (left.distortion, right.distortion), T, size
        )
        return _rectified(whole, found)
    rotations = _rectifying_rotations(T)
    _require_side_by_side(np.asarray(rotations[1] @ T[:3, 3]), name)
    if max(map(_stretch, models, rotations)) > MOST_STRETCH:
        second = RightCamera(replace(right, width=size[0], height=size[1]), inverse_of(T))
        bf = second.baseline * whole.pixels_per_radian
        return PairCameras(replace(whole, bf=bf), right=second)
    return _rectified(whole, _rectification_of_models(models, rotations, T, size))


def _rectified(raw: CameraSettings, pair: StereoRectification) -> PairCameras:
    P = pair.left.P
    camera = CameraSettings(
        fx=float(P[0, 0]),
        fy=float(P[1, 1]),
        cx=float(P[0, 2]),
        cy=float(P[1, 2]),
        width=raw.width,
        height=raw.height,
        fps=raw.fps,
        bf=max(0.0, -float(pair.right.P[0, 3])),
        rgb=raw.rgb,
    )
    return PairCameras(camera, rectification=pair)


def _rectifying_rotations(T: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotations from raw to rectified coordinates; they do not depend on the intrinsics."""
    K = np.array([[100.0, 0.0, 50.0], [0.0, 100.0, 50.0], [0.0, 0.0, 1.0]])
    R_left, R_right, *_ = cv2.stereoRectify(
        cameraMatrix1=K,
        distCoeffs1=np.zeros(4),
        cameraMatrix2=K,
        distCoeffs2=np.zeros(4),
        imageSize=(100, 100),
        R=np.ascontiguousarray(T[:3, :3]),
        T=np.ascontiguousarray(T[:3, 3:]),
    )
    return np.asarray(R_left, np.float64), np.asarray(R_right, np.float64)


def _require_side_by_side(shift: FloatArray, name: str) -> None:
    """Refuse a right camera that stands elsewhere; `shift` is in rectified coordinates."""
    x, y, _ = shift.tolist()
    if abs(y) > abs(x):
        raise SettingsError(
            f"by {name} the cameras stand one above the other, and a pair must stand side by side; "
            "turn the images by 90 degrees and calibrate these, or use one camera (--sensor mono)"
        )
    if x >= 0:
        raise SettingsError(
            f"by {name} the right camera stands {x:.3g} m to the left of the left one; exchange "
            "left and right, or take the inverse of the transform"
        )


def _stretch(model: CameraModel, R: FloatArray) -> float:
    """How much longer a pixel at a border becomes on the rectified plane than one in the middle."""
    if model.name in ("pinhole", "radtan4", "radtan5", "rational", "thin_prism"):
        return 1.0
    width, height = model.image_size
    cx, cy = model.parameters[2:4]
    rays = model.unproject([[0, cy], [width - 1, cy], [cx, 0], [cx, height - 1]])
    along = (rays @ R.T)[:, 2]
    # Where a border shows nothing the circle of a fisheye lens ends before it.
    if not (along > 0).all():
        return float("inf")
    return float(np.max(1 / along**2))


def _rectification_of_models(
    models: _Two, rotations: tuple[FloatArray, FloatArray], T: FloatArray, size: tuple[int, int]
) -> StereoRectification:
    """Rectify to the largest common rectangle that both images fill."""
    x0, x1, y0, y1 = _common_rectangle(models, rotations)
    if not (x1 > x0 and y1 > y0):
        raise SettingsError(
            "the two cameras look different ways, so their images have no common part; use one of "
            "them (--sensor mono)"
        )
    width, height = size
    f = max((width - 1) / (x1 - x0), (height - 1) / (y1 - y0))
    centre = [(n - 1 - f * s) / 2 for n, s in ((width, x0 + x1), (height, y0 + y1))]
    shifts = 0.0, f * float((rotations[1] @ T[:3, 3])[0])
    sides = []
    for model, R, shift in zip(models, rotations, shifts, strict=True):
        P = np.array([[f, 0, centre[0], shift], [0, f, centre[1], 0], [0, 0, 1, 0]])
        fx, fy, cx, cy = model.parameters[:4]
        sides.append(
            CameraRectification(
                K=np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]),
                D=np.array(model.parameters[4:] if len(model.parameters) > 4 else np.zeros(4)),
                R=R,
                P=P,
                width=width,
                height=height,
                model=model.name,
            )
        )
    return StereoRectification(*sides)


def _common_rectangle(
    models: _Two, rotations: tuple[FloatArray, FloatArray]
) -> tuple[float, float, float, float]:
    """Left, right, upper and lower end of the common view, on the plane at distance 1."""
    ends = []
    for model, R in zip(models, rotations, strict=True):
        width, height = model.image_size
        u, v = np.linspace(0, width - 1, _SAMPLES), np.linspace(0, height - 1, _SAMPLES)
        borders = (
            np.stack([np.zeros_like(v), v], 1),
            np.stack([np.full_like(v, width - 1), v], 1),
            np.stack([u, np.zeros_like(u)], 1),
            np.stack([u, np.full_like(u, height - 1)], 1),
        )
        planes = []
        for border in borders:
            rays = model.unproject(border) @ R.T
            # Corners may be dark, and then the rest of the border counts.
            planes.append(rays[:, :2] / np.where(rays[:, 2:] > 0, rays[:, 2:], np.nan))
        ends.append(
            (
                np.nanmax(planes[0][:, 0]),
                np.nanmin(planes[1][:, 0]),
                np.nanmax(planes[2][:, 1]),
                np.nanmin(planes[3][:, 1]),
            )
        )
    (a0, a1, b0, b1), (c0, c1, d0, d1) = ends
    return float(max(a0, c0)), float(min(a1, c1)), float(max(b0, d0)), float(min(b1, d1))
