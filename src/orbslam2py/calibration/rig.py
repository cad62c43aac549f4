# SPDX-License-Identifier: BSD-3-Clause
"""Calibration of cameras that are mounted together: lenses, and the poses between the cameras."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from orbslam2py._arrays import FloatArray
from orbslam2py.calibration.boards import Target
from orbslam2py.calibration.bundle import AdjustedScene, BoardScene, Sighting, adjust
from orbslam2py.calibration.calibration import (
    CalibratedView,
    Calibration,
    enough_views,
    sightings_of,
    without_bad_views,
)
from orbslam2py.calibration.chessboard import BoardView, BoardViews, choose_views
from orbslam2py.calibration.families import padded, wanted_family
from orbslam2py.calibration.first_guess import board_pose
from orbslam2py.calibration.selection import (
    FamilyScore,
    best_of,
    choose,
    compare_families,
    solve_family,
)
from orbslam2py.datasets.pair_names import side_of_pair
from orbslam2py.errors import DatasetError
from orbslam2py.settings.camera_model import CameraModel

#: Fewest moments at which two cameras see the board, to find the pose between them.
LEAST_SHARED = 3
_GOOD_SHARED = 8
#: Names of images agree if this part of them is in both folders.
_NAMES_AGREE = 0.5
#: A moment with an error this many times the median (and above _WORST_FINE pixels) is left out ...
_OUTLYING, _WORST_FINE = 3.0, 0.5
#: ... and an error together that is this many times the one of each camera alone says that the
#: cameras are not mounted firmly, or that their images are not of the same moments.
_APART, _APART_PIXELS = 1.5, 0.1


@dataclass(frozen=True, eq=False)
class RigCalibration:
    """Calibrated cameras, and the poses between them.

    Attributes
    ----------
    cameras
        Every camera, from all views.
    T_c0
        Camera 0 to each camera, (4, 4) metres; the first is the identity.
    deviations
        Standard deviations (6,) of each of these: translation [m], rotation [rad].
    rms
        Reprojection error of all corners of all cameras [pixels].
    rms_alone
        Reprojection error of each camera with free poses of the board [pixels].
    n_moments, n_shared
        Moments used, and those at which two cameras or more see the board.
    by_order
        Whether images were paired by their order, because their names do not agree.
    """

    cameras: tuple[Calibration, ...]
    T_c0: tuple[FloatArray, ...]
    deviations: tuple[FloatArray, ...]
    rms: float
    rms_alone: tuple[float, ...]
    n_moments: int
    n_shared: int
    by_order: bool = False

    @property
    def positions(self) -> FloatArray:
        """Centres of the cameras in the frame of camera 0, (c, 3) metres."""
        return np.array([np.linalg.inv(T)[:3, 3] for T in self.T_c0])

    def reordered(self, order: Sequence[int]) -> RigCalibration:
        """Return the same rig with another order of its cameras."""
        first = np.linalg.inv(self.T_c0[order[0]])
        return replace(
            self,
            cameras=tuple(self.cameras[i] for i in order),
            T_c0=tuple(
                np.asarray(self.T_c0[i] @ first) if place else np.eye(4)
                for place, i in enumerate(order)
            ),
            deviations=(np.zeros(6), *(self.deviations[i or order[0]] for i in order[1:])),
            rms_alone=tuple(self.rms_alone[i] for i in order),
        )

    def warnings(self) -> list[str]:
        """Return reasons to doubt this calibration."""
        found = []
        for number, camera in enumerate(self.cameras):
            found += [f"camera {number}: {text}" for text in camera.warnings()]
        if self.n_shared < _GOOD_SHARED:
            found.append(
                f"two cameras see the board in only {self.n_shared} sets of images; take "
                f"{_GOOD_SHARED} or more"
            )
        alone = float(np.sqrt(np.mean(np.square(self.rms_alone))))
        if self.rms > max(_APART * alone, alone + _APART_PIXELS):
            found.append(
                f"the reprojection error of all cameras together is {self.rms:.2f} pixels, and "
                f"{alone:.2f} of each alone: the images of a set must be of the same moment (hold "
                "the board still, or synchronise the cameras), and the cameras must be mounted "
                "firmly"
            )
        if self.by_order:
            found.append(
                "the names of the images do not agree, so they are paired by their order; give "
                "the images of a set the same name if one is missing in a folder"
            )
        return found


def calibrate_rig(
    found: Sequence[BoardViews],
    board: Target,
    *,
    max_views: int = 40,
    model: str | None = None,
) -> RigCalibration:
    """Calibrate two cameras or more that are mounted together.

    Parameters
    ----------
    found
        Views of the board by each camera; images of one moment have the same name, or the same
        place in equally many images.
    board
        The board.
    max_views
        Most views of each camera, and most sets of images of two cameras.
    model
        Lens model of all cameras; by default the one of least cross-validated error.

    Raises
    ------
    DatasetError
        If there are too few views, they determine no camera, the images cannot be paired, or two
        cameras never see the board together.
    SettingsError
        If there is no such model.
    """
    keys, by_order = _keys_of_views(found)
    family = wanted_family(model)
    chosen = [_views_of_camera(i, views, max_views) for i, views in enumerate(found)]
    scores: list[FamilyScore] = []
    if family is None:
        scores = _common_scores(
            [
                compare_families(sightings_of(views, board), one.size)
                for views, one in zip(chosen, found, strict=True)
            ]
        )
        family = best_of(scores).family
    alone = []
    for views, one in zip(chosen, found, strict=True):
        solved = solve_family(family, sightings_of(views, board), one.size)
        alone.append(without_bad_views(views, board, solved))
    moments = _moments(found, keys, [views for views, _, _ in alone], max_views)
    cameras = [solved.scene.cameras[0] for _, _, solved in alone]
    scene, sightings = _start(cameras, moments, board)
    joint = adjust(scene, sightings)
    scene, sightings, moments = _without_bad_moments(joint.scene, sightings, moments)
    joint = adjust(scene, sightings) if len(scene.T_0b) < len(joint.scene.T_0b) else joint
    return RigCalibration(
        cameras=tuple(
            _calibration(i, joint, sightings, moments, found[i], board, alone[i][1], scores)
            for i in range(len(found))
        ),
        T_c0=joint.scene.T_c0,
        deviations=(
            np.zeros(6),
            *(joint.pose_deviations(i) for i in range(1, len(found))),
        ),
        rms=joint.rms,
        rms_alone=tuple(solved.rms for _, _, solved in alone),
        n_moments=len(moments),
        n_shared=sum(len(views) > 1 for views in moments),
        by_order=by_order,
    )


def _views_of_camera(number: int, views: BoardViews, max_views: int) -> list[BoardView]:
    try:
        return enough_views(views, max_views)
    except DatasetError as error:
        raise DatasetError(f"camera {number}: {error}") from None


def _common_scores(scores: Sequence[Sequence[FamilyScore]]) -> list[FamilyScore]:
    """Scores of the models that all cameras can have: means over the cameras."""
    by_family = [{score.family: score for score in one} for one in scores]
    common = []
    for family in by_family[0]:
        own = [one[family] for one in by_family if family in one]
        if len(own) == len(by_family):
            common.append(
                FamilyScore(
                    family,
                    own[0].n_parameters,
                    float(np.sqrt(np.mean([one.rms**2 for one in own]))),
                    float(np.sqrt(np.mean([one.validated**2 for one in own]))),
                    max(one.angle for one in own),
                )
            )
    return choose(common)


def _keys_of_views(found: Sequence[BoardViews]) -> tuple[list[dict[str, BoardView]], bool]:
    """Views by a key that all images of a moment share, and whether this is their order."""
    stems = [[Path(name).stem for name in one.names] for one in found]
    shared = set(stems[0]).intersection(*map(set, stems[1:]))
    if len(shared) >= _NAMES_AGREE * min(map(len, stems)):
        return [{Path(view.name).stem: view for view in one.views} for one in found], False
    if len({len(names) for names in stems}) > 1:
        counts = ", ".join(str(len(names)) for names in stems)
        raise DatasetError(
            f"the cameras have {counts} images, whose names do not agree; give the images of one "
            "moment the same name in each folder"
        )
    places = [{name: str(i) for i, name in enumerate(one.names)} for one in found]
    return [
        {place[view.name]: view for view in one.views}
        for place, one in zip(places, found, strict=True)
    ], not _sides_of_pairs(stems)


def _sides_of_pairs(stems: Sequence[list[str]]) -> bool:
    """Whether names are those of pairs, such as ``left_01`` and ``right_01``."""
    return len(stems) == 2 and all(
        side_of_pair(first, second) is not None for first, second in zip(*stems, strict=True)
    )


def _moments(
    found: Sequence[BoardViews],
    keys: Sequence[dict[str, BoardView]],
    chosen: Sequence[list[BoardView]],
    max_views: int,
) -> list[dict[int, BoardView]]:
    """Views of each moment by camera: those of the single cameras, and those of two together."""
    wanted: set[str] = set()
    for camera, views in enumerate(keys):
        names = {view.name for view in chosen[camera]}
        wanted |= {key for key, view in views.items() if view.name in names}
        others = [other for number, other in enumerate(keys) if number != camera]
        together = {key for key in views if any(key in other for other in others)}
        some = BoardViews(found[camera].size, [views[key] for key in sorted(together)])
        picked = {view.name for view in choose_views(some, max_views)}
        wanted |= {key for key in together if views[key].name in picked}
    return [
        {camera: views[key] for camera, views in enumerate(keys) if key in views}
        for key in sorted(wanted)
    ]


def _start(
    cameras: Sequence[CameraModel], moments: list[dict[int, BoardView]], board: Target
) -> tuple[BoardScene, list[Sighting]]:
    """Poses of the cameras and of the board, from each camera's view of the board alone."""
    T_cb: list[dict[int, FloatArray]] = []
    sightings: list[Sighting] = []
    kept: list[dict[int, BoardView]] = []
    for views in moments:
        poses: dict[int, FloatArray] = {}
        for camera, view in views.items():
            one = Sighting(0, 0, view.points_of(board), view.corners)
            T = board_pose(cameras[camera], one)
            if T is None:
                continue
            begin = BoardScene((cameras[camera],), (np.eye(4),), (T,))
            fitted = adjust(begin, [one], poses_alone=True)
            if np.isfinite(fitted.rms):
                poses[camera] = fitted.scene.T_0b[0]
        if poses:
            place = len(T_cb)
            sightings += [
                Sighting(camera, place, views[camera].points_of(board), views[camera].corners)
                for camera in poses
            ]
            T_cb.append(poses)
            kept.append({camera: views[camera] for camera in poses})
    moments[:] = kept
    T_c0 = _poses_of_cameras(len(cameras), T_cb)
    T_0b = tuple(np.asarray(np.linalg.inv(T_c0[min(poses)]) @ poses[min(poses)]) for poses in T_cb)
    return BoardScene(tuple(cameras), T_c0, T_0b), sightings


def _poses_of_cameras(n: int, T_cb: list[dict[int, FloatArray]]) -> tuple[FloatArray, ...]:
    """Camera 0 to each camera, over the cameras that share most views with those known."""
    known: dict[int, FloatArray] = {0: np.eye(4)}
    while len(known) < n:
        shared = {
            (a, b): [poses[b] @ np.linalg.inv(poses[a]) for poses in T_cb if {a, b} <= set(poses)]
            for a in known
            for b in range(n)
            if b not in known
        }
        (a, b), candidates = max(shared.items(), key=lambda one: len(one[1]))
        if len(candidates) < LEAST_SHARED:
            left = ", ".join(str(camera) for camera in range(n) if camera not in known)
            raise DatasetError(
                f"camera {left} sees the board together with another camera in only "
                f"{len(candidates)} sets of images, and {LEAST_SHARED} are needed: hold the board "
                "where two cameras see it, and check that the images of one moment have the same "
                "name in each folder"
            )
        known[b] = _most_central(candidates) @ known[a]
    return tuple(known[camera] for camera in range(n))


def _most_central(poses: list[FloatArray]) -> FloatArray:
    """The pose with the least sum of distances to the others."""
    all_of_them = np.array(poses)
    scale = max(float(np.median(np.linalg.norm(all_of_them[:, :3, 3], axis=1))), 1e-3)
    numbers = np.concatenate(
        [all_of_them[:, :3, :3].reshape(-1, 9), all_of_them[:, :3, 3] / scale], axis=1
    )
    apart = np.linalg.norm(numbers[:, None] - numbers[None], axis=2)
    return poses[int(np.argmin(apart.sum(axis=1)))]


def _without_bad_moments(
    scene: BoardScene, sightings: list[Sighting], moments: list[dict[int, BoardView]]
) -> tuple[BoardScene, list[Sighting], list[dict[int, BoardView]]]:
    errors = np.zeros(len(moments))
    for one in sightings:
        error = float(np.sqrt(((one.corners - scene.projected(one)) ** 2).sum(axis=1).mean()))
        errors[one.moment] = max(errors[one.moment], error)
    fine = errors <= max(_OUTLYING * float(np.median(errors)), _WORST_FINE)
    places = np.cumsum(fine) - 1
    kept = [replace(one, moment=int(places[one.moment])) for one in sightings if fine[one.moment]]
    T_0b = tuple(T for T, good in zip(scene.T_0b, fine, strict=True) if good)
    views = [view for view, good in zip(moments, fine, strict=True) if good]
    return replace(scene, T_0b=T_0b), kept, views


def _calibration(
    number: int,
    joint: AdjustedScene,
    sightings: list[Sighting],
    moments: list[dict[int, BoardView]],
    found: BoardViews,
    board: Target,
    left_out: tuple[str, ...],
    scores: list[FamilyScore],
) -> Calibration:
    scene = joint.scene
    own = [one for one in sightings if one.camera == number]
    views = tuple(
        CalibratedView(
            moments[one.moment][number].name,
            one.corners,
            scene.projected(one),
            np.asarray(scene.T_c0[number] @ scene.T_0b[one.moment]),
        )
        for one in own
    )
    camera = scene.cameras[number]
    residuals = scene.residuals(own)
    return Calibration(
        camera=camera,
        deviations=padded(camera, joint.deviations(number)),
        rms=float(np.sqrt((residuals**2).sum(axis=1).mean())),
        board=board,
        views=views,
        left_out=left_out,
        n_searched=found.n_searched,
        n_found=len(found.views),
        scores=tuple(scores),
    )
