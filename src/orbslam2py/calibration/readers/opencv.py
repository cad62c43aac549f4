# SPDX-License-Identifier: BSD-3-Clause
"""OpenCV's YAML and XML: one camera, or the pair of ``stereoCalibrate``."""

from __future__ import annotations

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.camera_model import (
    checked_camera_matrix,
    checked_size,
    opencv_coefficients,
    pose_of_parts,
)
from orbslam2py.calibration.foreign_cameras import (
    NO_DISTORTION,
    CalibrationSource,
    CameraFile,
    ForeignCamera,
    both_ways,
)
from orbslam2py.calibration.lenses import PINHOLE
from orbslam2py.datasets.images import quiet_opencv
from orbslam2py.errors import SettingsError

_ONE = (
    ("camera_matrix", "cameraMatrix", "Camera_Matrix", "K", "mtx", "intrinsic_matrix"),
    (
        *("distortion_coefficients", "Distortion_Coefficients", "distCoeffs", "dist_coeffs"),
        *("distortion", "dist", "D", "dist_coeff"),
    ),
)
#: Of a pair: n is 1 or 2, side "left" or "right", s its first letter in upper case.
_OF_PAIR = (
    (
        *("M{n}", "K{n}", "cameraMatrix{n}", "camera_matrix{n}", "camera_matrix_{n}", "mtx{n}"),
        *("{side}_camera_matrix", "camera_matrix_{side}", "K_{side}", "M_{side}", "{side}_K"),
        *("cameraMatrix{s}", "camera_matrix_{s}", "mtx{s}", "K{s}", "M{s}"),
    ),
    (
        *("D{n}", "distCoeffs{n}", "dist_coeffs{n}", "distortion_coefficients{n}", "dist{n}"),
        *("dist_coeffs_{n}", "distortion_coefficients_{n}", "{side}_distortion_coefficients"),
        *("distortion_coefficients_{side}", "dist_coeffs_{side}", "{side}_dist_coeffs"),
        *("D_{side}", "dist_{side}", "{side}_D", "distCoeffs{s}", "dist{s}", "D{s}"),
    ),
)
_LEFT, _RIGHT = (
    [tuple(name.format(n=n, side=side, s=side[0].upper()) for name in names) for names in _OF_PAIR]
    for n, side in ((1, "left"), (2, "right"))
)
_ROTATION = ("R", "rotation_matrix", "rotation", "R_stereo", "rotationMatrix")
_TRANSLATION = ("T", "translation_vector", "translation", "T_stereo", "translationVector", "t")
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_SIZE = ("image_size", "imageSize", "img_size", "size")


def read_opencv(source: CalibrationSource) -> CameraFile:
    """Read one camera, or both of a pair and where the right one stands (in metres)."""
    path = source.path
    try:
        with quiet_opencv():
            storage = cv2.FileStorage(source.text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
            fisheye = bool(_node(storage, ("fisheye_model",)).real())
            one, left, right = (
                [_matrix(_node(storage, names)) for names in camera]
                for camera in (_ONE, _LEFT, _RIGHT)
            )
            R, T = (_matrix(_node(storage, names)) for names in (_ROTATION, _TRANSLATION))
            sides = _sides(storage)
    except (cv2.error, SystemError) as error:
        # What it says of the reason is a line of its own source.
        raise SettingsError(
            f"{path} is damaged: OpenCV cannot read it, or a matrix in it has another size than it "
            "says; write it again with cv2.FileStorage, with camera_matrix 3 x 3 and "
            "distortion_coefficients"
        ) from error
    size = source.size if sides is None else checked_size(path, sides)
    lens = "equidistant" if fisheye else PINHOLE
    if left[0] is None or right[0] is None:
        K, D = one if one[0] is not None else left
        return CameraFile((_camera(source, "the camera", 0, (K, D), size, lens, None),))
    place = None
    if R is not None and T is not None:
        rotation = cv2.Rodrigues(R)[0] if R.size == 3 else R
        place = pose_of_parts(path, "the right camera (R, T)", rotation, T)
    cameras = (
        _camera(source, "camera 0", 0, (left[0], left[1]), size, lens, np.eye(4)),
        _camera(source, "camera 1", 1, (right[0], right[1]), size, lens, place),
    )
    return CameraFile(cameras, prefix="camera ", pairs=both_ways([0, 1]), place_key="R and T")


def _camera(
    source: CalibrationSource,
    name: str,
    number: int,
    matrices: tuple[FloatArray | None, FloatArray | None],
    size: tuple[int, int] | None,
    lens: str,
    T: FloatArray | None,
) -> ForeignCamera:
    path, (K, D) = source.path, matrices
    if K is None:
        names = ", ".join(_ONE[0])
        raise SettingsError(
            f"{path} has no camera matrix (looked for {names}); is it a file of OpenCV? Add "
            "camera_matrix, or name another --format"
        )
    K = checked_camera_matrix(path, K)
    known = NO_DISTORTION
    if lens == PINHOLE:
        known = opencv_coefficients(path, np.zeros(0) if D is None else D, K, size)
    return ForeignCamera(name, number, K, known, size, lens, T)


def _sides(storage: cv2.FileStorage) -> list[float] | None:
    nodes = [_node(storage, names) for names in (_WIDTH, _HEIGHT)]
    if not any(node.empty() for node in nodes):
        return [node.real() for node in nodes]
    node = _node(storage, _SIZE)
    if node.empty():
        return None
    items = node if node.isSeq() else node.getNode("data")
    return [items.at(i).real() for i in range(items.size())]


def _node(storage: cv2.FileStorage, names: tuple[str, ...]) -> cv2.FileNode:
    for name in names:
        node = storage.getNode(name)
        if not node.empty():
            return node
    return storage.getNode(names[0])


def _matrix(node: cv2.FileNode) -> FloatArray | None:
    """Give what a node holds; None if there is no matrix.

    Number by number, as `mat` of OpenCV 4.11 makes nonsense of whole ones, "0" or "1", between
    others with a point.
    """
    known = node.mat()  # of which the shape is right, and what is no matrix is refused
    if known is None:
        return None
    known, data = np.asarray(known), node.getNode("data")
    numbers = np.array([data.at(i).real() for i in range(data.size())], dtype=np.float64)
    return numbers.reshape(known.shape)
