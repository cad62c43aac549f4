# SPDX-License-Identifier: BSD-3-Clause
"""The system as a caller sees it: results, modes, control, life cycle."""

from __future__ import annotations

import gc
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import _core
from orbslam2py.datasets.base import Images
from orbslam2py.errors import ImageError, SettingsError, StateError, VocabularyError, WorkerError
from orbslam2py.evaluation import evaluate_trajectory
from orbslam2py.records import Reason, TrackingState
from orbslam2py.sensor import Sensor
from orbslam2py.system import System
from orbslam2py.trajectory import write_tum
from small_sequences import black, images, new_system, play, sequence, track
from watchdog import watchdog, worker_threads

SENSORS = [Sensor.STEREO, Sensor.RGBD]


@pytest.fixture(autouse=True)
def _no_hang_and_no_thread_left() -> Iterator[None]:
    before = worker_threads()
    with watchdog(30):
        yield
        gc.collect()
        assert worker_threads() == before


@pytest.fixture(params=SENSORS)
def sensor(request: pytest.FixtureRequest) -> Sensor:
    return Sensor(request.param)


def ate(system: System) -> float:
    truth = sequence(system.sensor).ground_truth()
    return float(evaluate_trajectory(system.trajectory(), truth).as_dict()["ate_rmse_m"])


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


# ---- the same bytes ------------------------------------------------------------------------------
_RUN = """
import sys
from pathlib import Path
from small_sequences import new_system, play
from orbslam2py.sensor import Sensor
from orbslam2py.trajectory import write_tum

with new_system(Sensor(sys.argv[1]), deterministic=True) as system:
    play(system, 50)
write_tum(Path(sys.argv[2]), system.trajectory())
print(system.map_hash(), system.n_keyframes, system.n_map_points)
"""


def test_deterministic_runs_are_equal(sensor: Sensor, tmp_path: Path) -> None:
    results = []
    for name in ("a", "b"):
        with new_system(sensor, deterministic=True) as system:
            play(system, 50)
        write_tum(tmp_path / name, system.trajectory())
        results.append(f"{system.map_hash()} {system.n_keyframes} {system.n_map_points}")
    command = [sys.executable, "-c", _RUN, str(sensor), str(tmp_path / "c")]
    done = subprocess.run(
        command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=25, check=True
    )
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


def test_snapshot(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 40)
        snapshot = system.map_snapshot()
        k, p = system.n_keyframes, system.n_map_points
    assert snapshot.keyframe_ids.shape == snapshot.keyframe_timestamps.shape == (k,)
    assert snapshot.keyframe_T_wc.shape == (k, 4, 4)
    assert snapshot.point_ids.shape == (p,)
    assert snapshot.point_positions.shape == (p, 3)
    assert np.all(np.diff(snapshot.keyframe_ids) > 0)
    assert np.all(np.diff(snapshot.point_ids) > 0)
    assert np.isfinite(snapshot.point_positions).all()
    keyframes = system.keyframe_trajectory()
    assert len(keyframes) == k
    np.testing.assert_allclose(keyframes.T_wc[0], np.eye(4), atol=1e-12)
    # A keyframe's pose is that of its frame.
    frames = system.trajectory()
    positions = {t: T[:3, 3] for t, T in zip(frames.timestamps, frames.T_wc, strict=True)}
    for t, T_wc in zip(keyframes.timestamps, keyframes.T_wc, strict=True):
        np.testing.assert_allclose(positions[t], T_wc[:3, 3], atol=0.02)


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
    with pytest.raises(ValueError, match="lidar"):
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


# ---- shutdown ------------------------------------------------------------------------------------
def test_shutdown_is_final_and_idempotent(sensor: Sensor) -> None:
    system = new_system(sensor)
    records = play(system, 20)
    system.shutdown()
    system.shutdown()
    with pytest.raises(StateError, match="shut down"):
        track(system, 20)
    assert len(system.trajectory()) == 20
    assert system.n_keyframes >= 1
    assert system.check_map() == []
    assert system.state is records[-1].state


def test_shutdown_without_images(sensor: Sensor) -> None:
    system = new_system(sensor)
    system.shutdown()
    assert len(system.trajectory()) == 0
    assert len(system.keyframe_trajectory()) == 0
    assert system.map_snapshot().point_positions.shape == (0, 3)
    assert system.stage_statistics() == {}


def test_shutdown_without_draining_interrupts_mapping() -> None:
    system = new_system(Sensor.STEREO)
    play(system, 30)
    system.shutdown(drain=False, timeout=20)
    assert len(system.trajectory()) == 30


def test_interrupted_shutdown_can_be_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    system = new_system(Sensor.RGBD)
    play(system, 3)
    with monkeypatch.context() as patch:
        patch.setattr(
            type(system._mapping.worker),
            "finish",
            lambda *_, **__: (_ for _ in ()).throw(KeyboardInterrupt),
        )
        with pytest.raises(KeyboardInterrupt):
            system.shutdown()
    with pytest.raises(StateError):
        track(system, 3)
    system.shutdown()
    assert worker_threads() == []


def test_dropped_system_ends_its_threads() -> None:
    system = new_system(Sensor.RGBD)
    play(system, 10)
    assert {"local mapping", "loop closing"} <= set(worker_threads())
    del system
    gc.collect()
    assert worker_threads() == []


def test_error_of_the_caller_passes_through() -> None:
    with pytest.raises(ZeroDivisionError), new_system(Sensor.RGBD) as system:
        play(system, 5)
        _ = 1 / 0
    assert worker_threads() == []
    assert len(system.trajectory()) == 5


def test_interpreter_ends_without_shutdown() -> None:
    code = (
        "from small_sequences import new_system, play\n"
        "from orbslam2py.sensor import Sensor\n"
        "system = new_system(Sensor.STEREO)\n"
        "play(system, 12)\n"
        "print('end')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        timeout=25,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "end\n", "")


# ---- reset ---------------------------------------------------------------------------------------
@pytest.mark.parametrize("deterministic", [True, False])
def test_reset_while_ok_keeps_the_earlier_map(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic) as system:
        play(system, 20)
        before = system.trajectory()
        system.reset()
        assert len(system.trajectory()) == 20, "carried out at the next call"
        record = track(system, 20)
        assert (record.frame_id, record.map_index, record.is_keyframe) == (0, 1, True)
        play(system, 10, first=21)
        earlier, present = system.trajectories()
        assert system.n_resets == 1
        assert system.check_map() == []
    np.testing.assert_array_equal(earlier.timestamps, before.timestamps)
    assert len(present) == 11
    assert present.timestamps[0] == sequence(sensor).timestamps[20]
    np.testing.assert_array_equal(present.indices, np.arange(11))


def test_reset_before_the_first_image(sensor: Sensor) -> None:
    with new_system(sensor) as system:
        system.reset()
        assert track(system, 0).state is TrackingState.OK
        assert len(system.trajectory()) == 1


def test_deterministic_run_after_a_reset_equals_a_fresh_one() -> None:
    with new_system(Sensor.STEREO, deterministic=True) as system:
        play(system, 25)
        system.reset()
        play(system, 20, first=25)
    with new_system(Sensor.STEREO, deterministic=True) as fresh:
        play(fresh, 20, first=25)
    assert system.map_hash() == fresh.map_hash()
    np.testing.assert_array_equal(system.trajectory().T_wc, fresh.trajectory().T_wc)


@pytest.mark.parametrize("deterministic", [True, False])
def test_lost_and_found_again(sensor: Sensor, deterministic: bool) -> None:
    with new_system(sensor, deterministic=deterministic, wait_for_mapping=True) as system:
        play(system, 75)
        assert system.wait_until_idle(20)
        assert system.n_keyframes > 5, "a smaller map would be given up"
        for i in (75, 76):
            record = track(system, i, shown=black(sensor))
            assert record.state is system.state is TrackingState.LOST
            assert record.reason is Reason.FEW_MATCHES_REFERENCE
            assert record.T_cw is None
            assert record.T_wc is None
            assert record.covariance is None
            assert record.n_inliers == 0
        assert system.n_relocalizations == 0
        found = play(system, 3, first=77)
        assert [r.state for r in found] == [TrackingState.OK] * 3
        assert found[0].map_index == 0
        assert system.n_relocalizations == 1
    trajectory = system.trajectory()
    assert len(trajectory) == 80
    assert np.flatnonzero(trajectory.lost).tolist() == [75, 76]
    assert ate(system) < 0.05


def test_reset_while_lost(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 75)
        assert track(system, 75, shown=black(sensor)).state is TrackingState.LOST
        assert system.n_resets == 0
        system.reset()
        record = track(system, 76)
        assert record.state is TrackingState.OK
        assert record.map_index == 1
        assert [len(t) for t in system.trajectories()] == [76, 1]


def test_a_young_map_is_given_up_when_lost(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        play(system, 5)
        assert track(system, 5, shown=black(sensor)).state is TrackingState.LOST
        record = track(system, 6, shown=black(sensor))
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason is Reason.TOO_FEW_KEYPOINTS
        assert record.map_index == 1
        assert track(system, 7).state is TrackingState.OK
        assert system.n_resets == 1
        assert [len(t) for t in system.trajectories()] == [5, 1]


# ---- a worker that fails -------------------------------------------------------------------------
class BrokenError(RuntimeError):
    """Thrown into a worker."""


def breaks(*_: object, **__: object) -> None:
    raise BrokenError("out of order")


@pytest.mark.parametrize("deterministic", [True, False])
@pytest.mark.parametrize("verb", ["process_new_keyframe", "create_new_points", "cull_keyframes"])
def test_failed_mapping_reaches_the_caller(
    monkeypatch: pytest.MonkeyPatch, deterministic: bool, verb: str
) -> None:
    system = new_system(Sensor.RGBD, deterministic=deterministic)
    play(system, 10)
    system.wait_until_idle(20)
    monkeypatch.setattr(_core, verb, breaks)
    with pytest.raises(WorkerError, match="local mapping stopped: out of order") as caught:
        play(system, 60, first=10)
    assert isinstance(caught.value.__cause__, BrokenError)
    with pytest.raises(WorkerError):
        track(system, 79)
    with pytest.raises(WorkerError) as caught:
        system.shutdown(timeout=20)
    assert isinstance(caught.value.__cause__, BrokenError)
    system.shutdown()
    assert len(system.trajectory()) >= 10, "what was tracked is not lost"


@pytest.mark.parametrize("deterministic", [True, False])
def test_failed_loop_closing_reaches_the_caller(
    monkeypatch: pytest.MonkeyPatch, deterministic: bool
) -> None:
    system = new_system(Sensor.RGBD, deterministic=deterministic)
    monkeypatch.setattr(system._loop_closing.worker, "_step", breaks)
    with pytest.raises(WorkerError, match="loop closing stopped: out of order") as caught:
        play(system, 80)
        system.wait_until_idle(20)
    assert isinstance(caught.value.__cause__, BrokenError)
    with pytest.raises(WorkerError, match="loop closing stopped") as caught:
        system.shutdown(timeout=20)
    assert isinstance(caught.value.__cause__, BrokenError)


def test_failure_is_raised_at_the_end_of_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(_core, "process_new_keyframe", breaks)
    with pytest.raises(WorkerError, match="out of order"), new_system(Sensor.RGBD) as system:
        track(system, 0)
    assert worker_threads() == []


def test_failure_in_the_block_is_reported_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(_core, "process_new_keyframe", breaks)
    deterministic = new_system(Sensor.RGBD, deterministic=True)
    with pytest.raises(WorkerError, match="out of order"), deterministic as system:
        track(system, 0)
    assert caplog.text == ""


# ---- bad images ----------------------------------------------------------------------------------
def test_bad_time_stamps(sensor: Sensor) -> None:
    with new_system(sensor, deterministic=True) as system:
        track(system, 0, timestamp=1.0)
        for bad in (1.0, 0.5, float("nan"), float("inf"), -float("inf")):
            with pytest.raises(ImageError, match="time stamp"):
                track(system, 1, timestamp=bad)
        assert track(system, 1, timestamp=1.05).frame_id == 1, "refused images are not counted"
        system.reset()
        with pytest.raises(ImageError, match="must grow"):
            track(system, 2, timestamp=1.0)


GREY = np.zeros((240, 320), np.uint8)

BAD_IMAGES = {
    "no array": ([[1, 2], [3, 4]], "NumPy array, got list"),
    "None": (None, "got NoneType"),
    "float": (GREY.astype(np.float32), "uint8, got float32"),
    "16 bits": (GREY.astype(np.uint16), "uint8, got uint16"),
    "empty": (np.zeros((0, 0), np.uint8), "empty"),
    "one dimension": (np.zeros(100, np.uint8), "shape"),
    "two channels": (np.zeros((240, 320, 2), np.uint8), "shape"),
    "four dimensions": (np.zeros((1, 240, 320, 3), np.uint8), "shape"),
    "another size": (np.zeros((200, 320), np.uint8), "size"),
}


@pytest.mark.parametrize("place", ["image", "second"])
@pytest.mark.parametrize("kind", BAD_IMAGES)
def test_bad_images_change_nothing(sensor: Sensor, kind: str, place: str) -> None:
    bad, message = BAD_IMAGES[kind]
    if sensor is Sensor.RGBD and place == "second":
        if kind in {"float", "16 bits", "another size"}:
            pytest.skip("allowed for depth, or tested below")
        message = "depth"
    with new_system(sensor, deterministic=True) as system:
        play(system, 3)
        before = system.map_hash()
        good = images(sensor, 3)
        second = good.right if sensor is Sensor.STEREO else good.depth
        image, second = (bad, second) if place == "image" else (good.image, bad)
        shown = Images(image, second, second)  # type: ignore[arg-type]
        call = system.track_stereo if sensor is Sensor.STEREO else system.track_rgbd
        with pytest.raises(ImageError, match=message):
            call(shown.image, second, 10.0)  # type: ignore[operator]
        assert system.map_hash() == before
        record = track(system, 3)
        assert (record.state, record.frame_id) == (TrackingState.OK, 3)


def test_stereo_images_of_different_size() -> None:
    shown = images(Sensor.STEREO, 0)
    assert shown.right is not None
    with new_system(Sensor.STEREO) as system:
        with pytest.raises(ImageError, match=r"differ: shapes \(240, 320\) and \(240, 300\)"):
            system.track_stereo(shown.image, shown.right[:, :300], 0.0)
        with pytest.raises(ImageError, match="differ"):
            system.track_stereo(np.dstack([shown.image] * 3), shown.right, 0.0)
        assert track(system, 0).state is TrackingState.OK


@pytest.mark.parametrize("size", [(1, 1), (5, 4), (30, 30), (240, 1), (1, 320)])
def test_a_refused_first_image_does_not_fix_the_size(sensor: Sensor, size: tuple[int, int]) -> None:
    tiny = np.zeros(size, np.uint8)
    with new_system(sensor) as system:
        try:
            shown = Images(tiny, tiny, tiny.astype(np.uint16))
            assert track(system, 0, shown=shown).state is TrackingState.NOT_INITIALIZED
        except ImageError as error:
            assert "too small" in str(error)
            assert track(system, 0).state is TrackingState.OK
        else:
            with pytest.raises(ImageError, match="the first image had"):
                track(system, 1)


@pytest.mark.parametrize(
    "depth",
    [
        np.zeros((240, 320), np.uint16),
        np.full((240, 320), np.nan, np.float32),
        np.full((240, 320), np.inf, np.float32),
        np.full((240, 320), -1.0, np.float64),
    ],
    ids=["zero", "NaN", "infinite", "negative"],
)
def test_depth_without_information(depth: np.ndarray) -> None:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        first = images(Sensor.RGBD, 0)
        record = track(system, 0, shown=Images(first.image, depth=depth))
        assert record.state is TrackingState.NOT_INITIALIZED
        assert record.reason is Reason.TOO_FEW_DEPTHS
        play(system, 10, first=1)
        # In the middle the map carries on: the points are known already.
        shown = images(Sensor.RGBD, 11)
        for i in (11, 12):
            assert (
                track(system, i, shown=Images(shown.image, depth=depth)).state is TrackingState.OK
            )
        assert track(system, 13).state is TrackingState.OK
        assert system.check_map() == []
        assert np.isfinite(system.trajectory().T_wc).all()


@pytest.mark.parametrize("metres", [1e-30, 1e-3, 1e6, 1e30])
def test_absurd_depth_does_no_harm(metres: float) -> None:
    shown = images(Sensor.RGBD, 0)
    absurd = Images(shown.image, depth=np.full((240, 320), metres * 5000, np.float32))
    with new_system(Sensor.RGBD, deterministic=True) as system:
        for i in range(3):
            track(system, i, shown=absurd)
        assert np.isfinite(system.map_snapshot().point_positions).all()
        system.reset()
        play(system, 10, first=3)
        for i in (13, 14):
            track(system, i, shown=absurd)
        records = play(system, 5, first=15)
        assert records[-1].state is TrackingState.OK
        assert system.check_map() == []
        assert np.isfinite(system.trajectory().T_wc).all()
        assert np.isfinite(system.map_snapshot().point_positions).all()


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4", "i4", "i8", "f2", "f4", "f8", ">u2", ">f4"])
def test_depth_of_any_number_type(dtype: str) -> None:
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    metres = np.asarray(shown.depth, np.float64) / 5000
    raw = np.minimum(np.rint(metres * 20), 255).astype(dtype)
    settings = sequence(Sensor.RGBD).settings
    assert settings.depth is not None
    settings = replace(settings, depth=replace(settings.depth, raw_per_metre=20.0))
    with System(settings, "rgbd", deterministic=True) as system:
        record = system.track_rgbd(shown.image, raw, 0.0, details=True)
    assert record.features is not None
    depths = record.features.depths
    assert 0.3 < np.median(depths[depths > 0]) < 20


def test_arrays_of_any_layout_give_the_same_result() -> None:
    shown = images(Sensor.RGBD, 0)
    assert shown.depth is not None
    image, depth = shown.image, shown.depth
    frozen = image.copy()
    frozen.setflags(write=False)
    colour = np.dstack([image] * 3)
    layouts = {
        "as is": (image, depth),
        "with one channel": (image[:, :, None], depth),
        "Fortran order": (np.asfortranarray(image), np.asfortranarray(depth)),
        "reversed twice": (image[::-1].copy()[::-1], depth[:, ::-1].copy()[:, ::-1]),
        "every second column": (np.repeat(image, 2, axis=1)[:, ::2], depth),
        "read-only": (frozen, depth),
        "colour": (colour, depth),
        "colour with alpha": (np.dstack([colour, image]), depth),
        "a view of a larger image": (np.pad(image, 7)[7:-7, 7:-7], depth),
    }
    hashes = {}
    for name, (first, second) in layouts.items():
        with new_system(Sensor.RGBD, deterministic=True) as system:
            system.track_rgbd(first, second, 0.0)
        hashes[name] = system.map_hash()
    assert len(set(hashes.values())) == 1, hashes
