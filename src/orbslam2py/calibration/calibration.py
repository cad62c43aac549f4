# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of a camera from views of a chessboard.

The model is that of `orbslam2py.settings.CameraSettings`: a pinhole with OpenCV's radial and
tangential distortion (Zhang, "A flexible new technique for camera calibration", 2000; the solver
is OpenCV's).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from os import PathLike

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.calibration.camera_model import camera_settings
from orbslam2py.calibration.chessboard import Board, BoardView, BoardViews, choose_views
from orbslam2py.errors import DatasetError
from orbslam2py.settings import (
    OrbSettings,
    Sensor,
    Settings,
    settings_for_camera,
)

_log = logging.getLogger(__name__)


#: Zhang's method needs two slanted views for five parameters; with fewer than this nothing would
#: show that something is wrong.
LEAST_VIEWS = 4
_GOOD_VIEWS = 10
_GOOD_COVERAGE = 0.5
_GOOD_RMS = 1.0
#: Standard deviation of the focal length, as a part of it, above which it is not to be trusted.
_GOOD_SIGMA = 0.005
#: A view with an error this many times the median (and above _WORST_FINE pixels) is left out.
_OUTLYING = 3.0
_WORST_FINE = 0.5
_GRID = (8, 6)


@dataclass(frozen=True, eq=False)
class CalibratedView:
    """A view of the board from which the camera was calibrated.

    Attributes
    ----------
    name
        File name, or number of the frame.
    corners, projected
        Corners as found, and as the calibrated camera sees the board; (n, 2) pixels.
    T_cb
        Board to camera, (4, 4), metres.
    """

    name: str
    corners: FloatArray
    projected: FloatArray
    T_cb: FloatArray

    @property
    def residuals(self) -> FloatArray:
        """Found minus projected, (n, 2) pixels."""
        return self.corners - self.projected

    @property
    def error(self) -> float:
        """Root mean square of the distances [pixels]."""
        return float(np.sqrt((self.residuals**2).sum(axis=1).mean()))


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated camera.

    Attributes
    ----------
    K
        Camera matrix (3, 3), pixels.
    distortion
        k1, k2, p1, p2, k3, (5,).
    deviations
        Standard deviations of fx, fy, cx, cy [pixels], k1, k2, p1, p2, k3; (9,).
    size
        Width and height of the images [pixels].
    rms
        Reprojection error over all corners: root mean square of the distances [pixels].
    board
        The chessboard.
    views
        The views from which the camera was calibrated.
    left_out
        Names of views that did not fit the others.
    n_searched, n_found
        Images looked at, and those with the board.
    """

    K: FloatArray
    distortion: FloatArray
    deviations: FloatArray
    size: tuple[int, int]
    rms: float
    board: Board
    views: tuple[CalibratedView, ...]
    left_out: tuple[str, ...]
    n_searched: int
    n_found: int

    @property
    def residuals(self) -> FloatArray:
        """Residuals of all corners of all views, (n, 2) pixels."""
        return np.concatenate([view.residuals for view in self.views])

    @property
    def corners(self) -> FloatArray:
        """Corners of all views as found, (n, 2) pixels."""
        return np.concatenate([view.corners for view in self.views])

    @property
    def coverage(self) -> float:
        """Part of the image, in 8 x 6 cells, that corners lie in."""
        cells = np.floor(self.corners / np.array(self.size) * _GRID).astype(int)
        return len(np.unique(cells, axis=0)) / (_GRID[0] * _GRID[1])

    @property
    def distances(self) -> tuple[float, float]:
        """Nearest and farthest distance of the board's corner to the camera [m]."""
        lengths = [float(np.linalg.norm(view.T_cb[:3, 3])) for view in self.views]
        return min(lengths), max(lengths)

    def warnings(self) -> list[str]:
        """Say what makes this calibration doubtful."""
        found = []
        if len(self.views) < _GOOD_VIEWS:
            found.append(f"only {len(self.views)} different views; take {_GOOD_VIEWS} or more")
        if self.coverage < _GOOD_COVERAGE:
            found.append(
                f"the board was seen in {self.coverage:.0%} of the image only; hold it into all "
                "corners too"
            )
        if self.rms > _GOOD_RMS:
            found.append(
                f"the reprojection error of {self.rms:.2f} pixels is high; is the board flat, are "
                "the images sharp?"
            )
        if self.deviations[0] > _GOOD_SIGMA * self.K[0, 0]:
            found.append(
                f"the focal length is uncertain: {self.K[0, 0]:.1f} +- {self.deviations[0]:.1f} "
                "pixels; slant the board more"
            )
        return found

    def settings(
        self,
        *,
        fps: float = 30.0,
        n_features: int | None = None,
        rgb: bool = False,
        sensor: Sensor | str = Sensor.MONOCULAR,
        baseline: float | None = None,
        depth_factor: float | None = None,
    ) -> Settings:
        """Make settings for this camera.

        Parameters
        ----------
        fps
            Frames per second.
        n_features
            Features per image; by default 1000, or 2000 for images above 0.6 megapixels.
        rgb
            Whether the images that will be tracked are RGB (True) or BGR.
        sensor, baseline, depth_factor
            As for `orbslam2py.settings.settings_for_camera`.

        Raises
        ------
        SettingsError
            If a number is out of range.
        """
        camera = camera_settings(self.K, self.distortion, self.size, fps=fps, rgb=rgb)
        return settings_for_camera(
            camera,
            sensor,
            baseline=baseline,
            depth_factor=depth_factor,
            orb=None if n_features is None else OrbSettings(n_features=n_features),
        )

    def save(
        self,
        path: str | PathLike[str],
        *,
        fps: float = 30.0,
        n_features: int | None = None,
        sensor: Sensor | str = Sensor.MONOCULAR,
        baseline: float | None = None,
        depth_factor: float | None = None,
    ) -> None:
        """Write a settings file that says where it comes from.

        Parameters
        ----------
        path
            The file; replaced only when everything was written.
        fps, n_features, sensor, baseline, depth_factor
            As for `settings`.

        Raises
        ------
        SettingsError
            If a number is out of range.
        OSError
            If the file cannot be written; an existing file is kept then.
        """
        settings = self.settings(
            fps=fps,
            n_features=n_features,
            sensor=sensor,
            baseline=baseline,
            depth_factor=depth_factor,
        )
        first, rest = settings.to_yaml().split("\n", 1)
        note = (
            f"# Calibrated from {len(self.views)} views of a {self.board} board, reprojection "
            f"error {self.rms:.3f} pixels (RMS)"
        )
        with atomic_write(path) as stream:
            stream.write(f"{first}\n{note}\n{rest}")


def calibrate(
    found: BoardViews, board: Board, *, max_views: int = 40, k3: bool = False
) -> Calibration:
    """Calibrate a camera.

    Parameters
    ----------
    found
        Views of the board; see `orbslam2py.calibration.find_views`.
    board
        The board that was found.
    max_views
        Most views to use: those that differ most.
    k3
        Estimate the third radial coefficient: for wide lenses, where k1 and k2 leave residuals
        at the border.

    Raises
    ------
    DatasetError
        If there are too few different views, or they determine no camera.
    """
    views = choose_views(found, max_views)
    if len(views) < LEAST_VIEWS:
        raise DatasetError(
            f"only {len(views)} different views of the board (it was found in {len(found.views)} "
            f"of {found.n_searched} images); at least {LEAST_VIEWS} are needed, {_GOOD_VIEWS} or "
            "more are good: move and slant the board"
        )
    calibration = _solve(views, found, board, k3=k3, left_out=())
    errors = np.array([view.error for view in calibration.views])
    fine = errors <= max(_OUTLYING * float(np.median(errors)), _WORST_FINE)
    if not fine.all() and int(fine.sum()) >= LEAST_VIEWS:
        left_out = tuple(view.name for view, good in zip(views, fine, strict=True) if not good)
        _log.info("views that do not fit the others are left out: %s", ", ".join(left_out))
        kept = [view for view, good in zip(views, fine, strict=True) if good]
        calibration = _solve(kept, found, board, k3=k3, left_out=left_out)
    return calibration


def _solve(
    views: list[BoardView], found: BoardViews, board: Board, *, k3: bool, left_out: tuple[str, ...]
) -> Calibration:
    points = board.points
    try:
        rms, K, distortion, rotations, translations, deviations, _, _ = cv2.calibrateCameraExtended(
            [points.astype(np.float32)] * len(views),
            [view.corners.astype(np.float32) for view in views],
            found.size,
            np.zeros((3, 3)),
            np.zeros(5),
            flags=0 if k3 else cv2.CALIB_FIX_K3,
        )
    except cv2.error as error:
        raise DatasetError(f"the views determine no camera: {error}") from error
    matrix = np.asarray(K, dtype=np.float64)
    coefficients = np.asarray(distortion, dtype=np.float64).reshape(-1)[:5]
    if not (np.isfinite(matrix).all() and np.isfinite(coefficients).all() and matrix[0, 0] > 0):
        raise DatasetError("the views determine no camera: slant the board, and move it more")
    calibrated = []
    for view, rotation, translation in zip(views, rotations, translations, strict=True):
        projected, _ = cv2.projectPoints(points, rotation, translation, matrix, coefficients)
        T_cb = np.eye(4)
        T_cb[:3, :3], T_cb[:3, 3] = cv2.Rodrigues(rotation)[0], np.ravel(translation)
        projected = np.asarray(projected, np.float64).reshape(-1, 2)
        calibrated.append(CalibratedView(view.name, view.corners, projected, T_cb))
    return Calibration(
        K=matrix,
        distortion=coefficients,
        deviations=np.asarray(deviations, np.float64).reshape(-1)[:9],
        size=found.size,
        rms=float(rms),
        board=board,
        views=tuple(calibrated),
        left_out=left_out,
        n_searched=found.n_searched,
        n_found=len(found.views),
    )
