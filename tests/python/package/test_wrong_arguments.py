# SPDX-License-Identifier: BSD-3-Clause
"""Things of the wrong type, given to everything that is public: an error of ours says what to give.

A bare `TypeError` out of the depths names nothing that the caller knows.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbslam2py as orb
from orbslam2py import batches, calibration, datasets, evaluation, maps, runs, settings, synthetic
from orbslam2py import trajectory as paths
from orbslam2py import vocabulary as words
from orbslam2py.errors import OrbSlamError

pytestmark = pytest.mark.watchdog(60)

THREE = orb.Trajectory(np.arange(3.0), np.tile(np.eye(4), (3, 1, 1)))
CAMERA = orb.CameraSettings(500, 500, 320, 240)
RGBD = settings.settings_for_camera(CAMERA, "rgbd")
TWO_FRAMES = synthetic.SyntheticSequence(synthetic.SyntheticOptions(frames=2, size=(128, 96)))

WRONG: dict[str, Any] = {
    "None": None,
    "no text": "",
    "text": "no such",
    "negative": -1,
    "fraction": 1.5,
    "nan": float("nan"),
    "true": True,
    "empty list": [],
    "list": [1, 2],
    "mapping": {"a": 1},
    "bytes": b"x",
    "object": object(),
    "vector": np.zeros(5),
    "matrix of nan": np.full((2, 2), np.nan),
    "complex": np.zeros((4, 4), complex),
    "texts": np.array(["a"]),
}

Call = Callable[[Any], object]

#: A call, and which of the things above are right for it.
CALLS: dict[str, tuple[Call, set[str]]] = {
    "settings: file": (lambda x: orb.Settings.load(x, "mono"), set()),
    "settings: save": (RGBD.save, {"text"}),
    "settings: resolve": (lambda x: settings.resolve_settings(x, "mono"), set()),
    "settings: built-in": (lambda x: settings.builtin_settings(x, "mono"), set()),
    "settings: camera": (lambda x: orb.Settings(orb.Sensor.MONOCULAR, x), set()),
    "settings: orb": (lambda x: orb.Settings(orb.Sensor.MONOCULAR, CAMERA, x), set()),
    "settings: depth": (
        lambda x: orb.Settings(orb.Sensor.MONOCULAR, CAMERA, depth=x),
        {"None"},
    ),
    "settings: rectification": (
        lambda x: orb.Settings(orb.Sensor.MONOCULAR, CAMERA, rectification=x),
        {"None"},
    ),
    "settings: viewer": (lambda x: orb.Settings(orb.Sensor.MONOCULAR, CAMERA, viewer=x), set()),
    "camera: fx": (lambda x: orb.CameraSettings(x, 500, 1, 1), {"fraction"}),
    "camera: k1": (
        lambda x: orb.CameraSettings(500, 500, 1, 1, k1=x),
        {"fraction", "negative"},
    ),
    "camera: width": (lambda x: orb.CameraSettings(500, 500, 1, 1, width=x), {"None"}),
    "camera: colours": (lambda x: orb.CameraSettings(500, 500, 1, 1, rgb=x), {"true"}),
    "camera: bf": (lambda x: orb.CameraSettings(500, 500, 1, 1, bf=x), {"fraction"}),
    "camera: points": (CAMERA.project, {"empty list"}),
    "camera: T_cw": (lambda x: CAMERA.project(np.zeros((1, 3)), x), {"None"}),
    "camera: distort": (lambda x: CAMERA.project(np.zeros((1, 3)), distort=x), {"true"}),
    "features": (orb.OrbSettings, set()),
    "threshold": (lambda x: orb.OrbSettings(ini_th_fast=x), set()),
    "close factor": (orb.DepthSettings, {"fraction"}),
    "depth factor": (lambda x: orb.DepthSettings(40, x), {"None", "fraction"}),
    "own camera: camera": (lambda x: settings.settings_for_camera(x, "rgbd"), set()),
    "own camera: baseline": (
        lambda x: settings.settings_for_camera(CAMERA, "rgbd", baseline=x),
        {"None", "fraction"},
    ),
    "own camera: orb": (lambda x: settings.settings_for_camera(CAMERA, "rgbd", orb=x), {"None"}),
    "rectification": (lambda x: settings.CameraRectification(x, x, x, x, 1, 1), set()),
    "rectified pair": (lambda x: settings.StereoRectification(x, x), set()),
    "trajectory: time stamps": (lambda x: orb.Trajectory(x, THREE.T_wc), set()),
    "trajectory: poses": (lambda x: orb.Trajectory(THREE.timestamps, x), set()),
    "trajectory: lost": (lambda x: orb.Trajectory(THREE.timestamps, THREE.T_wc, x), {"None"}),
    "trajectory: indices": (
        lambda x: orb.Trajectory(THREE.timestamps, THREE.T_wc, None, x),
        {"None"},
    ),
    "trajectory: select": (THREE.select, {"empty list", "list"}),
    "trajectory: shift": (THREE.shifted, {"negative", "fraction"}),
    "trajectory: save": (THREE.save, {"text"}),
    "trajectory: format": (lambda x: THREE.save("t.txt", x), set()),
    "trajectory: read": (paths.read_trajectory, set()),
    "trajectory: read as": (lambda x: paths.read_trajectory("t.txt", x), set()),
    "trajectory: order": (
        lambda x: paths.read_trajectory("t.txt", quaternions=x),
        set(),
    ),
    "trajectory: inverse": (lambda x: paths.read_trajectory("t.txt", inverse=x), set()),
    "trajectory: times": (paths.read_times, set()),
    "trajectory: frames": (paths.read_frame_table, set()),
    "trajectory: write": (lambda x: paths.write_tum("t.txt", x), set()),
    "trajectory: texts": (lambda x: paths.write_tum("t.txt", THREE, x), {"None"}),
    "trajectory: lines": (lambda x: paths.write_kitti("t.txt", THREE, x), {"None"}),
    "associate": (lambda x: paths.associate(x, [1.0]), {"empty list", "list", "vector"}),
    "sequence": (orb.open_sequence, set()),
    "association": (lambda x: orb.open_sequence(".", association=x, layout="tum"), set()),
    "input": (datasets.open_input, set()),
    "vocabulary": (orb.load_vocabulary, {"None"}),
    "vocabulary: info": (words.vocabulary_info, {"None"}),
    "vocabulary: convert": (lambda x: words.convert_vocabulary(x, "x.bvoc"), set()),
    "vocabulary: save": (lambda x: words.save_vocabulary(x, "x.bvoc"), set()),
    "vocabulary: train": (words.train_vocabulary, set()),
    "run": (orb.run_sequence, set()),
    "run: options": (lambda x: orb.run_sequence(TWO_FRAMES, x), {"None"}),
    "run: vocabulary": (lambda x: orb.run_sequence(TWO_FRAMES, vocabulary=x), {"None"}),
    "run: start": (lambda x: runs.RunOptions(orb.Sensor.RGBD, start=x), set()),
    "run: limit": (lambda x: runs.RunOptions(orb.Sensor.RGBD, max_frames=x), {"None"}),
    "run: real time": (lambda x: runs.RunOptions(orb.Sensor.RGBD, realtime=x), {"true"}),
    "run: system": (lambda x: runs.RunOptions(orb.Sensor.RGBD, x), set()),
    "system: seed": (lambda x: runs.SystemOptions(seed=x), set()),
    "system: deterministic": (lambda x: runs.SystemOptions(deterministic=x), {"true"}),
    "system: loops": (lambda x: runs.SystemOptions(loop_closing=x), {"true"}),
    "system: limit": (
        lambda x: runs.SystemOptions(full_adjustment_time_limit=x),
        {"None", "fraction"},
    ),
    "sensor": (orb.Sensor, set()),
    "alignment": (evaluation.Alignment.of, set()),
    "format": (paths.TrajectoryFormat.of, set()),
    "standard set": (batches.StandardSet.of, set()),
    "world: frames": (lambda x: synthetic.SyntheticOptions(frames=x), {"None"}),
    "world: seed": (lambda x: synthetic.SyntheticOptions(seed=x), set()),
    "world: size": (lambda x: synthetic.SyntheticOptions(size=x), {"None"}),
    "world: noise": (lambda x: synthetic.SyntheticOptions(noise=x), {"None", "fraction"}),
    "world": (synthetic.SyntheticSequence, set()),
    "evaluate: estimate": (lambda x: evaluation.evaluate_trajectory(x, THREE), set()),
    "evaluate: truth": (lambda x: evaluation.evaluate_trajectory(THREE, x), set()),
    "evaluate: alignment": (lambda x: evaluation.evaluate_trajectory(THREE, THREE, x), set()),
    "evaluate: limit": (
        lambda x: evaluation.evaluate_trajectory(THREE, THREE, max_difference=x),
        {"fraction"},
    ),
    "other reading: estimate": (lambda x: evaluation.find_other_reading(x, THREE), set()),
    "other reading: truth": (lambda x: evaluation.find_other_reading(THREE, x), set()),
    "other reading: alignment": (
        lambda x: evaluation.find_other_reading(THREE, THREE, x),
        set(),
    ),
    "other reading: body": (
        lambda x: evaluation.find_other_reading(THREE, THREE, T_body_camera=x),
        {"None"},
    ),
    "evaluate: lap": (lambda x: evaluation.lap_error(x, THREE), set()),
    "align": (lambda x: evaluation.align(x, x), set()),
    "points": (lambda x: maps.write_ply("p.ply", x), {"empty list"}),
    "board": (lambda x: calibration.Board(x, x, 0.1), set()),
    "camera file": (calibration.read_camera_file, set()),
    "camera: pose": (lambda x: CAMERA.project([[0, 0, 1]], x), {"None"}),  # type: ignore[arg-type]
    **{
        f"callbacks: {name}": (lambda x, name=name: orb.Callbacks(**{name: x}), {"None"})
        for name in ("on_loop", "on_keyframe", "on_lost", "on_relocalized", "on_map_change")
    },
}


@pytest.mark.parametrize("name", CALLS)
def test_what_is_no_use_is_told(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    call, right = CALLS[name]
    assert right <= set(WRONG)
    for kind in WRONG.keys() - right:
        with pytest.raises(OrbSlamError) as told:
            call(WRONG[kind])
        assert len(str(told.value)) > 10, kind
        assert "object at 0x" not in str(told.value)
    assert right or not list(tmp_path.iterdir()), "nothing half-done is left"


@pytest.mark.parametrize("name", [name for name, (_, right) in CALLS.items() if right])
def test_what_is_right_is_taken(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    call, right = CALLS[name]
    for kind in right:
        call(WRONG[kind])


# ---- a system ------------------------------------------------------------------------------------
SYSTEM: dict[str, tuple[Call, type[OrbSlamError]]] = {
    "settings": (lambda x: orb.System(x, "mono"), orb.SettingsError),
    "sensor": (lambda x: orb.System("tum1", x), orb.SettingsError),
    "vocabulary": (lambda x: orb.System("tum1", "mono", x), orb.VocabularyError),
    "callbacks": (lambda x: orb.System("tum1", "mono", callbacks=x), orb.SettingsError),
    "seed": (lambda x: orb.System("tum1", "mono", seed=x), orb.SettingsError),
}


@pytest.mark.parametrize("argument", SYSTEM)
@pytest.mark.parametrize("kind", ["list", "mapping", "fraction", "text", "bytes", "object", "None"])
def test_a_system_of_nothing(argument: str, kind: str) -> None:
    if kind == "None" and argument in ("vocabulary", "callbacks"):
        pytest.skip("None stands for the default")
    call, error = SYSTEM[argument]
    with pytest.raises(error):
        call(WRONG[kind])


def test_the_message_for_a_mapping_says_what_to_give() -> None:
    with pytest.raises(orb.SettingsError, match=r"are a dict; give Settings, .*tum1.*for_camera"):
        orb.System({"fx": 500}, "mono")  # type: ignore[arg-type]
    with pytest.raises(orb.SettingsError, match=r"on_loop is 'print'; give a function"):
        orb.Callbacks(on_loop="print")  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [0, 7, np.int64(3), 2**64 - 1])
def test_seeds_that_are_taken(seed: int) -> None:
    with orb.System("tum1", "mono", seed=seed) as slam:
        assert slam.options.seed == seed


GREY = np.zeros((96, 128), np.uint8)
DEPTH = np.ones((96, 128), np.float32)


@pytest.fixture(scope="module")
def systems() -> Any:
    with (
        orb.System("tum1", "rgbd") as rgbd,
        orb.System("euroc", "stereo") as stereo,
        orb.System("tum1", "mono") as mono,
    ):
        yield {"rgbd": rgbd, "stereo": stereo, "mono": mono}


TRACK: dict[str, tuple[str, Callable[[Any, Any], object], set[str]]] = {
    "image": ("mono", lambda slam, x: slam.track_monocular(x, 1.0), set()),
    "time": ("mono", lambda slam, x: slam.track_monocular(GREY, x), {"negative", "fraction"}),
    "mask": ("mono", lambda slam, x: slam.track_monocular(GREY, 1.0, mask=x), {"None"}),
    "left": ("stereo", lambda slam, x: slam.track_stereo(x, GREY, 1.0), set()),
    "right": ("stereo", lambda slam, x: slam.track_stereo(GREY, x, 1.0), set()),
    "masks": ("stereo", lambda slam, x: slam.track_stereo(GREY, GREY, 1.0, mask=x), {"None"}),
    "two masks": (
        "stereo",
        lambda slam, x: slam.track_stereo(GREY, GREY, 1.0, mask=(x, x)),
        {"None"},
    ),
    "colour": ("rgbd", lambda slam, x: slam.track_rgbd(x, DEPTH, 1.0), set()),
    "depth": ("rgbd", lambda slam, x: slam.track_rgbd(GREY, x, 1.0), set()),
    "source": ("rgbd", lambda slam, x: slam.run(x), {"empty list"}),
    "localization": (
        "mono",
        lambda slam, x: setattr(slam, "localization_mode", x),
        {"true"},
    ),
    "patience": ("mono", lambda slam, x: slam.wait_until_idle(x), {"None", "fraction"}),
    "end": ("mono", lambda slam, x: slam.shutdown(timeout=x), {"None", "fraction"}),
}


@pytest.mark.parametrize("name", TRACK)
def test_what_a_system_does_not_take(name: str, systems: dict[str, orb.System]) -> None:
    sensor, call, right = TRACK[name]
    slam = systems[sensor]
    for kind in WRONG.keys() - right:
        with pytest.raises(OrbSlamError):
            call(slam, WRONG[kind])
    assert slam.n_keyframes == 0


@pytest.mark.parametrize(
    "depth",
    [
        DEPTH.astype(np.longdouble),
        DEPTH.astype(complex),
        DEPTH.astype(object),
        DEPTH > 0,
        DEPTH.astype("datetime64[s]"),
        DEPTH[None],
    ],
)
def test_depth_that_is_no_depth(depth: Any, systems: dict[str, orb.System]) -> None:
    with pytest.raises(orb.ImageError, match="depth"):
        systems["rgbd"].track_rgbd(GREY, depth, 1.0)


def test_views_of_arrays_are_images(systems: dict[str, orb.System]) -> None:
    """Cut, mirrored, every second pixel, read only, in Fortran's order: what NumPy gives."""
    slam = systems["rgbd"]
    slam.reset()
    colour = np.random.default_rng(0).integers(0, 256, (192, 256, 3), np.uint8)
    depth = np.full((192, 256), 2.0)
    fixed = colour[::2, ::-2].copy()
    fixed.setflags(write=False)
    views = [colour[::2, ::2], colour[::-2, ::-2], fixed, np.asfortranarray(fixed), fixed[..., 0]]
    for number, view in enumerate(views):
        record = slam.track_rgbd(view, depth[::2, ::-2], float(number))
        assert record.frame_id == number
