# SPDX-License-Identifier: BSD-3-Clause
"""The rectification of a calibrated stereo pair."""

from __future__ import annotations

import cv2
import numpy as np

from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.groups import CameraRectification, StereoRectification


def rectification_of_pair(
    K: tuple[FloatArray, FloatArray],
    D: tuple[FloatArray, FloatArray],
    T_right_left: FloatArray,
    size: tuple[int, int],
) -> StereoRectification:
    """Compute the rectification of a calibrated pair.

    Both principal points become equal (zero disparity at infinity), and the images are scaled until
    there is no black border (OpenCV's alpha 0).

    Parameters
    ----------
    K, D
        Camera matrices (3, 3) [pixels] and distortion coefficients of the left and right camera.
    T_right_left
        Transform (4, 4) from left to right camera coordinates [m].
    size
        Width and height of the images [pixels].

    Raises
    ------
    SettingsError
        If the baseline is 0, or there is no rectification.
    """
    if not np.any(T_right_left[:3, 3]):
        raise SettingsError(
            "the two cameras of the pair have the same position, so they measure no depth; "
            "check where their calibration puts them, or use one of them (--sensor mono)"
        )
    R_left, R_right, P_left, P_right, *_ = cv2.stereoRectify(
        cameraMatrix1=K[0],
        distCoeffs1=D[0],
        cameraMatrix2=K[1],
        distCoeffs2=D[1],
        imageSize=size,
        R=np.ascontiguousarray(T_right_left[:3, :3]),
        T=np.ascontiguousarray(T_right_left[:3, 3:]),
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=0,
    )
    width, height = size
    left, right = (
        CameraRectification(
            K=K[i],
            D=D[i],
            R=np.asarray(R, dtype=np.float64),
            P=np.asarray(P, dtype=np.float64),
            width=width,
            height=height,
        )
        for i, (R, P) in enumerate(((R_left, P_left), (R_right, P_right)))
    )
    return StereoRectification(left=left, right=right)


def core_rectifier(camera: CameraRectification) -> core.Rectifier:
    """Make what rectifies the images of one camera of a pair.

    Raises
    ------
    SettingsError
        If the camera cannot see anything of its rectified image.
    """
    P = camera.P
    return core.Rectifier(
        camera.camera_model().core,
        np.ascontiguousarray(camera.R),
        fx=float(P[0, 0]),
        fy=float(P[1, 1]),
        cx=float(P[0, 2]),
        cy=float(P[1, 2]),
        width=camera.width,
        height=camera.height,
    )
