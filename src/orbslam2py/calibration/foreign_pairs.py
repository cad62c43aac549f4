# SPDX-License-Identifier: BSD-3-Clause
"""Settings of a stereo pair in calibration files of other programs."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import camera_settings
from orbslam2py.calibration.foreign_cameras import CameraFile, ForeignCamera
from orbslam2py.calibration.lenses import PINHOLE, UNIFIED
from orbslam2py.errors import SettingsError
from orbslam2py.settings import (
    CameraRectification,
    CameraSettings,
    OrbSettings,
    Sensor,
    Settings,
    StereoRectification,
    builtin_settings,
    settings_for_camera,
)
from orbslam2py.settings.defaults import usual_n_features
from orbslam2py.settings.pair_cameras import PairCameras, cameras_of_pair
from orbslam2py.settings.pair_views import compare_views

#: Part of the views that overlaps below which cameras see nothing together.
_NO_OVERLAP = 0.02


@dataclass(frozen=True)
class Pair:
    """Two cameras that are to become a pair.

    Attributes
    ----------
    where
        The file or the files, for messages.
    file
        Contents of the file of the left camera.
    left, right
        The cameras.
    alone
        How to take one of them, for messages.
    """

    where: str
    file: CameraFile
    left: ForeignCamera
    right: ForeignCamera
    alone: str

    @property
    def names(self) -> str:
        """Both cameras."""
        return f"{self.left.name} and {self.right.name}"

    @property
    def may_be_exchanged(self) -> bool:
        """Whether ``--camera`` can make the right one the left one."""
        return (self.right.number, self.left.number) in self.file.pairs


def pair_settings(pair: Pair, fps: float) -> Settings:
    """Make settings of a pair: rectified already, with its rectification, or of fisheye cameras.

    Parameters
    ----------
    pair
        The cameras, with supported lenses.
    fps
        Images per second.

    Raises
    ------
    SettingsError
        If the cameras do not make a pair, or the file does not contain their relative pose.
    """
    if pair.file.rectified:
        return _rectified_pair(pair, fps)
    size = _common_size(pair)
    if pair.left.P is not None and pair.right.P is not None and not _is_fisheye_pair(pair):
        found = _of_given_rectification(pair, size, fps)
    else:
        found = _found_pair(pair, size, fps)
    return Settings(
        sensor=Sensor.STEREO,
        **found.fields,
        orb=OrbSettings(n_features=usual_n_features(*size)),
        depth=builtin_settings("euroc", Sensor.STEREO).depth,
    )


def _is_fisheye_pair(pair: Pair) -> bool:
    return any(one.lens != PINHOLE for one in (pair.left, pair.right))


def _of_given_rectification(pair: Pair, size: tuple[int, int], fps: float) -> PairCameras:
    rectification = _given_rectification(pair, size)
    P, P_right = rectification.left.P, rectification.right.P
    camera = CameraSettings(
        fx=float(P[0, 0]),
        fy=float(P[1, 1]),
        cx=float(P[0, 2]),
        cy=float(P[1, 2]),
        width=size[0],
        height=size[1],
        fps=fps,
        bf=-float(P_right[0, 3]),
    )
    return PairCameras(camera, rectification=rectification)


def raw_camera(one: ForeignCamera, fps: float, *, rgb: bool = False) -> CameraSettings:
    """Make the settings of a camera as it is, with its lens."""
    assert one.K is not None
    model, lens = one.lens, one.lens_numbers
    if model == UNIFIED:
        model, lens = "eucm", (*lens, 1.0)
    return camera_settings(
        one.K, one.distortion, one.size, fps=fps, rgb=rgb, model=model, lens=lens
    )


def _rectified_pair(pair: Pair, fps: float) -> Settings:
    P, P_right = pair.left.P, pair.right.P
    assert P is not None
    assert P_right is not None
    bf = float(P[0, 3] - P_right[0, 3])
    if bf <= 0:
        raise SettingsError(
            f"{pair.where}: {pair.right.name} does not stand to the right of {pair.left.name}; "
            "give --camera with the left camera of a pair"
        )
    width, height = pair.left.size or (None, None)
    camera = CameraSettings(
        fx=float(P[0, 0]),
        fy=float(P[1, 1]),
        cx=float(P[0, 2]),
        cy=float(P[1, 2]),
        width=width,
        height=height,
        fps=fps,
        bf=bf,
        rgb=pair.file.rgb,
    )
    return settings_for_camera(camera, Sensor.STEREO)


def _common_size(pair: Pair) -> tuple[int, int]:
    left, right = pair.left.size, pair.right.size
    if left is None or right is None:
        K = pair.left.K
        assert K is not None
        about = f"{round(2 * K[0, 2] + 1)}x{round(2 * K[1, 2] + 1)}"
        raise SettingsError(
            f"{pair.where} does not contain the size of the images, which a pair needs; give it "
            f"with --size WIDTHxHEIGHT (by the principal point about {about}), or {pair.alone}"
        )
    if left != right:
        raise SettingsError(
            f"{pair.where}: the cameras of a pair must have the same resolution, and {pair.names} "
            f"have {left[0]} x {left[1]} and {right[0]} x {right[1]} pixels; calibrate them so, or "
            f"{pair.alone}"
        )
    return left


# ---- rectification -------------------------------------------------------------------------------
def _found_pair(pair: Pair, size: tuple[int, int], fps: float) -> PairCameras:
    left, right, key = pair.left, pair.right, pair.file.place_key
    assert left.K is not None
    assert right.K is not None
    if left.T_camera_rig is None or right.T_camera_rig is None:
        raise SettingsError(
            f"{pair.where} does not tell how {pair.names} stand to each other; add {key}, or "
            f"{pair.alone}"
        )
    for camera, K in ((left, left.K), (right, right.K)):
        _require_centre_inside(pair.where, camera.name, K, size)
    T = right.T_camera_rig @ np.linalg.inv(left.T_camera_rig)
    if not _is_fisheye_pair(pair):
        _require_overlap(pair, (left.K, right.K), size, T[:3, :3])
    _require_side_by_side(pair, T)
    try:
        first, second = (raw_camera(one, fps) for one in (left, right))
        return cameras_of_pair(first, second, T, size, key)
    except SettingsError as error:
        raise SettingsError(
            f"{pair.where}: the pair cannot be rectified ({error}); look at intrinsics, distortion "
            f"and {key}, or {pair.alone}"
        ) from error


def _require_centre_inside(where: str, name: str, K: FloatArray, size: tuple[int, int]) -> None:
    """Refuse a camera of a pair whose images would be zoomed in on a place outside of them."""
    cx, cy = float(K[0, 2]), float(K[1, 2])
    if not (0 <= cx < size[0] and 0 <= cy < size[1]):
        raise SettingsError(
            f"{where}: {name} has its centre at {cx:g}, {cy:g}, outside of its images of {size[0]} "
            f"x {size[1]} pixels; give the intrinsics and the size of the same images"
        )


def _require_overlap(
    pair: Pair, K: tuple[FloatArray, FloatArray], size: tuple[int, int], R: FloatArray
) -> None:
    views = compare_views((K[0], size), (K[1], size), R)
    if views.overlap < _NO_OVERLAP:
        raise SettingsError(
            f"{pair.where}: {pair.names} are turned by {views.turned:.0f} degrees against each "
            "other, so they see nothing together, and stereo has no depth; "
            f"{pair.alone}"
        )


def _require_side_by_side(pair: Pair, T: FloatArray) -> None:
    """Refuse a right camera that stands elsewhere, seen in the middle of both directions."""
    if not T[:3, 3].any():
        raise SettingsError(
            f"{pair.where}: the pair cannot be rectified, because {pair.names} have the same "
            f"position, so they measure no depth; check {pair.file.place_key}, or {pair.alone}"
        )
    half = cv2.Rodrigues(np.asarray(cv2.Rodrigues(T[:3, :3])[0]) / -2)[0]
    x, y, z = (-np.asarray(half) @ T[:3, 3]).tolist()
    if x > 0 and x >= max(abs(y), abs(z)):
        return
    if x < 0 and -x >= max(abs(y), abs(z)):
        side = "to the left of it"
        remedy = f"exchange the two files, or invert {pair.file.place_key} if it is the inverse"
        if pair.may_be_exchanged:
            remedy = (
                f"give --camera {pair.right.number} --sensor stereo, and take the images of "
                f"{pair.right.name} as the left ones; or invert {pair.file.place_key} if it is the "
                "inverse"
            )
    else:
        side = ("below it" if y > 0 else "above it") if abs(y) >= abs(z) else "before or behind it"
        remedy = f"stereo needs cameras side by side: {pair.alone}"
    raise SettingsError(
        f"{pair.where}: {pair.right.name} does not stand to the right of {pair.left.name}, but "
        f"{math.dist((0, 0, 0), (x, y, z)):.3g} m {side}; {remedy}"
    )


def _given_rectification(pair: Pair, size: tuple[int, int]) -> StereoRectification:
    """Take the rectification that ROS has found."""
    cameras = []
    for camera in (pair.left, pair.right):
        assert camera.K is not None
        assert camera.P is not None
        R = np.eye(3) if camera.R is None else camera.R
        cameras.append(
            CameraRectification(
                K=camera.K, D=camera.distortion, R=R, P=camera.P, width=size[0], height=size[1]
            )
        )
    left, right = cameras
    _require_overlap(pair, (left.K, right.K), size, right.R.T @ left.R)
    if np.abs(left.P[:, :3] - right.P[:, :3]).max() > 1e-3 or abs(left.P[0, 3]) > 1e-6:
        raise SettingsError(
            f"{pair.where} are no rectified pair: their {pair.file.place_key} must be equal but "
            "for the last column, which is 0 for the left camera; calibrate both together"
        )
    right_of, below = -float(right.P[0, 3]), -float(right.P[1, 3])
    if right_of <= 0 or abs(below) > 1e-3 * right_of:
        remedy = "exchange the two files" if right_of < 0 else "calibrate both together, as a pair"
        raise SettingsError(
            f"{pair.where}: the second camera must stand to the right of the first; as it is, the "
            f"{pair.file.place_key} is shifted by {-right_of:g}, {-below:g} pixel metres; {remedy}"
        )
    return StereoRectification(left=left, right=right)
