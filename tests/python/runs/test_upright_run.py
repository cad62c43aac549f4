# SPDX-License-Identifier: BSD-3-Clause
"""A run whose map an IMU turns upright: all its files are in one world, and pictures stand."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py.maps import SavedMap, load_map
from orbslam2py.maps.ply import read_points
from orbslam2py.runs import run_sequence
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.report_page import RunFolder, read_run
from orbslam2py.runs.several_maps import maps_of_file, maps_of_run
from orbslam2py.slam.options import SystemOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import Trajectory, read_tum
from orbslam2py.trajectory.level import level_frame, moved

pytestmark = pytest.mark.watchdog(100)

#: In the synthetic room: from its y down to z up.
_UPWARDS = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Any:
    folder = tmp_path_factory.mktemp("run")
    options = SyntheticOptions(
        world="room", sensor="stereo", frames=75, size=(320, 240), motion="shakes", pace=3.0,
        imu=True, imu_noise="bmi088",
    )  # fmt: skip
    system = SystemOptions(deterministic=True)
    chosen = RunOptions("stereo", system, imu=True, save_map=folder / "map.orbmap")
    sequence = SyntheticSequence(options)
    run = run_sequence(sequence, chosen)
    writer = OutputWriter(folder)
    writer.write_all(run.result, run.report, run.evaluation)
    assert writer.problems == []
    return folder, run, sequence


@pytest.fixture(scope="module")
def saved(done: Any) -> SavedMap:
    return load_map(done[0] / "map.orbmap")


@pytest.fixture(scope="module")
def page(done: Any) -> RunFolder:
    return read_run(done[0])


def same_poses(found: Trajectory, path: Trajectory, within: float) -> None:
    """Poses at equal times are equal."""
    rows = np.searchsorted(path.timestamps, found.timestamps - 1e-6)
    np.testing.assert_allclose(path.timestamps[rows], found.timestamps, atol=1e-6)
    np.testing.assert_allclose(found.T_wc, path.T_wc[rows], atol=within)


def test_the_map_is_upright(done: Any) -> None:
    _, run, sequence = done
    assert run.result.snapshot.is_upright
    assert [entry["upright"] for entry in run.report["maps"]] == [True]
    path = run.result.tracked_trajectory()
    true_up = _UPWARDS[2] @ sequence.ground_truth().T_wc[path.indices, :3, :3]
    up = path.T_wc[:, 2, :3]
    assert np.degrees(np.arccos((up * true_up).sum(axis=1).clip(-1, 1))).max() < 1.0


def test_files_are_in_one_world(done: Any) -> None:
    folder, _, sequence = done
    path = read_tum(folder / "trajectory.txt")
    same_poses(read_tum(folder / "keyframes.txt"), path, 1e-6)
    same_poses(read_tum(folder / "trajectory_online.txt"), path, 0.2)
    same_poses(read_tum(folder / "groundtruth_aligned.txt"), path, 0.06)
    truth = sequence.ground_truth().T_wc[0]
    # The first pose is the same in both worlds.
    to_room = truth @ np.linalg.inv(path.T_wc[0])
    points = moved(to_room, read_points(folder / "points.ply"))
    from_walls = np.abs(np.abs(points[:, [0, 2]]) - 3.0).min(axis=1)
    assert np.median(from_walls) < 0.1
    arrays = np.load(folder / "map.npz")
    nearest = np.abs(arrays["point_positions"][:, None] - read_points(folder / "points.ply")[:50])
    assert nearest.max(axis=2).min(axis=0).max() < 1e-4


def test_saved_maps_are_in_the_same_world(done: Any, saved: SavedMap) -> None:
    path = read_tum(done[0] / "trajectory.txt")
    assert saved.contents.upright_roots == (0,)
    for in_world in (False, True):
        same_poses(saved.trajectory(in_world=in_world), path, 1e-6)


def level(trajectory: Trajectory, *, positions: np.ndarray) -> None:
    """In level axes heights are those over the start, and forward is where the camera looked."""
    T_dw = level_frame(trajectory.T_wc[0])
    np.testing.assert_allclose(positions, moved(T_dw, trajectory.positions), atol=1e-6)


def test_pictures_stand(done: Any, saved: SavedMap, page: RunFolder) -> None:
    folder, run, sequence = done
    path = read_tum(folder / "trajectory.txt")
    level(path, positions=page.path.positions)
    level(path, positions=maps_of_run(run.result)[0].positions)
    level(path, positions=maps_of_file(saved)[0].positions)
    same_poses(page.keyframes, page.path, 1e-6)
    same_poses(page.online, page.path, 0.2)
    assert page.map is not None
    order = np.argsort(page.map.keyframe_timestamps)
    np.testing.assert_allclose(page.map.keyframe_T_wc[order], page.keyframes.T_wc, atol=1e-6)
    truth = sequence.ground_truth().positions
    np.testing.assert_allclose(page.path.positions[:, 1], truth[:, 1] - truth[0, 1], atol=0.06)
    for drawn in (page.points, maps_of_run(run.result)[0].points, maps_of_file(saved)[0].points):
        # Walls stand: seen from above, points gather in lines.
        assert np.median(np.abs(np.abs(drawn[:, [0, 2]]) - 3.0).min(axis=1)) < 0.3


def test_the_picture_of_a_run_is_level(
    done: Any, saved: SavedMap, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from orbslam2py.runs import map_picture, run_picture  # noqa: PLC0415

    drawn: dict[str, Any] = {}
    for module in (run_picture, map_picture):
        monkeypatch.setattr(module, "draw_trajectory", lambda _, **values: drawn.update(values))
    _, run, _ = done
    run_picture.draw_run(tmp_path / "a.png", run.result, run.evaluation, run.report)
    of_run = dict(drawn)
    map_picture.draw_map(tmp_path / "b.png", saved, title="")
    for values in (of_run, drawn):
        level(run.result.tracked_trajectory(), positions=values["positions"])
        assert values["height"].label == "height over\nthe start"
        np.testing.assert_array_equal(values["height"].up, [0, -1, 0])
    np.testing.assert_allclose(of_run["truth"][1], of_run["positions"], atol=0.06)
