# SPDX-License-Identifier: BSD-3-Clause
"""A video of a run, decoded again."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py import (
    OutputFileError,
    Reason,
    Sensor,
    TrackingRecord,
    TrackingState,
    Trajectory,
    VideoWriter,
)
from orbslam2py._palette import LOST, MAPPED, NOT_TRACKED, STARTING, TRUTH
from orbslam2py.pictures import Status, compose, draw_status
from orbslam2py.recordings import output_file, video_file
from orbslam2py.slam.records import FrameFeatures
from orbslam2py.viewer import FrameView, Publisher, QueueState
from support.files import names_in
from support.small_disk import small_disk
from support.small_sequences import SIZE, black, new_system, play, sequence, track
from support.videos import read_video, share_of

pytestmark = pytest.mark.watchdog(90)

NOTHING = np.zeros(0, np.int64)


def view(
    image: np.ndarray,
    number: int = 0,
    state: TrackingState = TrackingState.OK,
    keypoints: tuple[tuple[float, float], ...] = (),
    seconds: float | None = None,
) -> FrameView:
    pixels = np.array(keypoints, np.float32).reshape(-1, 2)
    matched = np.full(len(pixels), state is TrackingState.OK)
    record = TrackingRecord(
        frame_id=number,
        timestamp=number / 10 if seconds is None else seconds,
        map_index=0,
        state=state,
        reason=Reason.NONE if state is TrackingState.OK else Reason.NOT_FOUND_IN_MAP,
        T_cw=np.eye(4) if state is TrackingState.OK else None,
        covariance=None,
        n_matches=len(pixels),
        n_inliers=len(pixels),
        is_keyframe=False,
        reference_keyframe=0,
        milliseconds={"track": 12.0},
    )
    colours = np.zeros((0, 3), np.uint8)
    features = FrameFeatures(pixels, NOTHING, NOTHING, np.arange(len(pixels)), matched, colours)
    return FrameView(
        image=image,
        record=record,
        earlier=(),
        features=features,
        pixels=pixels,
        visual_odometry=np.zeros(len(pixels), bool),
        local_points=NOTHING,
        start_lines=None,
        localization=False,
        queue=QueueState(n_frames=number + 1, frames_per_second=10.0),
    )


def test_ground_truth_lies_beside_the_path_as_far_as_it_has_come(tmp_path: Path) -> None:
    truth = sequence(Sensor.RGBD).ground_truth()
    assert truth is not None
    # In a world of its own: turned, and far away.
    T = np.eye(4)
    T[:3, :3] = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]
    T[:3, 3] = (100, 20, -30)
    elsewhere = Trajectory(truth.timestamps, T @ truth.T_wc)
    amounts = []
    for given in (None, elsewhere):
        path = tmp_path / "run.mp4"
        with new_system(Sensor.RGBD, deterministic=True) as system:
            video = VideoWriter(path, ground_truth=given)
            with Publisher(system, [video], every_frame=True):
                play(system, 25)
        pictures, _ = read_video(path)
        box = compose(SIZE, (1280, 720)).map
        parts = [
            picture[box.y : box.y + box.height, box.x : box.x + box.width] for picture in pictures
        ]
        amounts.append([share_of(part, TRUTH, 30) for part in (parts[1], parts[-1])])
    assert amounts[0][1] < 1e-4
    assert amounts[1][0] < 1e-4  # not known yet
    assert amounts[1][1] > 3e-4


def test_the_rate_is_that_of_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However busy the computer is on which a video is made."""
    said: list[float | None] = []

    def note(width: int, status: Status) -> np.ndarray:
        said.append(status.frames_per_second)
        return draw_status(width, status)

    monkeypatch.setattr("orbslam2py.recordings.video.draw_status", note)
    video = VideoWriter(tmp_path / "a.mp4")
    for number in range(40):
        slow = QueueState(n_frames=number, frames_per_second=0.7)
        video.on_frame(replace(view(np.zeros((48, 64), np.uint8), number), queue=slow))
    video.close()
    assert said[0] is None
    assert said[1:] == pytest.approx([10.0] * 39)


def test_a_run_becomes_one_picture_for_each_image(tmp_path: Path) -> None:
    path = tmp_path / "run.mp4"
    n = 14
    with new_system(Sensor.STEREO, deterministic=True) as system:
        video = VideoWriter(path, frames_per_second=20.0, duration=1.0)
        with Publisher(system, [video], every_frame=True):
            play(system, 10)
            for i in range(10, 12):
                track(system, i, shown=black(Sensor.STEREO))
            for i in range(12, n):
                track(system, i)
            assert names_in(tmp_path) != ["run.mp4"], "it appears when it is whole"
    assert names_in(tmp_path) == ["run.mp4"]
    pictures, rate = read_video(path)
    assert len(pictures) == video.n_frames == n
    assert rate == pytest.approx(20.0)
    assert {picture.shape for picture in pictures} == {(720, 1280, 3)}
    places = compose((320, 240), (1280, 720))
    box = places.image
    images = [p[box.y : box.y + box.height, box.x : box.x + box.width] for p in pictures]
    assert share_of(images[9], MAPPED) > 0.002
    assert share_of(images[11], MAPPED) == 0.0, "nothing is found in the dark"
    strips = [p[places.time_line.y :] for p in pictures]
    assert share_of(strips[9], LOST, 80) == 0.0
    assert share_of(strips[11], LOST, 80) > 0.001
    assert share_of(strips[13], MAPPED) > share_of(strips[5], MAPPED)


def test_keypoints_are_marked_where_they_are(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    image = np.full((240, 320), 80, np.uint8)
    video = VideoWriter(path)
    video.on_frame(view(image, keypoints=((60.0, 50.0), (260.0, 190.0))))
    video.close()
    (picture,), _ = read_video(path)
    box = compose((320, 240), (1280, 720)).image
    scale = box.width / 320
    for x, y in ((60.0, 50.0), (260.0, 190.0)):
        u, v = round(box.x + (x + 0.5) * scale), round(box.y + (y + 0.5) * scale)
        assert share_of(picture[v - 12 : v + 12, u - 12 : u + 12], MAPPED, 70) > 0.03
    middle = picture[box.y + 200 : box.y + 300, box.x + 300 : box.x + 400]
    assert np.abs(middle.astype(int) - 80).max() < 12


@pytest.mark.parametrize(
    "shape", [(240, 320), (640, 360, 3), (370, 1226), (64, 64, 3), (1, 1), (2000, 1500), (33, 999)]
)
@pytest.mark.parametrize("size", [(1280, 720), (640, 360), (720, 1280), (320, 240)])
def test_any_size_of_images_and_video(
    tmp_path: Path, shape: tuple[int, ...], size: tuple[int, int]
) -> None:
    path = tmp_path / "a.avi"
    video = VideoWriter(path, size=size)
    video.on_frame(view(np.full(shape, 200, np.uint8)))
    video.close()
    (picture,), _ = read_video(path)
    assert picture.shape == (size[1], size[0], 3)
    box = compose((shape[1], shape[0]), size).image
    u, v = box.x + box.width // 2, box.y + box.height // 2
    assert np.abs(picture[v, u].astype(int) - 200).max() < 25
    assert box.width / box.height == pytest.approx(shape[1] / shape[0], rel=0.25, abs=0.04)


@pytest.mark.parametrize("suffix", [".mp4", ".mov", ".mkv", ".avi", ".webm", ".MP4"])
def test_every_ending_gives_a_video(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    video = VideoWriter(path, size=(320, 240))
    for i in range(3):
        video.on_frame(view(np.full((24, 32), 200, np.uint8), i))
    video.close()
    pictures, _ = read_video(path)
    assert len(pictures) == 3


def test_a_run_that_never_starts(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "a.mp4")
    for i in range(5):
        video.on_frame(view(np.full((240, 320), 90, np.uint8), i, TrackingState.NOT_INITIALIZED))
    video.close()
    pictures, _ = read_video(tmp_path / "a.mp4")
    assert len(pictures) == 5
    assert share_of(pictures[-1], STARTING) > 0.002


def test_without_an_image_there_is_no_file(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "a.mp4")
    video.close()
    video.close()
    assert names_in(tmp_path) == []


def test_a_file_that_was_there_is_replaced_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    path.write_text("old")
    video = VideoWriter(path)
    video.on_frame(view(np.full((24, 32), 200, np.uint8)))
    assert path.read_text() == "old"
    video.close()
    assert len(read_video(path)[0]) == 1


def test_images_that_could_not_be_used_have_their_picture(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    image = np.full((240, 320), 90, np.uint8)
    video = VideoWriter(path)
    video.add_unused(0, 0.0, "unreadable")
    video.add_unused(2, 0.3, "unreadable")
    for number, seconds in ((0, 0.1), (1, 0.2), (2, 0.4)):
        video.on_frame(view(image, number, seconds=seconds))
    video.add_unused(3, 0.5, "unreadable")
    video.close()
    pictures, _ = read_video(path)
    assert len(pictures) == 6
    box = compose((320, 240), (1280, 720)).status
    marks = [p[box.y + 4 : box.y + box.height - 4, box.x : box.x + 3] for p in pictures]
    unused = [share_of(mark, NOT_TRACKED, 40) > 0.5 for mark in marks]
    assert unused == [True, False, False, True, False, True]


def test_in_real_time_a_picture_stays_until_the_next_image(tmp_path: Path) -> None:
    path = tmp_path / "a.mp4"
    video = VideoWriter(path, frames_per_second=10.0, in_time=True)
    for number, seconds in enumerate((5.0, 5.1, 5.6, 5.7)):
        grey = np.full((240, 320), 60 * number + 20, np.uint8)
        video.on_frame(view(grey, number, seconds=seconds))
    video.close()
    pictures, _ = read_video(path)
    box = compose((320, 240), (1280, 720)).image
    shown = [int(p[box.y + 100, box.x + 100, 0]) for p in pictures]
    expected = [20, 80, 80, 80, 80, 80, 140, 200]
    np.testing.assert_allclose(shown, expected, atol=8)


# ---- bad input -----------------------------------------------------------------------------------
def test_places_that_cannot_be_written_are_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "folder.mp4").mkdir()
    for name, words in (
        ("a.gif", r"name it with \.mp4, .* or \.webm"),
        ("none/a.mp4", "there is no folder .*none for a.mp4; make it first"),
        ("folder.mp4", "is a folder"),
    ):
        with pytest.raises(OutputFileError, match=words):
            VideoWriter(tmp_path / name)
    assert names_in(tmp_path) == ["folder.mp4"]


def test_a_codec_that_is_missing_is_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(video_file.CODECS, ".mp4", "none")
    with pytest.raises(OutputFileError, match=r"no encoder for \.mp4 files; take another ending"):
        VideoWriter(tmp_path / "a.mp4")
    assert names_in(tmp_path) == []


@pytest.mark.parametrize("size", [(100, 100), (1281, 720), (1280, 721)])
def test_sizes_that_cannot_be_are_refused(tmp_path: Path, size: tuple[int, int]) -> None:
    with pytest.raises(OutputFileError, match="even"):
        VideoWriter(tmp_path / "a.mp4", size=size)
    assert names_in(tmp_path) == []


@pytest.fixture
def full_disk(tmp_path: Path) -> Iterator[Path]:
    with small_disk(tmp_path / "disk", "3m") as disk:
        yield disk


def noise(number: int) -> FrameView:
    rng = np.random.default_rng(number)
    return view(rng.integers(0, 255, (480, 640, 3), dtype=np.uint8), number)


def test_a_disk_without_room_is_refused_at_once(full_disk: Path) -> None:
    with pytest.raises(OutputFileError, match="the disk is full but for 32 MB"):
        VideoWriter(full_disk / "a.avi")
    assert names_in(full_disk) == []


def test_a_disk_that_becomes_full_keeps_what_was_shown(
    full_disk: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(output_file, "RESERVE", 3 * 2**19)
    path = full_disk / "a.mp4"
    n = 60
    with new_system(Sensor.STEREO, deterministic=True) as system, caplog.at_level(logging.WARNING):
        video = NoisyVideo(path)
        with Publisher(system, [video], every_frame=True):
            records = play(system, n)
    assert len(records) == n, "the run goes on"
    (warning,) = [record.getMessage() for record in caplog.records]
    assert "the video stopped: cannot write the video" in warning
    assert "the disk is full" in warning
    assert "Errno" not in warning
    assert names_in(full_disk) == ["a.mp4"]
    pictures, _ = read_video(path)
    assert 1 < len(pictures) == video.n_frames < n


def test_a_disk_full_to_the_brim_leaves_no_half_file(
    full_disk: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(output_file, "RESERVE", 0)
    path = full_disk / "a.mp4"
    path.write_text("old")
    video = VideoWriter(path)
    for number in range(60):
        video.on_frame(noise(number))
    with pytest.raises(OutputFileError, match="no whole file has come to the disk"):
        video.close()
    assert names_in(full_disk) == ["a.mp4"]
    assert path.read_text() == "old"


class NoisyVideo(VideoWriter):
    """Shows noise, which no codec makes small."""

    def on_frame(self, view: FrameView) -> None:
        super().on_frame(replace(view, image=noise(view.record.frame_id).image))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frames_per_second": 0}, "frames_per_second is 0; give images a second, above 0"),
        ({"frames_per_second": -1}, "frames_per_second is -1"),
        ({"frames_per_second": np.nan}, "frames_per_second is nan"),
        ({"frames_per_second": "a"}, "frames_per_second is 'a'"),
        ({"duration": -1}, "duration is -1; give seconds, 0 or more, or None"),
        ({"duration": "a"}, "duration is 'a'"),
        ({"ground_truth": 3}, "ground_truth is 3; give an orbslam2py.Trajectory, or None"),
    ],
)
def test_rates_durations_and_true_paths_are_those(
    tmp_path: Path, options: dict[str, Any], words: str
) -> None:
    with pytest.raises(OutputFileError, match=words):
        VideoWriter(tmp_path / "desk.avi", **options)
    assert names_in(tmp_path) == []
