# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of a camera from views of a board.

All lens models of `orbslam2py.CameraModel` can be calibrated. OpenCV's solver (Zhang, "A flexible
new technique for camera calibration", 2000) gives the start of its own models;
`orbslam2py.calibration.first_guess` gives that of the others.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from os import PathLike

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py._files import atomic_write
from orbslam2py.calibration.boards import Target
from orbslam2py.calibration.bundle import AdjustedScene, Sighting, adjust
from orbslam2py.calibration.camera_model import settings_of_model
from orbslam2py.calibration.chessboard import BoardView, BoardViews, choose_views
from orbslam2py.calibration.families import OPENCV_FAMILIES, padded, wanted_family
from orbslam2py.calibration.selection import (
    FamilyScore,
    best_of,
    compare_families,
    solve_family,
)
from orbslam2py.errors import DatasetError
from orbslam2py.settings import OrbSettings, Sensor, Settings, settings_for_camera
from orbslam2py.settings.camera_model import CameraModel

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
    camera
        The camera with its lens.
    deviations
        Standard deviations of fx, fy, cx, cy [pixels] and of `distortion`.
    rms
        Reprojection error over all corners: root mean square of the distances [pixels].
    board
        The board.
    views
        The views from which the camera was calibrated.
    left_out
        Names of views that did not fit the others.
    n_searched, n_found
        Images looked at, and those with the board.
    scores
        Errors of the lens models that were compared; empty if one was asked for.
    """

    camera: CameraModel
    deviations: FloatArray
    rms: float
    board: Target
    views: tuple[CalibratedView, ...]
    left_out: tuple[str, ...]
    n_searched: int
    n_found: int
    scores: tuple[FamilyScore, ...] = ()

    @property
    def family(self) -> str:
        """The lens model, by its name in `orbslam2py.CameraModel`."""
        return self.camera.name

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the images [pixels]."""
        return self.camera.image_size

    @property
    def K(self) -> FloatArray:
        """Focal lengths and principal point as a camera matrix (3, 3), pixels."""
        fx, fy, cx, cy = self.camera.parameters[:4]
        return np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])

    @property
    def distortion(self) -> FloatArray:
        """Coefficients of the lens after fx, fy, cx, cy.

        For ``pinhole``, ``radtan4`` and ``radtan5`` always k1, k2, p1, p2, k3, (5,); for other
        models in the order of `orbslam2py.CameraModel`.
        """
        return padded(self.camera, np.array(self.camera.parameters))[4:]

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

    @property
    def angle_seen(self) -> float:
        """Largest angle of a corner from the optical axis [rad]."""
        return angle_from_axis(self.camera, self.corners)

    def warnings(self) -> list[str]:
        """Return reasons to doubt this calibration."""
        found = []
        if len(self.views) < _GOOD_VIEWS:
            found.append(f"only {len(self.views)} different views; take {_GOOD_VIEWS} or more")
        if self.coverage < _GOOD_COVERAGE:
            found.append(
                f"the board was seen in {self.coverage:.0%} of the image only; hold it into all "
                "corners too"
            )
        if self.rms > _GOOD_RMS:
            other = "" if self.scores else ", does the lens model fit (leave --model out)"
            found.append(
                f"the reprojection error of {self.rms:.2f} pixels is high; is the board flat, are "
                f"the images sharp{other}?"
            )
        focal, deviation = self.K[0, 0], float(self.deviations[0])
        # xi and alpha trade with the focal length, which alone says nothing there.
        if self.family in OPENCV_FAMILIES and deviation > _GOOD_SIGMA * focal:
            found.append(
                f"the focal length is uncertain: {focal:.1f} +- {deviation:.1f} "
                "pixels; slant the board more"
            )
        found += self._warnings_of_border()
        return found

    def _warnings_of_border(self) -> list[str]:
        width, height = self.size
        u, v = (width - 1) / 2, (height - 1) / 2
        borders = [[0, v], [width - 1, v], [u, 0], [u, height - 1]]
        if np.isfinite(self.camera.unproject(borders)).all():
            return []
        return [
            f"the {self.family} lens shows nothing at a border of the image; hold the board there "
            "too, or choose another lens model (--model)"
        ]

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
        return settings_for_camera(
            settings_of_model(self.camera, fps=fps, rgb=rgb),
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
            f"# Calibrated from {len(self.views)} views of the board {self.board}, reprojection "
            f"error {self.rms:.3f} pixels (RMS)"
        )
        with atomic_write(path) as stream:
            stream.write(f"{first}\n{note}\n{rest}")


def angle_from_axis(camera: CameraModel, pixels: FloatArray) -> float:
    """Largest angle of pixels (n, 2) from the optical axis [rad]."""
    rays = camera.unproject(pixels)
    return float(np.nanmax(np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])))


def calibrate(
    found: BoardViews,
    board: Target,
    *,
    max_views: int = 40,
    k3: bool = False,
    model: str | None = None,
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
        The same as the model ``radtan5``.
    model
        Lens model, by its name in `orbslam2py.CameraModel`. By default the one of least
        cross-validated error is chosen; of several that are equally good, the one that most
        programs read.

    Raises
    ------
    DatasetError
        If there are too few different views, or they determine no camera.
    SettingsError
        If there is no such model, or `k3` contradicts it.
    """
    wanted = wanted_family(model, k3=k3)
    views = enough_views(found, max_views)
    sightings = sightings_of(views, board)
    scores: list[FamilyScore] = []
    if wanted is None:
        scores = compare_families(sightings, found.size)
        wanted = best_of(scores).family
    solved = solve_family(wanted, sightings, found.size)
    views, left_out, solved = without_bad_views(views, board, solved)
    scene = solved.scene
    calibrated = [
        CalibratedView(view.name, one.corners, scene.projected(one), scene.T_0b[one.moment])
        for view, one in zip(views, sightings_of(views, board), strict=True)
    ]
    camera = scene.cameras[0]
    return Calibration(
        camera=camera,
        deviations=padded(camera, solved.deviations(0)),
        rms=solved.rms,
        board=board,
        views=tuple(calibrated),
        left_out=left_out,
        n_searched=found.n_searched,
        n_found=len(found.views),
        scores=tuple(scores),
    )


def enough_views(found: BoardViews, max_views: int) -> list[BoardView]:
    """Choose views that differ most.

    Raises
    ------
    DatasetError
        If there are too few.
    """
    views = choose_views(found, max_views)
    if len(views) < LEAST_VIEWS:
        raise DatasetError(
            f"only {len(views)} different views of the board (it was found in {len(found.views)} "
            f"of {found.n_searched} images); at least {LEAST_VIEWS} are needed, {_GOOD_VIEWS} or "
            "more are good: move and slant the board"
        )
    return views


def sightings_of(views: list[BoardView], board: Target) -> list[Sighting]:
    """The corners of views of one camera; each view has its own time."""
    return [
        Sighting(0, moment, view.points_of(board), view.corners)
        for moment, view in enumerate(views)
    ]


def without_bad_views(
    views: list[BoardView], board: Target, solved: AdjustedScene
) -> tuple[list[BoardView], tuple[str, ...], AdjustedScene]:
    """Leave out views that do not fit the others, and solve again."""
    scene = solved.scene
    errors = np.array(
        [
            np.sqrt(((one.corners - scene.projected(one)) ** 2).sum(axis=1).mean())
            for one in sightings_of(views, board)
        ]
    )
    fine = errors <= max(_OUTLYING * float(np.median(errors)), _WORST_FINE)
    if fine.all() or int(fine.sum()) < LEAST_VIEWS:
        return views, (), solved
    left_out = tuple(view.name for view, good in zip(views, fine, strict=True) if not good)
    _log.info("views that do not fit the others are left out: %s", ", ".join(left_out))
    kept = [view for view, good in zip(views, fine, strict=True) if good]
    poses = tuple(T for T, good in zip(scene.T_0b, fine, strict=True) if good)
    begin = type(scene)(scene.cameras, scene.T_c0, poses)
    return kept, left_out, adjust(begin, sightings_of(kept, board))
