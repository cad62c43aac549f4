# SPDX-License-Identifier: BSD-3-Clause
"""Predicted and measured pixels of the points in the keyframes of a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray, IntArray
from orbslam2py.maps.contents import MapContents, contents_of


def reprojection_errors(contents: MapContents) -> FloatArray:
    """Return the distances of keypoints from the predicted pixels of their points.

    Returns
    -------
    array of float64 (o,)
        Undistorted pixels, one per observation.

    Raises
    ------
    MapFileError
        If `contents` is invalid.
    """
    contents_of(contents)
    keyframes, observations = contents.keyframes, contents.observations
    rows = np.searchsorted(keyframes.ids, observations.keyframe)
    points = np.searchsorted(contents.points.ids, observations.point)
    seen = keyframes.keypoints[contents.observed_keypoints]
    if contents.cameras.has_rigs:
        return _errors_of_rigs(contents, rows, points, seen)
    expected = project_points(contents, rows, points, np.zeros(len(rows), bool))
    return np.asarray(np.linalg.norm(expected - seen, axis=1))


def _errors_of_rigs(
    contents: MapContents, rows: IntArray, points: IntArray, seen: NDArray[np.float32]
) -> FloatArray:
    """Distances of keypoints from the pixels at which the camera of each predicts its point."""
    T = contents.keyframes.T_cw[rows]
    X = np.einsum("sij,sj->si", T[:, :3, :3], contents.points.positions[points]) + T[:, :3, 3]
    camera = contents.keyframes.camera[rows]
    errors = np.full(len(rows), np.nan)
    for number in np.unique(camera).tolist():
        rig, own = contents.cameras.rig(number), camera == number
        if rig is not None:
            pixels = np.ascontiguousarray(seen[own], np.float64)
            errors[own] = np.linalg.norm(rig.errors(np.ascontiguousarray(X[own]), pixels), axis=1)
    return errors


def project_points(
    contents: MapContents, rows: IntArray, points: IntArray, bent: NDArray[np.bool_]
) -> FloatArray:
    """Predict the pixels of points in keyframes.

    Parameters
    ----------
    contents
        The map.
    rows, points
        Rows of keyframes and of points, (s,) each.
    bent
        Whether to apply OpenCV's distortion, or none (pinhole), bool (s,). Fisheye cameras always
        use their own model.

    Returns
    -------
    array of float64 (s, 2)
        Pixels; the centre of the first is (0, 0).
    """
    keyframes, cameras = contents.keyframes, contents.cameras
    T = keyframes.T_cw[rows]
    X = np.einsum("sij,sj->si", T[:, :3, :3], contents.points.positions[points]) + T[:, :3, 3]
    x, y = X[:, 0] / X[:, 2], X[:, 1] / X[:, 2]
    camera = keyframes.camera[rows]
    k1, k2, p1, p2, k3, k4, k5, k6 = np.where(bent, cameras.distortion[camera].T, 0.0)
    r2 = x * x + y * y
    radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    pixels = np.stack(
        [cameras.fx[camera] * u + cameras.cx[camera], cameras.fy[camera] * v + cameras.cy[camera]],
        axis=1,
    )
    for number in np.unique(camera):
        model = cameras.camera_model(int(number))
        if model is not None:
            pixels[camera == number] = model.project(X[camera == number])
    return pixels
