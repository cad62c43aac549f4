# SPDX-License-Identifier: BSD-3-Clause
"""The judge of ``benchmarks.holding_on`` sees what is wrong, and nothing else."""

from __future__ import annotations

import dataclasses
from itertools import islice

import cv2
import numpy as np
import pytest
from benchmarks.holding_on import __main__ as program
from benchmarks.holding_on.judgement import judge
from benchmarks.holding_on.made_up import (
    IMAGES,
    SENSORS,
    SITUATIONS,
    MadeUpCase,
    MadeUpScene,
    Situation,
    image_cases,
    motion_cases,
)
from benchmarks.holding_on.play import Played, play
from benchmarks.holding_on.results import is_late, read_rows, row_of, write_rows

from orbslam2py.synthetic import SyntheticOptions

N = 120
ROTATION, TRANSLATION = 1e-3, 2e-3  # stated deviations [rad], [m]


def small_pose(vector: np.ndarray) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3] = cv2.Rodrigues(vector[:3])[0]
    T[:3, 3] = vector[3:]
    return T


def honest_run(**options) -> Played:
    """Poses that are off by exactly what their covariance says."""
    options = {"world": "corridor", "sensor": "rgbd", "frames": N, "size": (64, 64)} | options
    scene = MadeUpScene(SyntheticOptions(**options), 1000)
    truth = np.linalg.inv(scene.truth)
    random = np.random.default_rng(0)
    deviations = np.array([ROTATION] * 3 + [TRANSLATION] * 3)
    noise = random.standard_normal((N, 6)) * deviations
    T_cw = np.stack([small_pose(e) @ T for e, T in zip(noise, truth, strict=True)])
    return Played(
        scene=scene,
        truth=truth,
        truth_part=scene.truth_part,
        posed=np.ones(N, bool),
        T_cw=T_cw,
        motion=motions(T_cw),
        covariance=np.tile(np.diag(deviations**2), (N, 1, 1)),
        keyframe=np.arange(N) % 10 == 0,
        map_index=np.zeros(N, np.int64),
        changed=np.zeros(N, bool),
        with_imu=np.zeros(N, bool),
        covered=np.array([scene.covered(i) for i in range(N)]),
        path=np.linalg.inv(truth),
        loops=0,
        seconds=1.0,
    )


def motions(T_cw: np.ndarray) -> np.ndarray:
    """From frame to frame, in a map that stays as it is."""
    nowhere = np.full((1, 4, 4), np.nan)
    return np.concatenate([nowhere, T_cw[1:] @ np.linalg.inv(T_cw[:-1])])


def moved(played: Played, frames: slice, vector: np.ndarray) -> Played:
    T_cw = played.T_cw.copy()
    T_cw[frames] = small_pose(vector) @ T_cw[frames]
    return dataclasses.replace(played, T_cw=T_cw, motion=motions(T_cw))


def without(played: Played, frames: slice) -> Played:
    posed = played.posed.copy()
    posed[frames] = False
    return dataclasses.replace(played, posed=posed)


def test_an_honest_run_has_no_wrong_pose_and_a_spread_of_one():
    figures = judge(honest_run())
    assert (figures.wrong, figures.losses, figures.compared) == (0, 0, N - 1)
    assert figures.rotation_spread == pytest.approx(1, abs=0.12)
    assert figures.translation_spread == pytest.approx(1, abs=0.12)
    assert figures.tracked == figures.trackable == N
    assert figures.ate < 1e-9
    assert (figures.path_off, figures.path_compared) == (0, N - 1)


@pytest.mark.parametrize(
    "vector", [np.array([0, 0.03, 0, 0, 0, 0.0]), np.array([0, 0, 0, 0.4, 0, 0])]
)
def test_a_jump_is_wrong_where_it_begins(vector):
    figures = judge(moved(honest_run(), slice(50, None), vector))
    assert (figures.wrong, figures.wrong_keyframes, figures.wrong_before) == (1, 1, 0)


def test_a_jump_of_the_map_is_told_apart_from_a_wrong_pose():
    still = honest_run()
    jumping = moved(still, slice(50, None), np.array([0, 0.03, 0, 0, 0, 0.0]))
    figures = judge(dataclasses.replace(jumping, motion=still.motion))
    assert (figures.wrong, figures.wrong_before) == (1, 1)
    unknown = np.full_like(still.motion, np.nan)
    assert judge(dataclasses.replace(jumping, motion=unknown)).wrong_before == 0


def test_a_jump_that_the_covariance_admits_or_that_is_small_is_not_wrong():
    vector = np.array([0, 0.03, 0, 0, 0, 0.0])
    jumping = moved(honest_run(), slice(50, None), vector)
    covariance = jumping.covariance.copy()
    covariance[50] *= 100
    assert judge(dataclasses.replace(jumping, covariance=covariance)).wrong == 0
    assert judge(moved(honest_run(), slice(50, None), vector / 2)).wrong == 0
    changed = jumping.changed.copy()
    changed[50] = True
    assert judge(dataclasses.replace(jumping, changed=changed)).wrong == 0


@pytest.mark.parametrize(
    "vector", [np.array([0, 0.03, 0, 0, 0, 0.0]), np.array([0, 0, 0, 0.4, 0, 0])]
)
def test_a_pose_aside_of_the_final_path_is_off_however_little_is_known_of_it(vector):
    played = honest_run()
    path = played.path.copy()
    path[50] = path[50] @ small_pose(vector)
    vague = dataclasses.replace(played, path=path, covariance=played.covariance * 1e6)
    figures = judge(vague)
    assert (figures.wrong, figures.path_off) == (0, 2), "from the one before, and to the next"
    path[49] = np.nan
    figures = judge(dataclasses.replace(vague, path=path))
    assert (figures.path_off, figures.path_compared) == (1, N - 3)


def test_overconfidence_widens_the_spread():
    played = honest_run()
    figures = judge(dataclasses.replace(played, covariance=played.covariance / 9))
    assert figures.rotation_spread == pytest.approx(3, rel=0.12)


def test_a_loss_counts_as_found_within_a_second_of_seeing_a_mapped_place():
    played = honest_run(motion="stops", pace=0.2)
    assert played.scene.fps == 20
    assert (judge(without(played, slice(60, 70))).losses) == 1
    assert (judge(without(played, slice(60, 70))).found) == 1
    assert (judge(without(played, slice(60, 90))).found) == 0
    assert judge(without(played, slice(60, 90))).left_view == 0, "it stands where it was"
    away = honest_run(motion="turn-on-the-spot", pace=4.0)
    figures = judge(without(away, slice(5, None)))
    assert figures.losses <= 1
    assert figures.left_view == figures.losses


def test_frames_under_a_hand_need_no_pose():
    played = honest_run(cover=1.0)
    figures = judge(without(played, slice(40, 80)))
    assert figures.trackable < N
    assert judge(without(played, slice(np.argmax(played.covered), None))).tracked < N / 2


def test_a_single_camera_is_measured_in_metres_and_its_start_against_the_parallax():
    played = honest_run(sensor="mono")
    units = played.T_cw.copy()
    units[:, :3, 3] /= 2.5
    covariance = played.covariance.copy()
    covariance[:, 3:, 3:] /= 2.5**2
    path = played.path.copy()
    path[:, :3, 3] /= 2.5
    played = dataclasses.replace(played, T_cw=units, covariance=covariance, path=path)
    figures = judge(without(played, slice(0, 15)))
    assert (figures.wrong, figures.path_off) == (0, 0)
    assert figures.ate < 1e-9
    assert figures.started == pytest.approx(15 / 20)
    assert 0 < figures.enough_parallax < 1.5
    assert figures.wrong_starts == 0
    bent = units.copy()
    bent[:, :3, 3] += np.sin(np.arange(N) / 4)[:, None] * [0.2, 0, 0]
    assert judge(dataclasses.replace(played, T_cw=bent)).wrong_starts == 1


def test_starts_are_late_two_seconds_after_enough_parallax():
    row = {"lasted": 4.95, "enough_parallax": 0.5, "started": 2.4}
    assert is_late(row) is False
    assert is_late({**row, "started": 2.6}) is True
    assert is_late({**row, "started": float("nan")}) is True
    assert is_late({**row, "started": float("nan"), "lasted": 1.95}) is None
    assert is_late({**row, "enough_parallax": float("nan")}) is None


def test_every_round_plays_all_situations_and_all_sensors_come_up():
    cases = list(islice(motion_cases(SENSORS), 9 * len(SITUATIONS)))
    assert len({case.key for case in cases}) == len(cases)
    for situation in SITUATIONS:
        some = [case for case in cases if case.of is situation]
        assert {(case.sensor, case.features) for case in some} == {
            (sensor, features) for sensor in SENSORS for features in (400, 1000, 2000)
        }
        assert all(len(case.scene()) >= 60 for case in some[:1])


def test_a_round_plays_all_kinds_of_images_with_all_sensors_in_all_worlds():
    cases = list(islice(image_cases(SENSORS), 2 * 54))
    assert len({case.key for case in cases}) == len(cases)
    for name, kind in IMAGES.items():
        some = [case for case in cases if case.situation == name]
        assert len({(case.sensor, case.of.options["world"]) for case in some}) == 9
        assert {case.options().noise for case in some} == {kind["noise"]}


def test_with_an_imu_the_run_is_longer_and_the_imu_starts():
    situation = Situation("try", {"world": "corridor", "frames": 40, "size": (320, 240)})
    played = play(MadeUpCase(situation, "stereo", 1000, 1, chip="bmi088"))
    assert len(played.posed) == 120
    assert judge(played).with_imu == played.with_imu.sum() > 20
    assert not played.with_imu[:20].any()


def test_an_interrupted_file_is_read_and_made_whole(tmp_path):
    case = MadeUpCase(SITUATIONS[0], "rgbd", 400, 3)
    row = row_of(case, judge(honest_run()))
    path = tmp_path / "runs.csv"
    write_rows(path, [row, {**row, "key": "another"}])
    path.write_text(path.read_text()[:-40])
    rows = read_rows(path)
    assert list(rows) == [case.key]
    assert rows[case.key]["wrong"] == 0
    assert rows[case.key]["rotation_spread"] == pytest.approx(row["rotation_spread"])
    older = path.read_text().replace("path_off", "a_figure_that_went")
    path.write_text(older)
    assert read_rows(path) == {}, "played again"


@pytest.mark.parametrize("text", ["root:x:0:0:root", "time,x,y,z\n1,2,3,4\n"])
def test_another_file_is_not_written_over(tmp_path, monkeypatch, text):
    path = tmp_path / "precious"
    path.write_text(text)
    for again in ([], ["--again"]):
        monkeypatch.setattr("sys.argv", ["holding_on", "--runs", "1", "--csv", str(path), *again])
        with pytest.raises(SystemExit, match="no file of runs"):
            program.main()
    assert path.read_text() == text
    with pytest.raises(SystemExit, match="no file of runs"):
        read_rows(tmp_path)


def test_an_empty_file_gets_the_rows(tmp_path):
    path = tmp_path / "runs.csv"
    path.touch()
    assert read_rows(path) == {}


def test_what_is_played_again_stands_beside_what_is_not(tmp_path, monkeypatch):
    first, other = (
        MadeUpCase(SITUATIONS[0], "rgbd", 400, 3),
        MadeUpCase(SITUATIONS[0], "mono", 400, 3),
    )
    path = tmp_path / "runs.csv"
    figures = judge(honest_run())
    write_rows(path, [row_of(case, figures) for case in (first, other)])
    monkeypatch.setattr(program, "chosen_cases", lambda arguments: [first])
    monkeypatch.setattr(
        program,
        "all_rows",
        lambda cases, jobs, changes: [row_of(case, figures) | {"wrong": 7} for case in cases],
    )
    monkeypatch.setattr("sys.argv", ["holding_on", "--csv", str(path), "--again"])
    program.main()
    assert {key: row["wrong"] for key, row in read_rows(path).items()} == {
        first.key: 7,
        other.key: 0,
    }


def test_a_run_is_the_same_each_time():
    situation = Situation("try", {"world": "corridor", "frames": 12, "size": (320, 240)})
    case = MadeUpCase(situation, "stereo", 1000, 1)
    once, again = play(case), play(case)
    assert once.posed.all()
    np.testing.assert_array_equal(once.T_cw, again.T_cw)
    figures = judge(once)
    assert (figures.wrong, figures.tracked) == (0, 12)
    assert figures.ate < 0.05
