# SPDX-License-Identifier: BSD-3-Clause
"""A run long past in the viewer."""

from __future__ import annotations

import json
import shutil
import socket
import threading
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import DatasetError, MapFileError, Sensor, Trajectory, run_sequence
from orbslam2py._palette import KEYFRAME
from orbslam2py.maps import MapArrays
from orbslam2py.runs import RunOptions, SystemOptions
from orbslam2py.runs.report_page import read_run
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence
from orbslam2py.viewer.replay import Replay
from support.browser import Browser
from support.small_sequences import sequence
from support.viewer_pages import (
    amount,
    click_on,
    map_part,
    open_viewer,
    wait_until,
    wait_until_seen,
)

pytestmark = pytest.mark.watchdog(200)
pytest.importorskip("viser", reason="the viewer's extra is not installed")

N_FRAMES = 30


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "run"
    options = RunOptions(Sensor.RGBD, SystemOptions(deterministic=True), max_frames=N_FRAMES)
    run_sequence(sequence(Sensor.RGBD), options, output=folder)
    return folder


@pytest.fixture
def replay(folder: Path) -> Iterator[Replay]:
    replay = Replay(read_run(folder), sequence(Sensor.RGBD), port=0)
    yield replay
    replay.stop()


def test_the_map_in_the_folder_is_that_of_the_run(folder: Path) -> None:
    arrays = MapArrays.load(folder / "map.npz")
    assert len(arrays.keyframe_ids) == len((folder / "keyframes.txt").read_text().splitlines())
    assert np.array_equal(arrays.keyframe_T_wc[0], np.eye(4))
    assert len(arrays.point_ids) > 500
    assert np.isin(arrays.point_first_keyframes, arrays.keyframe_ids).all()
    assert len(arrays.spanning_tree) == len(arrays.keyframe_ids) - 1


def test_at_every_time_the_map_is_as_far_as_it_was_seen(replay: Replay, folder: Path) -> None:
    arrays = MapArrays.load(folder / "map.npz")
    model = replay.page.model
    sizes = []
    for position in (N_FRAMES - 1, 0, 12, 5):
        replay._move_to(position)
        wait_until(lambda wanted=position: replay.position == wanted, "the image")
        now = sequence(Sensor.RGBD).timestamps[position]
        with replay.page.lock:
            assert (model.keyframe_timestamps <= now + 1e-6).all()
            shown = np.sort(np.concatenate([part.ids for part in model.points.values()]))
            first = arrays.point_first_keyframes[np.isin(arrays.point_ids, shown)]
            assert np.isin(first, model.keyframe_ids).all()
            sizes.append(len(shown))
    assert sizes[0] == len(arrays.point_ids)
    assert sizes[1] <= sizes[3] <= sizes[2] <= sizes[0]
    assert sizes[1] < sizes[0]


def test_it_is_seen_and_played(replay: Replay) -> None:
    with Browser() as browser:
        page = open_viewer(browser, replay.address)
        wait_until_seen(
            page, lambda seen: amount(map_part(seen), KEYFRAME, 40) > 60, "keyframes of the run"
        )
        seen = wait_until_seen(page, lambda seen: seen[80:380, 20:400].std() > 30, "the image")
        assert seen.shape[2] == 3
        page.wait_for("document.body.innerText.includes('image 29, ')")
        click_on(page, "Play")
        wait_until(lambda: replay.position < N_FRAMES - 1, "the beginning")
        wait_until(lambda: replay.position == N_FRAMES - 1, "the end")
        page.close()


def test_without_the_sequence_the_images_in_the_folder_are_shown(folder: Path) -> None:
    replay = Replay(read_run(folder), port=0)
    try:
        wait_until(lambda: replay.position == N_FRAMES - 1, "the last image")
        with zipfile.ZipFile(folder / "frame_images.zip") as archive:
            kept = sorted(int(Path(name).stem) for name in archive.namelist())
        for position in (kept[-1], kept[0]):
            shown = replay._picture(position)
            assert shown is not None
            assert shown.std() > 20
            assert f"shown is image {position}" in replay._note(position)
    finally:
        replay.stop()


def test_a_map_that_is_cut_off_is_named(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    data = (copy / "map.npz").read_bytes()
    (copy / "map.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(MapFileError, match=r"map\.npz is no file of a map, or not whole"):
        Replay(read_run(copy), port=0)


def test_a_run_that_saw_nothing_is_named(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    header = (copy / "frames.csv").read_text().splitlines()[0]
    (copy / "frames.csv").write_text(header + "\n")
    report = json.loads((copy / "report.json").read_text())
    (copy / "report.json").write_text(json.dumps(report | {"seen_frames": 0}))
    with pytest.raises(DatasetError, match="lists no frames; give the folder of a run that saw"):
        Replay(read_run(copy), port=0)


def test_a_page_that_could_not_be_filled_is_no_more(folder: Path) -> None:
    class Untrue(SyntheticSequence):
        def ground_truth(self) -> Trajectory:
            raise DatasetError("groundtruth.txt:3: 'x' is not a number")

    run = read_run(folder)
    images = Untrue(SyntheticOptions(world="corridor", sensor="rgbd", frames=N_FRAMES))
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.raises(DatasetError, match=r"groundtruth\.txt:3"):
        Replay(run, images, port=port)
    assert not any(thread.name == "viewer page" for thread in threading.enumerate())
    replay = Replay(run, port=port)  # which is free again
    replay.stop()


def test_without_a_map_the_path_is_shown_and_that_is_said(
    folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    copy = tmp_path / "run"
    shutil.copytree(folder, copy)
    (copy / "map.npz").unlink()
    run = read_run(copy)
    Replay(run, port=0).stop()
    assert run.map is None
    assert len(run.path) == N_FRAMES
    assert "only the path is shown" in caplog.text
