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
from orbslam2py.slam.config import InitializationConfig
from orbslam2py.slam.front_end import FrontEnd
from orbslam2py.slam.initialization import multi_view_model_selection
from orbslam2py.slam.initialization.initial_views import InitialViews, View
from orbslam2py.slam.initialization.multi_view_model_selection import MultiViewModelSelection
from orbslam2py.slam.initialization.third_view import (
    Candidate,
    Motion,
    ThirdViews,
    reconstruct,
    three_view_consistency,
)
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

_N_FRAMES = 17


class Seen(NamedTuple):
    """A camera that has moved sideways a little."""

    kept: InitialViews
    view: View
    last: core.Frame
    T_21: core.Pose

    def place(self, T_21: core.Pose) -> core.TwoViewMotion:
        camera = self.last.camera
        return core.place_points(
            self.view.keypoints, self.last.keypoints, self.view.matches, camera, T_21
        )

    def best_motion(
        self, *motions: core.TwoViewMotion, **limits: float
    ) -> core.TwoViewMotion | None:
        chosen = InitializationConfig(**limits)  # type: ignore[arg-type]
        candidate = Candidate(self.view, motions)
        together = MultiViewModelSelection(
            candidate, self.thirds(candidate, chosen), self.last, chosen
        )
        return together.best_motion(motions, seed=0)

    def thirds(
        self, candidate: Candidate, limits: InitializationConfig | None = None
    ) -> ThirdViews:
        return ThirdViews.of(candidate, self.kept, limits or InitializationConfig())

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
    kept = InitialViews(InitializationConfig())
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


@pytest.fixture(scope="module")
def wall_of_a_room() -> Seen:
    """Passed on a straight way: its two motions fit all views alike."""
    return look("room")


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
    camera = seen.last.camera
    for seed in range(5):
        drawn = core.reconstruct_two_views(
            seen.view.keypoints, seen.last.keypoints, seen.view.matches, camera, seed=seed
        )
        assert drawn.success
        best = seen.best_motion(seen.place(drawn.T_21))
        assert best is not None
        assert seen.off(best) < 0.5 * seen.off(seen.place(drawn.T_21))


def test_a_plane_passed_on_a_straight_way_waits(wall_of_a_room: Seen) -> None:
    """Two motions explain it in all views alike: only one of them has been drawn or both."""
    wall = wall_of_a_room
    assert wall.best_motion(wall.place(wall.T_21)) is None
    # If they counted as one, the map would begin with either.
    assert wall.best_motion(wall.place(wall.T_21), other_direction=180.0) is not None


def test_two_motions_of_a_plane_are_told_apart_by_all_views() -> None:
    """Third views fit both; once all are adjusted the wrong one costs several times as much."""
    wall = look("wall")
    limits = InitializationConfig()
    candidate = Candidate.of(wall.view, reconstruct(wall.view, wall.last, seed=0))
    assert candidate is not None and not candidate.is_clear
    left = three_view_consistency(candidate, wall.thirds(candidate), wall.last, limits)
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


def test_motions_that_are_not_told_apart_take_no_further_draws(
    wall_of_a_room: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    wall, draws = wall_of_a_room, []
    candidate = Candidate.of(wall.view, reconstruct(wall.view, wall.last, seed=0))
    assert candidate is not None and len(candidate.motions) == 2

    def counted(view: View, last: core.Frame, seed: int) -> core.TwoViewResult:
        draws.append(seed)
        return reconstruct(view, last, seed)

    monkeypatch.setattr(multi_view_model_selection, "reconstruct", counted)
    assert wall.best_motion(*candidate.motions) is None
    assert not draws
    # Were they told apart, the draws would have their say, and be held to the same limit.
    every = {"same_direction": 180.0}
    assert wall.best_motion(*candidate.motions, **every) is not None
    assert sorted(draws) == [1, 2, 3, 4, 5]


def test_a_draw_that_leads_elsewhere_and_fits_as_well_lets_the_map_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the motions that were given are told apart: there is a third one."""
    wall = look("wall")
    candidate = Candidate.of(wall.view, reconstruct(wall.view, wall.last, seed=0))
    assert candidate is not None
    assert wall.best_motion(*candidate.motions) is not None
    refined = MultiViewModelSelection._refined
    elsewhere = turned(wall.T_21, 25)  # of one motion it would count as the same

    def cheap(self: MultiViewModelSelection, motion: Motion) -> tuple[object, float]:
        placed, cost = refined(self, motion)
        if motion in candidate.motions:
            return placed, cost
        return self._place(elsewhere), 1.3 * 0.174

    monkeypatch.setattr(MultiViewModelSelection, "_refined", cheap)
    assert wall.best_motion(*candidate.motions) is None
    assert wall.best_motion(*candidate.motions, clearly_worse_alternative=1.01) is not None


@pytest.mark.parametrize("not_known", [(), (2,)])
def test_adjusted_poses_lead_to_the_views_that_they_are_of(
    seen: Seen, not_known: tuple[int, ...]
) -> None:
    limits = InitializationConfig()
    candidate = Candidate(seen.view, (seen.place(seen.T_21),))
    together = MultiViewModelSelection(candidate, seen.thirds(candidate), seen.last, limits)
    placed = together._place(seen.T_21)
    assert len(placed.poses) == 4
    for number in not_known:
        placed.poses[number] = None  # as of a view that sees too few of the points
    T_21, others = together._adjusted(placed)
    assert np.linalg.norm(T_21.translation) == pytest.approx(1.0)
    assert [pose is None for pose in others] == [pose is None for pose in placed.poses[2:]]
    for pose, before in zip(others, placed.poses[2:], strict=True):
        if pose is not None:
            assert before is not None
            turn, move = pose.difference(before)
            assert turn < np.radians(1)
            assert move < 0.1  # of the way, on which they lie a fifth apart or more
    again = together._place(T_21, others)
    assert all(pose is not None for pose in again.poses)


@pytest.mark.parametrize("length", [0.0, 1e-310, np.nan])
def test_views_that_end_in_one_place_leave_the_motion_as_it_was(
    seen: Seen, monkeypatch: pytest.MonkeyPatch, length: float
) -> None:
    class Collapsed:
        quaternion_xyzw = np.array([0.0, 0.0, 0.0, 1.0])
        translation = np.full(3, length)

    monkeypatch.setattr(core, "solve_bundle", lambda poses, *_: ([Collapsed] * len(poses), 0, 0))
    motion = seen.place(seen.T_21)
    best = seen.best_motion(motion, other_direction=180.0)
    assert best is not None
    assert seen.off(best) < 1


def test_an_adjustment_that_fits_worse_is_not_taken(
    seen: Seen, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that leads away says nothing against where it began."""
    solve_bundle = core.solve_bundle

    def led_away(poses: list[core.Pose], *rest: object) -> tuple[list[core.Pose], object, object]:
        _, points, outliers = solve_bundle(poses, *rest)  # type: ignore[arg-type]
        away = [core.Pose(T.quaternion_xyzw, np.roll(T.translation, 1)) for T in poses]
        return away, points, outliers

    monkeypatch.setattr(core, "solve_bundle", led_away)
    motion = seen.place(seen.T_21)
    best = seen.best_motion(motion, other_direction=180.0)
    assert best is not None
    assert seen.off(best) < 1


@pytest.mark.parametrize(("degrees", "is_one"), [(0, True), (15, True), (45, False)])
def test_two_motions_to_nearly_the_same_place_are_one(
    seen: Seen, degrees: float, is_one: bool
) -> None:
    motions = tuple(seen.place(turned(seen.T_21, turn)) for turn in (0, degrees))
    limits = InitializationConfig(clearly_worse=1e9)  # none fits that much worse
    candidate = Candidate(seen.view, motions)
    left = three_view_consistency(candidate, seen.thirds(candidate, limits), seen.last, limits)
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
