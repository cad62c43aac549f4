# SPDX-License-Identifier: BSD-3-Clause
"""Bundle adjustment of cameras of any model that see a board.

Minimises the squared reprojection errors over the intrinsics, the poses of the cameras and the
poses of the board: Levenberg-Marquardt with the Schur complement of the board's poses (B. Triggs et
al., "Bundle adjustment: a modern synthesis", 1999). Derivatives by the points come from the camera
models, those by the coefficients of the lens are differences.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from orbslam2py._arrays import FloatArray
from orbslam2py.errors import SettingsError
from orbslam2py.settings.camera_model import CameraModel

_STEP = 1e-6
_ITERATIONS = 40
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-4, 1e-12, 1e10
#: A step that lowers the cost by less than this part is the last one.
_CONVERGED = 1e-6
#: Limits of parameters, a little inside of those of the models.
_MARGIN = 1e-5
_LIMITS = {
    "fx": (1e-2, 1e6),
    "fy": (1e-2, 1e6),
    "alpha": (0.0, 1.0),
    "beta": (1e-3, 1e3),
    "omega": (1e-3, float(np.pi)),
}
_LIMITS_OF_XI = {"double_sphere": (-1.0, 1.0), "mei": (0.0, 1e3)}


@dataclass(frozen=True, eq=False)
class Sighting:
    """Corners of the board in one image.

    Attributes
    ----------
    camera, moment
        Numbers of the camera and of the pose of the board.
    points
        Corners in the frame of the board, (n, 3) metres.
    corners
        Where the image shows them, (n, 2) pixels.
    """

    camera: int
    moment: int
    points: FloatArray
    corners: FloatArray


@dataclass(frozen=True, eq=False)
class BoardScene:
    """Cameras and the poses of a board.

    Attributes
    ----------
    cameras
        One model per camera.
    T_c0
        Camera 0 to each camera, (4, 4) metres; the first is the identity.
    T_0b
        Board to camera 0 at each moment, (4, 4) metres.
    """

    cameras: tuple[CameraModel, ...]
    T_c0: tuple[FloatArray, ...]
    T_0b: tuple[FloatArray, ...]

    def projected(self, sighting: Sighting) -> FloatArray:
        """Where the cameras see the corners of a sighting, (n, 2) pixels; NaN where nowhere."""
        T = self.T_c0[sighting.camera] @ self.T_0b[sighting.moment]
        return self.cameras[sighting.camera].project(transformed(T, sighting.points))

    def residuals(self, sightings: Sequence[Sighting]) -> FloatArray:
        """Found minus projected of all corners, (n, 2) pixels."""
        return np.concatenate([one.corners - self.projected(one) for one in sightings])


@dataclass(frozen=True, eq=False)
class AdjustedScene:
    """Result of the adjustment.

    Attributes
    ----------
    scene
        The cameras and poses of least cost.
    rms
        Root mean square of the distances of all corners [pixels]; infinite if a camera cannot show
        one of the corners.
    covariance
        Of the intrinsics of all cameras, then of the poses `BoardScene.T_c0` from the second one on
        (translation, rotation); (s, s).
    """

    scene: BoardScene
    rms: float
    covariance: FloatArray

    def deviations(self, camera: int) -> FloatArray:
        """Standard deviations of the parameters of a camera."""
        sizes = [len(one.parameters) for one in self.scene.cameras]
        begin = sum(sizes[:camera])
        diagonal = np.diag(self.covariance)[begin : begin + sizes[camera]]
        return np.sqrt(np.maximum(diagonal, 0.0))

    def pose_deviations(self, camera: int) -> FloatArray:
        """Standard deviations (6,) of `BoardScene.T_c0`: translation [m], rotation [rad]."""
        begin = sum(len(one.parameters) for one in self.scene.cameras) + 6 * (camera - 1)
        return np.sqrt(np.maximum(np.diag(self.covariance)[begin : begin + 6], 0.0))


def transformed(T: FloatArray, points: FloatArray) -> FloatArray:
    """Points (n, 3) after a transform (4, 4)."""
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def rms_of(residuals: FloatArray) -> float:
    """Root mean square of the lengths; infinite if one is unknown."""
    value = float(np.sqrt((residuals**2).sum(axis=1).mean()))
    return value if np.isfinite(value) else float("inf")


def with_parameters(camera: CameraModel, values: FloatArray) -> CameraModel:
    """Return a camera with other parameters, which are brought within their limits.

    Raises
    ------
    SettingsError
        If there is no such camera.
    """
    values = np.array(values, np.float64)
    for place, name in enumerate(camera.parameter_names):
        low, high = _LIMITS.get(name, (-np.inf, np.inf))
        if name == "xi":
            low, high = _LIMITS_OF_XI[camera.name]
        values[place] = np.clip(values[place], low + _MARGIN, high - _MARGIN)
    return CameraModel(camera.name, values.tolist(), camera.image_size)


def parameter_jacobian(camera: CameraModel, points: FloatArray, pixels: FloatArray) -> FloatArray:
    """Derivatives (n, 2, p) of the pixels by the parameters; 0 where there is no pixel.

    `pixels` (n, 2) are those of the points (n, 3).
    """
    parameters = np.array(camera.parameters)
    jacobian = np.zeros((len(points), 2, len(parameters)))
    # The pixel is (fx m_x + cx, fy m_y + cy) in all models.
    for axis in (0, 1):
        jacobian[:, axis, axis] = (pixels[:, axis] - parameters[2 + axis]) / parameters[axis]
        jacobian[:, axis, 2 + axis] = 1.0
    for place in range(4, len(parameters)):
        step = _STEP * max(1.0, abs(parameters[place]))
        moved = parameters.copy()
        moved[place] += step
        ahead = CameraModel(camera.name, moved.tolist(), camera.image_size)
        jacobian[:, :, place] = (ahead.project(points) - pixels) / step
    return np.nan_to_num(jacobian)


@dataclass(eq=False)
class _Normal:
    """Normal equations, with a block per pose of the board."""

    shared: FloatArray
    rhs: FloatArray
    mixed: dict[int, FloatArray] = field(default_factory=dict)
    blocks: dict[int, FloatArray] = field(default_factory=dict)
    block_rhs: dict[int, FloatArray] = field(default_factory=dict)

    def solve(self, damping: float, free: NDArray[np.bool_]) -> tuple[FloatArray, FloatArray]:
        """Return the step (s,) of the shared unknowns, and (m, 6) of the poses of the board."""
        A, b = self.reduced(damping)
        step = np.zeros(len(b))
        if free.any():
            step[free] = np.linalg.solve(A[np.ix_(free, free)], b[free])
        poses = np.zeros((len(self.blocks), 6))
        for moment, D in self.blocks.items():
            right = self.block_rhs[moment] - self.mixed[moment].T @ step
            poses[moment] = np.linalg.solve(_damped(D, damping), right)
        return step, poses

    def reduced(self, damping: float) -> tuple[FloatArray, FloatArray]:
        A, b = _damped(self.shared, damping), self.rhs.copy()
        for moment, D in self.blocks.items():
            gain = np.linalg.solve(_damped(D, damping), self.mixed[moment].T).T
            A -= gain @ self.mixed[moment].T
            b -= gain @ self.block_rhs[moment]
        return A, b


def _damped(A: FloatArray, damping: float) -> FloatArray:
    return A + np.diag(damping * np.maximum(np.diag(A), 1e-9))


def adjust(
    scene: BoardScene,
    sightings: Sequence[Sighting],
    *,
    free: Sequence[str] | None = None,
    poses_alone: bool = False,
    iterations: int = _ITERATIONS,
) -> AdjustedScene:
    """Find the cameras and poses of least reprojection error.

    Parameters
    ----------
    scene
        Where to begin.
    sightings
        Observations of the cameras; every moment must be seen by a camera.
    free
        Names of the intrinsics to change; by default all.
    poses_alone
        Keep intrinsics and the poses of the cameras; only the board moves.
    iterations
        Most steps.
    """
    unknown = _free_unknowns(scene, free, poses_alone=poses_alone)
    intrinsics = not poses_alone
    cost = float((scene.residuals(sightings) ** 2).sum())
    damping = _FIRST_DAMPING
    normal = None
    if np.isfinite(cost):
        normal = _normal_equations(scene, sightings, intrinsics=intrinsics)
    for _ in range(iterations):
        if normal is None or damping > _MOST_DAMPING:
            break
        tried, new_cost = _try(scene, normal, damping, unknown, sightings)
        if tried is None or not new_cost < cost:
            damping *= 10
            continue
        done = cost - new_cost < _CONVERGED * cost
        scene, cost = tried, new_cost
        if done:
            break
        damping = max(damping / 10, _LEAST_DAMPING)
        normal = _normal_equations(scene, sightings, intrinsics=intrinsics)
    return AdjustedScene(
        scene, rms_of(scene.residuals(sightings)), _covariance(scene, sightings, unknown, cost)
    )


def _free_unknowns(
    scene: BoardScene, free: Sequence[str] | None, *, poses_alone: bool
) -> NDArray[np.bool_]:
    intrinsics = [
        not poses_alone and (free is None or name in free)
        for camera in scene.cameras
        for name in camera.parameter_names
    ]
    return np.array(intrinsics + [not poses_alone] * (6 * (len(scene.cameras) - 1)), bool)


def _try(
    scene: BoardScene,
    normal: _Normal,
    damping: float,
    free: NDArray[np.bool_],
    sightings: Sequence[Sighting],
) -> tuple[BoardScene | None, float]:
    try:
        step, poses = normal.solve(damping, free)
        moved = _moved(scene, step, poses)
    except (np.linalg.LinAlgError, SettingsError):
        return None, float("inf")
    cost = float((moved.residuals(sightings) ** 2).sum())
    return moved, cost if np.isfinite(cost) else float("inf")


def _moved(scene: BoardScene, step: FloatArray, poses: FloatArray) -> BoardScene:
    cameras, T_c0, place = [], [scene.T_c0[0]], 0
    for camera in scene.cameras:
        n = len(camera.parameters)
        change = step[place : place + n]
        cameras.append(
            with_parameters(camera, np.array(camera.parameters) + change)
            if np.any(change)
            else camera
        )
        place += n
    for T in scene.T_c0[1:]:
        T_c0.append(_exponential(step[place : place + 6]) @ T)
        place += 6
    T_0b = [_exponential(one) @ T for one, T in zip(poses, scene.T_0b, strict=True)]
    return replace(scene, cameras=tuple(cameras), T_c0=tuple(T_c0), T_0b=tuple(T_0b))


def _exponential(step: FloatArray) -> FloatArray:
    """The transform of a translation and a rotation vector."""
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(np.ascontiguousarray(step[3:]))[0]
    T[:3, 3] = step[:3]
    return T


def _normal_equations(
    scene: BoardScene, sightings: Sequence[Sighting], *, intrinsics: bool = True
) -> _Normal:
    sizes = [len(camera.parameters) for camera in scene.cameras]
    begins = np.cumsum([0, *sizes])
    n = int(begins[-1]) + 6 * (len(sizes) - 1)
    normal = _Normal(np.zeros((n, n)), np.zeros(n))
    for moment in range(len(scene.T_0b)):
        normal.mixed[moment] = np.zeros((n, 6))
        normal.blocks[moment], normal.block_rhs[moment] = np.zeros((6, 6)), np.zeros(6)
    for camera in range(len(sizes)):
        of_camera = [one for one in sightings if one.camera == camera]
        if of_camera:
            places = int(begins[camera]), int(begins[-1])
            _add_camera(normal, scene, of_camera, places, intrinsics=intrinsics)
    return normal


def _add_camera(
    normal: _Normal,
    scene: BoardScene,
    sightings: list[Sighting],
    places: tuple[int, int],
    *,
    intrinsics: bool,
) -> None:
    """Add the sightings of one camera.

    `places` are those of its first intrinsic, and of the first pose of a camera.
    """
    begin, poses = places
    number = sightings[0].camera
    camera, T_c0 = scene.cameras[number], scene.T_c0[number]
    in_first = [transformed(scene.T_0b[one.moment], one.points) for one in sightings]
    in_camera = [transformed(T_c0, points) for points in in_first]
    pixels, by_point = camera.project_with_jacobian(np.concatenate(in_camera))
    by_parameter = np.zeros((len(pixels), 2, len(camera.parameters)))
    if intrinsics:
        by_parameter = parameter_jacobian(camera, np.concatenate(in_camera), pixels)
    n = by_parameter.shape[2]
    place, row = poses + 6 * (number - 1), 0
    columns = list(range(begin, begin + n)) + (list(range(place, place + 6)) if number else [])
    for one, points_0, points_c in zip(sightings, in_first, in_camera, strict=True):
        rows = slice(row, row + len(points_0))
        row += len(points_0)
        J_x = by_point[rows]
        shared = [by_parameter[rows]]
        if number:
            shared.append(_by_pose(J_x, points_c))
        J = np.concatenate(shared, axis=2).reshape(-1, len(columns))
        J_b = _by_pose(J_x @ T_c0[:3, :3], points_0).reshape(-1, 6)
        r = (one.corners - pixels[rows]).ravel()
        normal.shared[np.ix_(columns, columns)] += J.T @ J
        normal.rhs[columns] += J.T @ r
        normal.mixed[one.moment][columns] += J.T @ J_b
        normal.blocks[one.moment] += J_b.T @ J_b
        normal.block_rhs[one.moment] += J_b.T @ r


def _by_pose(J_x: FloatArray, points: FloatArray) -> FloatArray:
    """Derivatives (n, 2, 6) by a pose after the points, of those by the points (n, 2, 3)."""
    return np.concatenate([J_x, np.cross(points[:, None, :], J_x)], axis=2)


def _covariance(
    scene: BoardScene, sightings: Sequence[Sighting], free: NDArray[np.bool_], cost: float
) -> FloatArray:
    covariance = np.zeros((len(free), len(free)))
    n_residuals = 2 * sum(len(one.points) for one in sightings)
    n_unknown = int(free.sum()) + 6 * len(scene.T_0b)
    if not (np.isfinite(cost) and free.any() and n_residuals > n_unknown):
        return covariance
    A, _ = _normal_equations(scene, sightings).reduced(0.0)
    inverse = np.linalg.pinv(A[np.ix_(free, free)])
    covariance[np.ix_(free, free)] = inverse * cost / (n_residuals - n_unknown)
    return covariance
