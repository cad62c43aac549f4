# SPDX-License-Identifier: BSD-3-Clause
"""A single camera's map does not begin with a motion that two views mistook for the true one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from orbslam2py import Sensor
from orbslam2py import _core as core
from orbslam2py._arrays import FloatArray
from orbslam2py._timing import StageTimer
from orbslam2py.slam.front_end import FrontEnd, intrinsics
from orbslam2py.slam.initialization.kept_views import KeptViews, View
from orbslam2py.slam.initialization.several_views import SeveralViews
from orbslam2py.slam.initialization.third_view import Candidate, agreeing_motions, reconstruct
from orbslam2py.slam.thresholds import InitializationThresholds
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

_N_FRAMES = 17


class Seen(NamedTuple):
    """A camera that has moved sideways a little."""

    kept: KeptViews
    view: View
    last: core.Frame
    T_21: core.Pose

    def place(self, T_21: core.Pose) -> core.TwoViewMotion:
        camera = intrinsics(self.last.camera)
        return core.place_points(
            self.view.keypoints, self.last.keypoints, self.view.matches, camera, T_21
        )

    def best_motion(
        self, *motions: core.TwoViewMotion, **limits: float
    ) -> core.TwoViewMotion | None:
        chosen = InitializationThresholds(**limits)  # type: ignore[arg-type]
        together = SeveralViews(Candidate(self.view, motions), self.kept.views, self.last, chosen)
        return together.best_motion(motions, seed=0)

    def off(self, motion: core.TwoViewMotion) -> float:
        """Degrees between its direction and the true one."""
        return degrees_between(motion.T_21.translation, self.T_21.translation)


def degrees_between(a: FloatArray, b: FloatArray) -> float:
    cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def pose_of(matrix: FloatArray) -> core.Pose:
    return core.Pose(Rotation.from_matrix(matrix[:3, :3]).as_quat(), matrix[:3, 3])


def look(world: str) -> Seen:
    """What a camera sees of a world on the first stretch of its way."""
    sequence = SyntheticSequence(
        SyntheticOptions(world=world, sensor="mono", frames=120, size=(320, 240), noise=1.5)
    )
    front = FrontEnd(sequence.settings, Sensor.MONOCULAR)
    kept = KeptViews(InitializationThresholds())
    for i in range(_N_FRAMES):
        image = sequence.load(i).image
        frame = front.monocular(image, i, float(i), StageTimer(), feature_factor=2)
        kept.follow(frame)
        if i < _N_FRAMES - 1:
            kept.keep_last()
    view = kept.views[0]
    T_wc = sequence.ground_truth().T_wc
    return Seen(kept, view, frame, pose_of(np.linalg.inv(T_wc[frame.id]) @ T_wc[view.frame.id]))


@pytest.fixture(scope="module")
def seen() -> Seen:
    return look("corridor")


def turned(T_21: core.Pose, degrees: float) -> core.Pose:
    """The same rotation, and another direction."""
    axis = np.cross(T_21.translation, [0.0, 0.0, 1.0])
    turn = Rotation.from_rotvec(np.radians(degrees) * axis / np.linalg.norm(axis))
    matrix = T_21.matrix.copy()
    matrix[:3, 3] = turn.apply(matrix[:3, 3])
    return pose_of(matrix)


def test_the_true_motion_is_kept(seen: Seen) -> None:
    best = seen.best_motion(seen.place(seen.T_21))
    assert best is not None
    assert seen.off(best) < 2
    assert best.parallax > 1.0


@pytest.mark.parametrize("degrees", [-90, -60, -30, 30, 60, 90])
def test_a_mistaken_motion_is_adjusted_or_replaced(seen: Seen, degrees: float) -> None:
    wrong = seen.place(turned(seen.T_21, degrees))
    best = seen.best_motion(wrong)
    assert best is not None
    assert seen.off(best) < 2


def test_it_is_better_than_what_a_draw_gives(seen: Seen) -> None:
    camera = intrinsics(seen.last.camera)
    for seed in range(5):
        drawn = core.reconstruct_two_views(
            seen.view.keypoints, seen.last.keypoints, seen.view.matches, camera, seed=seed
        )
        assert drawn.success
        best = seen.best_motion(seen.place(drawn.T_21))
        assert best is not None
        assert seen.off(best) < 0.5 * seen.off(seen.place(drawn.T_21))


def test_a_plane_passed_on_a_straight_way_waits() -> None:
    """Two motions explain it in all views alike: only one of them has been drawn or both."""
    wall = look("room")
    assert wall.best_motion(wall.place(wall.T_21)) is None
    # If they counted as one, the map would begin with either.
    assert wall.best_motion(wall.place(wall.T_21), other_direction=180.0) is not None


def test_two_motions_of_a_plane_are_told_apart_by_all_views() -> None:
    """Third views fit both; once all are adjusted the wrong one costs several times as much."""
    wall = look("wall")
    limits = InitializationThresholds()
    candidate = Candidate.of(wall.view, reconstruct(wall.view, wall.last, seed=0))
    assert candidate is not None and not candidate.is_clear
    left = agreeing_motions(candidate, wall.kept.views, wall.last, limits)
    assert len(left) == 2
    assert max(wall.off(motion) for motion in left) > 60
    best = wall.best_motion(*left)
    assert best is not None
    assert wall.off(best) < 2
    # Whatever their order; and with a limit that nothing passes the map waits.
    again = wall.best_motion(*left[::-1])
    assert again is not None
    assert wall.off(again) < 2
    assert wall.best_motion(*left, clearly_worse_alternative=100.0) is None


def test_an_adjustment_that_fits_worse_is_not_taken(
    seen: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that ends with all views in one place says nothing against where it began."""
    solve_bundle = core.solve_bundle

    def collapsed(poses: list[core.Pose], *rest: object) -> tuple[list[core.Pose], object, object]:
        _, points, outliers = solve_bundle(poses, *rest)  # type: ignore[arg-type]
        nearly = [core.Pose(T.quaternion_xyzw, 1e-9 * np.roll(T.translation, 1)) for T in poses]
        return nearly, points, outliers

    monkeypatch.setattr(core, "solve_bundle", collapsed)
    motion = seen.place(seen.T_21)
    best = seen.best_motion(motion, other_direction=180.0)
    assert best is not None
    assert seen.off(best) < 10
    assert best.parallax > 1.0


@pytest.mark.parametrize(("degrees", "is_one"), [(0, True), (15, True), (45, False)])
def test_two_motions_to_nearly_the_same_place_are_one(
    seen: Seen, degrees: float, is_one: bool
) -> None:
    motions = tuple(seen.place(turned(seen.T_21, turn)) for turn in (0, degrees))
    limits = InitializationThresholds(clearly_worse=1e9)  # none fits that much worse
    left = agreeing_motions(Candidate(seen.view, motions), seen.kept.views, seen.last, limits)
    assert len(left) == (1 if is_one else 2)
    assert set(left) <= set(motions)


def test_too_little_parallax_or_too_few_points_wait(seen: Seen) -> None:
    motion = seen.place(seen.T_21)
    assert seen.best_motion(motion, parallax=60.0) is None
    assert seen.best_motion(motion, points=1000) is None


def test_a_seed_gives_the_same_bytes(seen: Seen) -> None:
    motion = seen.place(turned(seen.T_21, 30))
    first, second = seen.best_motion(motion), seen.best_motion(motion)
    assert first is not None and second is not None
    assert first.points.tobytes() == second.points.tobytes()
