# SPDX-License-Identifier: BSD-3-Clause
"""The system as a caller sees it: accuracy, equal runs, records, wrong calls."""

from __future__ import annotations

import dataclasses
import inspect
import threading
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import (
    Reason,
    Sensor,
    SettingsError,
    StateError,
    System,
    TrackingState,
    VocabularyError,
    _core,
)
from orbslam2py.datasets import Images
from orbslam2py.runs import SystemOptions
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.trajectory import write_tum
from support.scripts import run_script
from support.small_sequences import ate, images, new_system, play, track

pytestmark = pytest.mark.watchdog(30)


# ---- accuracy and consistency --------------------------------------------------------------------
@pytest.mark.parametrize("deterministic", [True, False])
def test_tracks_every_frame(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic, wait_for_mapping=True) as system:
        records = play(system, 60)
        assert system.wait_until_idle(20)
        assert system.check_map() == []
    assert [r.state for r in records] == [TrackingState.OK] * 60
    assert [r.frame_id for r in records] == list(range(60))
    assert all(r.reason is Reason.NONE for r in records)
    assert system.n_keyframes >= 4
    assert system.n_map_points > 500
    trajectory = system.trajectory()
    assert len(trajectory) == 60
    assert not trajectory.lost.any()
    np.testing.assert_array_equal(trajectory.T_wc[0], np.eye(4))
    assert ate(system) < 0.03  # measured: 0.006 to 0.011 m on a way of 2 m


def test_map_is_consistent_after_every_keyframe(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        keyframes = 0
        for i in range(80):
            if track(system, i).is_keyframe:
                keyframes += 1
                assert system.check_map() == []
    assert keyframes >= 5


def test_online_and_final_poses_agree_roughly(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        records = play(system, 40)
    final = system.trajectory()
    for record, T_wc in zip(records, final.T_wc, strict=True):
        assert record.T_wc is not None
        assert np.linalg.norm(record.T_wc[:3, 3] - T_wc[:3, 3]) < 0.05
        assert record.T_cw is not None
        np.testing.assert_allclose(record.T_cw @ record.T_wc, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("deterministic", [True, False])
def test_frames_of_keyframes_lie_on_their_keyframes(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic, wait_for_mapping=True) as system:
        play(system, 50)
        assert system.wait_until_idle(20)
    frames, keyframes = system.trajectory(), system.keyframe_trajectory()
    assert len(keyframes) >= 3
    rows = np.searchsorted(frames.timestamps, keyframes.timestamps)
    np.testing.assert_array_equal(frames.timestamps[rows], keyframes.timestamps)
    # Mapping has moved the keyframes, and the frames with them.
    np.testing.assert_allclose(frames.T_wc[rows], keyframes.T_wc, atol=1e-9)


def test_waiting_for_an_idle_mapper_is_the_deterministic_mode_of_a_single_camera() -> None:
    options = SyntheticOptions(world="corridor", sensor="mono", frames=40, size=(320, 240))
    sequence = SyntheticSequence(options)
    shown = [sequence.load(i).image for i in range(len(sequence))]
    hashes = []
    for mode in ({"deterministic": True}, {"wait_for_mapping": True}):
        with System(sequence.settings, "mono", **mode) as system:  # type: ignore[arg-type]
            for image, timestamp in zip(shown, sequence.timestamps, strict=True):
                system.track_monocular(image, float(timestamp))
            assert system.wait_until_idle(20)
        assert system.n_keyframes >= 3
        hashes.append((system.map_hash(), system.n_keyframes, system.n_map_points))
    assert hashes[0] == hashes[1]


# ---- the same bytes ------------------------------------------------------------------------------
_RUN = """
import sys
from pathlib import Path
from orbslam2py import Sensor
from orbslam2py.trajectory import write_tum
from support.small_sequences import new_system, play

with new_system(Sensor(sys.argv[1]), deterministic=True) as system:
    play(system, 50)
write_tum(Path(sys.argv[2]), system.trajectory())
print(system.map_hash(), system.n_keyframes, system.n_map_points)
"""


def test_deterministic_runs_are_equal(sensor: Sensor, tmp_path: Path) -> None:
    """The original's results differ from run to run (OD-131)."""
    results = []
    for name in ("a", "b"):
        with new_system(sensor, deterministic=True) as system:
            play(system, 50)
        write_tum(tmp_path / name, system.trajectory())
        results.append(f"{system.map_hash()} {system.n_keyframes} {system.n_map_points}")
    done = run_script(_RUN, sensor, tmp_path / "c", timeout=25)
    assert done.returncode == 0, done.stderr
    results.append(done.stdout.strip())
    assert results[0] == results[1] == results[2]
    contents = {(tmp_path / name).read_bytes() for name in "abc"}
    assert len(contents) == 1
    assert contents.pop().count(b"\n") >= 50


def test_other_maps_have_other_hashes() -> None:
    hashes = set()
    for n in (1, 30, 60):
        with new_system(Sensor.RGBD, deterministic=True) as system:
            play(system, n)
        hashes.add(system.map_hash())
    assert len(hashes) == 3


# ---- what a record holds -------------------------------------------------------------------------
def test_first_record(sensor: Sensor) -> None:
    with new_system(sensor) as system:
        assert system.state is TrackingState.NO_IMAGES_YET
        record = track(system, 0)
        assert system.state is record.state is TrackingState.OK
    assert record.is_keyframe
    assert record.frame_id == record.reference_keyframe == record.map_index == 0
    assert record.timestamp == 0.0
    np.testing.assert_array_equal(record.T_cw, np.eye(4))
    assert record.n_inliers == record.n_matches > 100
    assert record.features is None
    assert {"extract", "stereo", "keyframe", "track"} <= record.milliseconds.keys()
    assert record.milliseconds["track"] >= record.milliseconds["extract"] > 0


def test_details(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 10)
        record = track(system, 10, details=True)
        snapshot = system.map_snapshot()
    features = record.features
    assert features is not None
    n = len(features.keypoints)
    assert n > 500
    expected = {
        "keypoints": ((n, 2), np.float32),
        "levels": ((n,), np.int32),
        "depths": ((n,), np.float32),
        "map_point_ids": ((n,), np.int64),
        "inliers": ((n,), np.bool_),
    }
    for name, (shape, dtype) in expected.items():
        array = getattr(features, name)
        assert array.shape == shape, name
        assert array.dtype == dtype, name
    assert features.levels.min() >= 0
    assert features.levels.max() < 8
    known = features.depths > 0
    assert known.sum() > 100
    assert np.all(features.depths[~known] == -1)
    assert features.inliers.sum() == record.n_inliers
    assert np.all(features.map_point_ids[features.inliers] >= 0)
    assert np.isin(features.map_point_ids[features.inliers], snapshot.point_ids).mean() > 0.9


def test_stage_statistics() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        play(system, 40)
    stages = system.stage_statistics()
    tracking = {"extract", "stereo", "predict", "local_map", "keyframe", "track"}
    parts = {"insert", "cull_points", "new_points", "fuse", "cull_keyframes"}
    mapping = {f"mapping.{part}" for part in parts | {"local_bundle_adjustment"}}
    assert stages.keys() >= tracking | mapping | {"mapping"}
    for name, numbers in stages.items():
        assert 0 <= numbers["median"] <= numbers["p99"], name
        assert numbers["mean"] > 0, name
    assert stages["extract"]["count"] == 40
    assert stages["mapping"]["count"] >= system.n_keyframes


def test_covariance_tells_the_spread_of_the_pose() -> None:
    """The pose of one frame under different image noise, against the covariance it is given."""
    clean = [images(Sensor.STEREO, i) for i in (0, 6)]
    rng = np.random.default_rng(3)
    poses, covariances = [], []

    def noisy(image: np.ndarray) -> np.ndarray:
        return np.clip(image + rng.normal(0, 4, image.shape), 0, 255).astype(np.uint8)

    for _ in range(30):
        with new_system(Sensor.STEREO, deterministic=True) as system:
            track(system, 0, shown=clean[0])
            assert clean[1].right is not None
            shown = Images(noisy(clean[1].image), noisy(clean[1].right))
            record = track(system, 1, shown=shown)
        assert record.T_cw is not None
        assert record.covariance is not None
        covariance = record.covariance
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9, atol=1e-18)
        assert np.linalg.eigvalsh(covariance).min() > 0
        poses.append(record.T_cw)
        covariances.append(covariance)
    spread = np.std([T[:3, 3] for T in poses], axis=0)
    predicted = np.sqrt(np.mean([np.diag(c)[3:] for c in covariances], axis=0))
    ratio = spread / predicted
    assert np.all((ratio > 0.5) & (ratio < 2.0)), ratio  # measured: 0.82 to 0.95


# ---- wrong calls ---------------------------------------------------------------------------------
def test_wrong_sensor(sensor: Sensor) -> None:
    """The original ends the process (OD-134)."""
    shown = images(Sensor.STEREO, 0)
    depth = np.ones(shown.image.shape, np.uint16)
    with new_system(sensor) as system:
        with pytest.raises(StateError, match="sensor"):
            if sensor is Sensor.STEREO:
                system.track_rgbd(shown.image, depth, 0.0)
            else:
                assert shown.right is not None
                system.track_stereo(shown.image, shown.right, 0.0)
        with pytest.raises(StateError, match="sensor 'mono'"):
            system.track_monocular(shown.image, 0.0)
        assert system.state is TrackingState.NO_IMAGES_YET
        assert track(system, 0).state is TrackingState.OK, "the system is still usable"


def test_nothing_runs_after_a_failed_construction(tmp_path: Path) -> None:
    bad = tmp_path / "words.bvoc"
    bad.write_bytes(b"no vocabulary")
    with pytest.raises(VocabularyError, match=r"words\.bvoc"):
        System("tum1", "rgbd", bad)
    with pytest.raises(SettingsError, match="no-such-camera"):
        System("no-such-camera", "rgbd")
    with pytest.raises(SettingsError, match="'lidar'; give one of mono, stereo, rgbd"):
        System("tum1", "lidar")


def test_concurrent_call(monkeypatch: pytest.MonkeyPatch) -> None:
    entered, leave = threading.Event(), threading.Event()
    original = _core.to_grey

    def slow(*arguments: object) -> object:
        entered.set()
        assert leave.wait(20)
        return original(*arguments)

    with new_system(Sensor.RGBD, deterministic=True) as system:
        monkeypatch.setattr(_core, "to_grey", slow)
        thread = threading.Thread(target=track, args=(system, 0))
        thread.start()
        assert entered.wait(20)
        with pytest.raises(StateError, match="already running"):
            track(system, 1)
        leave.set()
        thread.join(20)
        assert system.n_keyframes == 1
        assert track(system, 1).frame_id == 1


def test_every_option_is_a_keyword_with_the_same_default() -> None:
    keywords = inspect.signature(System.__init__).parameters
    for option in dataclasses.fields(SystemOptions):
        default = option.default if option.name != "config" else None
        assert keywords[option.name].default == default, option.name
