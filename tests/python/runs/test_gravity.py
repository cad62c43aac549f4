# SPDX-License-Identifier: BSD-3-Clause
"""Which way is up: by ground truth whose world stands upright, else as the first camera was."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from orbslam2py import open_sequence
from orbslam2py.datasets import MaskedSequence
from orbslam2py.runs import run_sequence
from orbslam2py.runs.gravity import Height, height_of
from orbslam2py.runs.options import RunOptions
from orbslam2py.runs.outputs import OutputWriter
from orbslam2py.runs.plots import draw_trajectory
from orbslam2py.slam.options import SystemOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import Trajectory

pytestmark = pytest.mark.watchdog(40)

Z_UP = np.array([0.0, 0.0, 1.0])
TILTED = cv2.Rodrigues(np.array([0.5, 0.1, -0.3]))[0]


def moved(trajectory: Trajectory, R: np.ndarray, scale: float = 1.0) -> Trajectory:
    """The same path in a world that is turned, shifted and scaled."""
    T_wc = trajectory.T_wc.copy()
    T_wc[:, :3, :3] = R @ T_wc[:, :3, :3]
    T_wc[:, :3, 3] = scale * T_wc[:, :3, 3] @ R.T + [1, 2, 3]
    return Trajectory(trajectory.timestamps, T_wc)


def level_drive(n: int = 30) -> Trajectory:
    """Straight ahead along x in a world with z up, rising a little: no turn around the way seen."""
    T_wc = np.tile(np.eye(4), (n, 1, 1))
    T_wc[:, :3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]  # camera: z ahead is x, y down is -z
    T_wc[:, 0, 3] = np.linspace(0, 10, n)
    T_wc[:, 2, 3] = np.linspace(0, 1, n)
    return Trajectory(np.arange(n) / 10, T_wc)


def upright(up: np.ndarray | None) -> Any:
    return SimpleNamespace(up_in_truth=up)


@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_height_is_along_gravity_however_the_camera_was_held(scale: float) -> None:
    truth = level_drive()
    estimate = moved(truth, TILTED, scale)
    height = height_of(upright(Z_UP), estimate, truth)
    np.testing.assert_allclose(height.up, TILTED @ Z_UP, atol=1e-9)
    assert height.label.startswith("height over")
    climbed = height.of(estimate.positions)
    np.testing.assert_allclose(climbed - climbed[0], scale * truth.positions[:, 2], atol=1e-9)


def test_noise_in_single_poses_does_not_matter() -> None:
    truth, rng = level_drive(), np.random.default_rng(0)
    estimate = moved(truth, TILTED)
    turns = np.array([cv2.Rodrigues(rng.normal(0, 0.02, 3))[0] for _ in range(len(truth))])
    T_wc = estimate.T_wc.copy()
    T_wc[:, :3, :3] = T_wc[:, :3, :3] @ turns
    height = height_of(upright(Z_UP), Trajectory(estimate.timestamps, T_wc), truth)
    assert height.up @ (TILTED @ Z_UP) > np.cos(np.radians(1))


@pytest.mark.parametrize("case", ["no direction", "no attribute", "no truth", "no pose", "y down"])
def test_what_is_not_known_is_told_for_what_it_is(case: str) -> None:
    truth = level_drive()
    estimate = moved(truth, TILTED)
    source, known = upright(Z_UP), truth
    if case == "no direction":
        source = upright(None)
    elif case == "no attribute":
        source = object()
    elif case == "no truth":
        known = None  # type: ignore[assignment]
    elif case == "no pose":
        estimate = estimate.select([])
    else:  # a file of somebody's own, whose world is not that of the layout
        known = moved(truth, np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0.0]]))
    height = height_of(source, estimate, known)
    np.testing.assert_array_equal(height.up, [0, -1, 0])
    assert height.label == "up in the\nfirst keyframe"


@pytest.mark.parametrize(
    ("layout", "sensor"), [("tum", "rgbd"), ("kitti", "stereo"), ("euroc", "stereo")]
)
def test_layouts_tell_it(tmp_path: Path, layout: str, sensor: str) -> None:
    options = SyntheticOptions(world="corridor", sensor=sensor, frames=4, size=(64, 64))
    made = SyntheticSequence(options)
    sequence = open_sequence(made.write(tmp_path / "made", layout), sensor)
    estimate = moved(made.ground_truth(), TILTED)
    for source in (sequence, made):
        height = height_of(source, estimate, source.ground_truth())
        np.testing.assert_allclose(height.up, TILTED @ [0, -1, 0], atol=1e-3)
        assert height.label.startswith("height over")
    cv2.imwrite(str(tmp_path / "mask.png"), np.full((64, 64), 255, np.uint8))
    masked = MaskedSequence(sequence, tmp_path / "mask.png")
    np.testing.assert_array_equal(masked.up_in_truth, sequence.up_in_truth)


@pytest.mark.picture
def test_the_picture_of_a_run_uses_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    drawn: dict[str, Any] = {}
    monkeypatch.setattr(
        "orbslam2py.runs.run_picture.draw_trajectory", lambda _, **values: drawn.update(values)
    )
    options = SyntheticOptions(world="corridor", sensor="rgbd", frames=8, size=(320, 240))
    done = run_sequence(
        SyntheticSequence(options), RunOptions("rgbd", SystemOptions(deterministic=True))
    )
    writer = OutputWriter(tmp_path)
    writer.write_all(done.result, done.report, done.evaluation)
    assert writer.problems == []
    assert drawn["height"].label.startswith("height over")
    assert drawn["height"].up @ [0, -1, 0] > 0.999


def test_the_curve_follows_the_direction(tmp_path: Path) -> None:
    positions = np.zeros((50, 3))
    positions[:, 0] = np.linspace(0, 5, 50)
    pictures = []
    for height in (None, Height(np.array([1.0, 0, 0]), "height over\nthe start")):
        path = tmp_path / "p.png"
        draw_trajectory(
            path,
            title="t",
            positions=positions,
            seconds=np.arange(50.0),
            keyframes=positions[:1],
            points=positions[:0],
            height=height,
        )
        picture = cv2.imread(str(path))
        below = picture[int(0.72 * len(picture)) :]
        rows = np.argwhere((below[:, :, 0] > 140) & (below[:, :, 2] < 80))[:, 0]
        pictures.append(int(np.ptp(rows)))
    assert pictures[0] < 10, "level"
    assert pictures[1] > 50, "rising"
