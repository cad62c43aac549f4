# SPDX-License-Identifier: BSD-3-Clause
"""Maps that outlive the program: saved while it runs, loaded, used and extended."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from orbslam2py import (
    MapFileError,
    Reason,
    Sensor,
    SettingsError,
    StateError,
    System,
    TrackingState,
)
from orbslam2py.maps import load_map, save_map
from support import small_sequences
from support.saved_maps import FRAMES, small_map
from support.small_sequences import black, images, sequence, track


def _loaded(**options: object) -> System:
    return System(load_map=small_map(), deterministic=True, **options)  # type: ignore[arg-type]


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3]))


def test_a_loaded_map_starts_lost_and_is_searched(tmp_path: Path) -> None:
    path = tmp_path / "small.orbmap"
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        small_sequences.play(slam, 30)
        slam.save_map(path)
        hash_before = slam.map_hash()
        mapped = slam.trajectory().T_wc
    with System(load_map=path, deterministic=True) as slam:
        assert slam.state is TrackingState.LOST
        assert slam.sensor is Sensor.RGBD
        assert slam.settings == sequence(Sensor.RGBD).settings
        assert slam.map_hash() == hash_before
        slam.localization_mode = True
        nothing = track(slam, 0, shown=black(Sensor.RGBD), timestamp=-1.0)
        assert nothing.state is TrackingState.LOST
        assert nothing.reason is Reason.SEARCHING_LOADED_MAP
        records = small_sequences.play(slam, 30)
        assert all(record.state is TrackingState.OK for record in records)
        assert max(_apart(r.T_wc, T) for r, T in zip(records, mapped, strict=True)) < 0.02
        assert slam.map_hash() == hash_before
        assert slam.n_relocalizations == 1


def test_nothing_in_view_never_begins_another_map() -> None:
    with _loaded() as slam:
        for i in range(5):
            record = track(slam, 0, shown=black(Sensor.RGBD), timestamp=float(i))
            assert (record.state, record.map_index) == (TrackingState.LOST, 0)
        assert record.reason is Reason.SEARCHING_LOADED_MAP
        assert slam.n_resets == 0
        assert slam.n_keyframes == len(small_map().contents.keyframes)
        assert len(slam.trajectory()) == 5
        assert slam.trajectory().lost.all()


def test_a_map_is_extended_where_it_ends() -> None:
    with _loaded() as slam:
        before = set(slam.map_contents().keyframes.ids.tolist())
        records = small_sequences.play(slam, 80 - (FRAMES - 10), first=FRAMES - 10)
        assert sum(record.state is TrackingState.OK for record in records) > 40
        after = set(slam.map_contents().keyframes.ids.tolist())
        assert len(after - before) >= 2
        assert slam.check_map() == []
        truth = sequence(Sensor.RGBD).ground_truth().T_wc
        last = records[-1]
        T_wc = np.linalg.inv(truth[0]) @ truth[79]
        assert _apart(last.T_wc, T_wc) < 0.1


def test_what_follows_a_load_is_the_same_every_time() -> None:
    hashes = []
    for _ in range(2):
        with _loaded() as slam:
            small_sequences.play(slam, 20, first=FRAMES - 5)
            hashes.append(slam.map_hash())
    assert hashes[0] == hashes[1]


def test_an_extended_map_keeps_the_runs_that_made_it(tmp_path: Path) -> None:
    path = tmp_path / "extended.orbmap"
    with _loaded(seed=5) as slam:
        small_sequences.play(slam, 15, first=FRAMES - 5)
        slam.save_map(path)
        present = slam.trajectory()
    saved = load_map(path)
    assert [run.seed for run in saved.runs] == [0, 5]
    assert len(saved.trajectory(0)) == FRAMES
    assert np.allclose(saved.trajectory().T_wc, present.T_wc, atol=1e-9)
    earlier, now = small_map().trajectory().T_wc, saved.trajectory(0).T_wc
    assert max(_apart(a, b) for a, b in zip(earlier, now, strict=True)) < 0.05


def test_a_guess_of_the_pose_is_tried_first() -> None:
    T_wc = small_map().trajectory().T_wc[FRAMES // 2]
    near = T_wc.copy()
    near[:3, 3] += 0.03
    with _loaded(initial_pose=near) as slam:
        record = track(slam, FRAMES // 2)
        assert record.state is TrackingState.OK
        assert _apart(record.T_wc, T_wc) < 0.02
    far = T_wc.copy()
    far[:3, 3] += 100
    with _loaded(initial_pose=far) as slam:
        assert track(slam, FRAMES // 2).state is TrackingState.OK


def test_a_guess_alone_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    T_wc = small_map().trajectory().T_wc[FRAMES // 2]
    with _loaded(initial_pose=T_wc) as slam:
        slam.pipeline.back_end.keyframe_index.clear()  # nothing looks like anything
        assert track(slam, FRAMES // 2).state is TrackingState.OK
    with _loaded() as slam:
        slam.pipeline.back_end.keyframe_index.clear()
        assert track(slam, FRAMES // 2).reason is Reason.SEARCHING_LOADED_MAP


@pytest.mark.parametrize(
    "pose", [np.eye(3), "here", np.full((4, 4), np.nan), np.diag([1.0, 1.0, -1.0, 1.0])]
)
def test_a_guess_that_is_no_pose_is_refused(pose: object) -> None:
    with pytest.raises(SettingsError, match="initial_pose must be"):
        _loaded(initial_pose=pose)


def test_a_reset_begins_a_map_of_its_own() -> None:
    with _loaded() as slam:
        slam.reset()
        record = track(slam, 0)
        assert (record.state, record.map_index) == (TrackingState.OK, 1)


# ---- another setup ----------------------------------------------------------------------------
def test_another_camera_is_told_and_refused() -> None:
    settings = sequence(Sensor.RGBD).settings
    other = dataclasses.replace(settings, camera=dataclasses.replace(settings.camera, fx=300.0))
    with pytest.raises(SettingsError, match=r"another camera: Camera\.fx is 300"):
        _loaded(settings=other)
    with _loaded(settings=other, allow_other_setup=True) as slam:
        assert slam.settings == other


def test_another_place_of_keypoints_is_told_and_refused() -> None:
    settings = sequence(Sensor.RGBD).settings
    orb = dataclasses.replace(settings.orb, original_coordinates=True)
    told = r"ORBextractor\.originalCoordinates is 1, in the map 0"
    with pytest.raises(SettingsError, match=told):
        _loaded(settings=dataclasses.replace(settings, orb=orb))


def test_the_rate_of_the_images_may_change() -> None:
    settings = sequence(Sensor.RGBD).settings
    other = dataclasses.replace(settings, camera=dataclasses.replace(settings.camera, fps=5.0))
    with _loaded(settings=other) as slam:
        assert slam.settings.camera.fps == 5.0


def test_another_sensor_is_refused() -> None:
    with pytest.raises(SettingsError, match="made for sensor 'rgbd', not for 'mono'"):
        _loaded(sensor="mono", allow_other_setup=True)


def test_another_vocabulary_is_refused() -> None:
    saved = small_map()
    other = dataclasses.replace(saved.vocabulary, name="other.bvoc", hash="0" * 16)
    spoilt = dataclasses.replace(saved, vocabulary=other)
    with pytest.raises(MapFileError, match=r"vocabulary other\.bvoc"):
        System(load_map=spoilt)
    with System(load_map=spoilt, allow_other_setup=True, deterministic=True) as slam:
        assert track(slam, 10).state is TrackingState.OK


def test_settings_are_needed_without_a_map() -> None:
    with pytest.raises(SettingsError, match="sensor="):
        System()
    with pytest.raises(SettingsError, match="settings are missing"):
        System(sensor="rgbd")
    with pytest.raises(SettingsError, match="load one"):
        small_sequences.new_system(Sensor.RGBD, initial_pose=np.eye(4))


# ---- while it runs ----------------------------------------------------------------------------
def test_a_map_is_saved_from_other_threads_while_it_grows(tmp_path: Path) -> None:
    failures: list[Exception] = []
    with small_sequences.new_system(Sensor.RGBD, wait_for_mapping=True) as slam:
        small_sequences.play(slam, 5)
        slam.wait_until_idle()
        stop = threading.Event()

        def save(name: str) -> None:
            try:
                while not stop.is_set():
                    slam.save_map(tmp_path / name)
                    load_map(tmp_path / name)
            except Exception as error:
                failures.append(error)

        threads = [threading.Thread(target=save, args=(f"{i}.orbmap",)) for i in range(2)]
        for thread in threads:
            thread.start()
        small_sequences.play(slam, 30, first=5)
        stop.set()
        for thread in threads:
            thread.join()
        assert failures == []
        slam.wait_until_idle()
        slam.save_map(tmp_path / "0.orbmap")
        contents = slam.map_contents()
    assert contents.first_difference(load_map(tmp_path / "0.orbmap").contents) is None


def test_there_is_nothing_to_save_before_the_first_keyframe(tmp_path: Path) -> None:
    with (
        small_sequences.new_system(Sensor.RGBD) as slam,
        pytest.raises(MapFileError, match="no keyframes"),
    ):
        slam.save_map(tmp_path / "map.orbmap")
    assert list(tmp_path.iterdir()) == []


def test_autosave_keeps_a_file_up_to_date(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with small_sequences.new_system(Sensor.RGBD, wait_for_mapping=True) as slam:
        slam.autosave(path, every=0.02)
        small_sequences.play(slam, 40)
        slam.wait_until_idle()
        deadline = time.monotonic() + 60
        while not (path.exists() and len(load_map(path).contents.keyframes) == slam.n_keyframes):
            assert time.monotonic() < deadline
        slam.save_map(path)
        contents = slam.map_contents()
    loaded = load_map(path)
    trajectory = slam.trajectory()
    assert contents.first_difference(loaded.contents) is None
    assert np.allclose(loaded.trajectory().T_wc, trajectory.T_wc, atol=1e-9)
    assert [file.name for file in tmp_path.iterdir()] == ["map.orbmap"]


def test_a_new_map_is_autosaved_beside_the_old_one(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        slam.autosave(path, every=1000)
        small_sequences.play(slam, 30)
        slam.save_map(path)
        old = slam.map_contents()
        slam.reset()
        small_sequences.play(slam, 10)
        new = slam.map_contents()
    assert old.first_difference(load_map(path).contents) is None
    assert new.first_difference(load_map(tmp_path / "map-1.orbmap").contents) is None


def test_autosave_needs_seconds(tmp_path: Path) -> None:
    with small_sequences.new_system(Sensor.RGBD) as slam:
        for every in (0.0, -1.0, float("nan"), "a"):
            with pytest.raises(StateError, match=r"seconds"):
                slam.autosave(tmp_path / "map.orbmap", every)  # type: ignore[arg-type]


def test_where_no_map_can_be_written_no_autosave_begins(tmp_path: Path) -> None:
    mine = tmp_path / "mine.txt"
    mine.write_text("not a map")
    n_threads = threading.active_count()
    with small_sequences.new_system(Sensor.RGBD, deterministic=True) as slam:
        for path in (tmp_path / "none" / "map.orbmap", tmp_path, mine, None, b"map", ""):
            with pytest.raises(MapFileError):
                slam.autosave(path, every=1000)  # type: ignore[arg-type]
        small_sequences.play(slam, 5)
    with pytest.raises(StateError, match="shut down"):
        slam.autosave(tmp_path / "map.orbmap")
    assert threading.active_count() == n_threads
    assert [file.name for file in tmp_path.iterdir()] == ["mine.txt"]
    assert mine.read_text() == "not a map"


def test_a_last_autosave_that_fails_is_told(tmp_path: Path) -> None:
    slam = small_sequences.new_system(Sensor.RGBD, deterministic=True)
    folder = tmp_path / "folder"
    folder.mkdir()
    slam.autosave(folder / "map.orbmap", every=1000)
    small_sequences.play(slam, 5)
    folder.rmdir()
    with pytest.raises(MapFileError, match="make the folder"):
        slam.shutdown()


_SAVES_AND_IS_KILLED = """
import os, signal, sys
from orbslam2py.maps import load_map
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_writer import MapWriter
first, second, path = load_map(sys.argv[1]), load_map(sys.argv[2]), sys.argv[3]
writer = MapWriter(path)
writer.commit(all_rows(first))
def rows():
    for n, row in enumerate(all_rows(second)):
        if n == 25:
            os.kill(os.getpid(), signal.SIGKILL)
        yield row
writer.commit(rows())
"""


def test_a_kill_in_the_middle_of_a_save_leaves_the_last_one(tmp_path: Path) -> None:
    save_map(small_map(frames=20), tmp_path / "a.orbmap")
    save_map(small_map(), tmp_path / "b.orbmap")
    path = tmp_path / "map.orbmap"
    arguments = [str(tmp_path / "a.orbmap"), str(tmp_path / "b.orbmap"), str(path)]
    done = subprocess.run([sys.executable, "-c", _SAVES_AND_IS_KILLED, *arguments], check=False)
    assert done.returncode == -9
    assert small_map(frames=20).contents.first_difference(load_map(path).contents) is None
    save_map(small_map(), path)  # the log that the killed program left does not spoil the new file
    assert small_map().contents.first_difference(load_map(path).contents) is None


def test_images_of_the_keyframes_are_kept() -> None:
    saved = small_map()
    ids = saved.contents.keyframes.ids.tolist()
    assert set(saved.images) == set(ids)
    picture = cv2.imdecode(np.frombuffer(saved.images[ids[-1]], np.uint8), cv2.IMREAD_GRAYSCALE)
    row = saved.contents.keyframes.row_of(ids[-1])
    shown = images(Sensor.RGBD, int(saved.contents.keyframes.frame_ids[row])).image
    grey = shown.astype(float) if shown.ndim == 2 else shown.mean(2)
    assert picture.shape == grey.shape
    assert np.abs(picture - grey).mean() < 8


def test_ten_turns_of_save_reset_load_in_one_process(tmp_path: Path) -> None:
    path = tmp_path / "map.orbmap"
    expected = small_map().contents
    source: object = small_map()
    for _ in range(3):
        with System(load_map=source, deterministic=True) as slam:  # type: ignore[arg-type]
            slam.save_map(path)
            slam.reset()
        source = path
        assert expected.first_difference(load_map(path).contents) is None
