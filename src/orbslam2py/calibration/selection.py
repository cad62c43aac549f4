# SPDX-License-Identifier: BSD-3-Clause
"""The lens model that explains views of a board best, by cross-validation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.bundle import (
    AdjustedScene,
    BoardScene,
    Sighting,
    adjust,
    rms_of,
    transformed,
)
from orbslam2py.calibration.families import (
    OPENCV_FAMILIES,
    PERSPECTIVE,
    WIDE,
    fit_lens,
)
from orbslam2py.calibration.first_guess import board_pose, kannala_brandt_start
from orbslam2py.errors import DatasetError, SettingsError
from orbslam2py.settings.camera_model import CameraModel

_FOLDS = 5
#: Models whose error over all views is more than this times the least are not validated.
_CONTENDER = 1.15
#: Models whose validated errors differ by less than this part are equally good ...
_EQUAL = 0.02
#: ... and up to this angle of corners from the axis those of OpenCV are preferred [degrees].
_NARROW = 60.0
#: OpenCV's result is doubted if its error is this many times that of a Kannala-Brandt lens.
_DOUBTED = 1.5
#: A view left out needs this many corners to be validated.
_LEAST_CORNERS = 6


@dataclass(frozen=True)
class FamilyScore:
    """How well a lens model explains the views.

    Attributes
    ----------
    family
        Name of the model.
    n_parameters
        Their number.
    rms
        Reprojection error of all views [pixels]; infinite if the model cannot show them.
    validated
        The same of views that were left out of the calibration of the lens; infinite if the model
        was too bad to be validated.
    angle
        Largest angle of a corner from the axis by this model [rad]; infinite if it is unknown.
    chosen
        Whether this is the best one.
    """

    family: str
    n_parameters: int
    rms: float
    validated: float
    angle: float
    chosen: bool = False


def best_of(scores: Sequence[FamilyScore]) -> FamilyScore:
    """The score of the chosen model."""
    return next(score for score in scores if score.chosen)


def compare_families(sightings: Sequence[Sighting], size: tuple[int, int]) -> list[FamilyScore]:
    """Calibrate all lens models, and validate those that come close to the best.

    Parameters
    ----------
    sightings
        Of one camera, moments 0, 1 and so on.
    size
        Width and height of the images [pixels].

    Raises
    ------
    DatasetError
        If the views determine no camera.
    """
    start = kannala_brandt_start(sightings, size)
    solved: dict[str, AdjustedScene] = {}
    for family in (*PERSPECTIVE, *WIDE):
        try:
            solved[family] = solve_family(family, sightings, size, start)
        except DatasetError:
            continue
    least = min(one.rms for one in solved.values())
    scores = []
    for family, one in solved.items():
        near = one.rms <= _CONTENDER * least
        scores.append(
            FamilyScore(
                family,
                len(one.scene.cameras[0].parameters),
                one.rms,
                validated_error(one.scene, sightings) if near else float("inf"),
                largest_angle(one.scene, sightings),
            )
        )
    return choose(scores)


def choose(scores: Sequence[FamilyScore]) -> list[FamilyScore]:
    """Mark the best model: of those equally good, the one that most programs read.

    Raises
    ------
    DatasetError
        If none was validated.
    """
    least = min((score.validated for score in scores), default=float("inf"))
    if not np.isfinite(least):
        raise DatasetError("the views determine no camera: slant the board, and move it more")
    equal = [score for score in scores if score.validated <= (1 + _EQUAL) * least]
    widest = max(score.angle for score in equal)
    preferred = (*PERSPECTIVE, *WIDE) if np.degrees(widest) <= _NARROW else (*WIDE, *PERSPECTIVE)
    best = min(equal, key=lambda score: preferred.index(score.family))
    return [replace(score, chosen=score is best) for score in scores]


def solve_family(
    family: str,
    sightings: Sequence[Sighting],
    size: tuple[int, int],
    start: AdjustedScene | None = None,
) -> AdjustedScene:
    """Calibrate one lens model.

    Parameters
    ----------
    family
        Its name.
    sightings, size
        As for `compare_families`.
    start
        A Kannala-Brandt lens that was calibrated with these views.

    Raises
    ------
    DatasetError
        If the views determine no such camera, or the lens cannot show them.
    """
    best: AdjustedScene | None = None
    if family in OPENCV_FAMILIES:
        best = _from_opencv(family, sightings, size)
    if start is None and (best is None or family not in ("pinhole", "radtan4")):
        start = kannala_brandt_start(sightings, size)
    if best is None or (start is not None and best.rms > _DOUBTED * start.rms):
        if start is None:
            start = kannala_brandt_start(sightings, size)
        other = start if family == "kannala_brandt" else _from_rays(family, sightings, size, start)
        best = other if best is None or (other and other.rms < best.rms) else best
    if best is None or not np.isfinite(best.rms):
        seen = "" if start is None else f" ({_degrees(start, sightings):.0f} degrees from the axis)"
        raise DatasetError(
            f"a lens of the model {family} cannot show all corners that were found{seen}; leave "
            "--model out to find the model that can"
        )
    return best


def _degrees(solved: AdjustedScene, sightings: Sequence[Sighting]) -> float:
    return float(np.degrees(largest_angle(solved.scene, sightings)))


def largest_angle(scene: BoardScene, sightings: Sequence[Sighting]) -> float:
    """Largest angle of a corner from the axis of camera 0 [rad]; infinite if one is unknown."""
    rays = scene.cameras[0].unproject(np.concatenate([one.corners for one in sightings]))
    angles = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    return float(angles.max()) if np.isfinite(angles).all() else float("inf")


_FLAGS = {
    "pinhole": cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3,
    "radtan4": cv2.CALIB_FIX_K3,
    "radtan5": 0,
    "rational": cv2.CALIB_RATIONAL_MODEL,
    "thin_prism": cv2.CALIB_RATIONAL_MODEL | cv2.CALIB_THIN_PRISM_MODEL,
}


def _from_opencv(
    family: str, sightings: Sequence[Sighting], size: tuple[int, int]
) -> AdjustedScene | None:
    """Calibrate with OpenCV's solver, then with ours; None if that gives no camera."""
    n_coefficients = {"rational": 8, "thin_prism": 12}.get(family, 5)
    try:
        _, K, distortion, rotations, translations = cv2.calibrateCamera(
            [one.points.astype(np.float32) for one in sightings],
            [one.corners.astype(np.float32) for one in sightings],
            size,
            np.zeros((3, 3)),
            np.zeros(n_coefficients),
            flags=_FLAGS[family],
        )
        lens = np.ravel(distortion)
        count = {"pinhole": 0, "radtan4": 4, "radtan5": 5}.get(family, n_coefficients)
        values = [K[0, 0], K[1, 1], K[0, 2], K[1, 2], *lens[:count]]
        camera = CameraModel(family, [float(value) for value in values], size)
    except (cv2.error, SettingsError):
        return None
    poses = []
    for rotation, translation in zip(rotations, translations, strict=True):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = cv2.Rodrigues(rotation)[0], np.ravel(translation)
        poses.append(T)
    found = adjust(BoardScene((camera,), (np.eye(4),), tuple(poses)), sightings)
    return found if np.isfinite(found.rms) else None


def _from_rays(
    family: str, sightings: Sequence[Sighting], size: tuple[int, int], start: AdjustedScene
) -> AdjustedScene | None:
    """Fit the lens to the rays of another one, then adjust all; None if it cannot show them."""
    fx, fy, cx, cy, *_ = start.scene.cameras[0].parameters
    points = [transformed(start.scene.T_0b[one.moment], one.points) for one in sightings]
    pixels = np.concatenate([one.corners for one in sightings])
    try:
        camera = fit_lens(family, np.concatenate(points), pixels, size, (fx, fy), (cx, cy)).camera
    except SettingsError:
        return None
    return adjust(replace(start.scene, cameras=(camera,)), sightings)


def validated_error(scene: BoardScene, sightings: Sequence[Sighting]) -> float:
    """Reprojection error [pixels] of views that were left out when the lens was calibrated.

    Each view is left out once; only the pose of the board is fitted to it.

    Parameters
    ----------
    scene
        One camera, calibrated with all views.
    sightings
        Its views.
    """
    n_folds = min(_FOLDS, len(sightings))
    residuals: list[FloatArray] = []
    for fold in range(n_folds):
        kept = [one for place, one in enumerate(sightings) if place % n_folds != fold]
        left = [one for place, one in enumerate(sightings) if place % n_folds == fold]
        camera = adjust(_part(scene, kept), _renumbered(kept), iterations=15).scene.cameras[0]
        for one in left:
            residuals += _residuals_of_view(camera, one)
    return rms_of(np.concatenate(residuals)) if residuals else float("inf")


def _residuals_of_view(camera: CameraModel, view: Sighting) -> list[FloatArray]:
    if len(view.points) < _LEAST_CORNERS:
        return []
    T = board_pose(camera, view)
    if T is None:
        return [np.full((len(view.points), 2), np.inf)]
    alone = replace(view, camera=0, moment=0)
    fitted = adjust(BoardScene((camera,), (np.eye(4),), (T,)), [alone], poses_alone=True)
    return [fitted.scene.residuals([alone])]


def _part(scene: BoardScene, sightings: Sequence[Sighting]) -> BoardScene:
    return replace(scene, T_0b=tuple(scene.T_0b[one.moment] for one in sightings))


def _renumbered(sightings: Sequence[Sighting]) -> list[Sighting]:
    return [replace(one, moment=moment) for moment, one in enumerate(sightings)]
