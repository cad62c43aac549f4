# SPDX-License-Identifier: BSD-3-Clause
"""Time stamps of lists: unit, order, equal ones, clocks that were set back."""

from __future__ import annotations

import itertools
import logging
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbslam2py import DatasetError, Sensor, open_sequence
from orbslam2py.datasets.clock import read_clock, unit_of, value_of, was_set_back
from orbslam2py.datasets.time_files import read_time_file

FPS = 20.0
N = 8
STEP = 50_000_000


@pytest.mark.parametrize(
    ("first", "digits"), [(0, 3), (0, 6), (0, 9), (1_700_000_000, 3), (1_700_000_000, 9)]
)
@pytest.mark.parametrize("fps", [FPS, None])
def test_units(first: int, digits: int, fps: float | None) -> None:
    if fps is None and first == 0 and digits == 3:
        pytest.skip("50 s from image to image may be meant")
    times = [first * 10**digits + k * 10**digits // 20 for k in range(N)]
    clock = read_clock("list", [str(time) for time in times], fps)
    assert clock.nanoseconds == tuple(first * 10**9 + k * STEP for k in range(N))
    assert float(clock.texts[1]) == pytest.approx(first + 0.05)


def test_seconds_keep_their_text() -> None:
    texts = ["1305031102.175304", "1305031102.211214", "1305031102.243211"]
    assert read_clock("list", texts, 30.0).texts == tuple(texts)


@pytest.mark.parametrize("step", [0.02, 0.05, 1.0, 10.0])
def test_images_that_were_left_out_change_no_unit(step: float) -> None:
    assert unit_of([value_of("", str(k * step)) for k in range(N)], FPS) == 0


def test_dates_are_seconds_since_1970(caplog: pytest.LogCaptureFixture) -> None:
    texts = ["2011-09-26 13:02:25.964389445", "2011-09-26T13:02:26.064389445Z"]
    clock = read_clock("list", texts, 10.0)
    assert clock.texts == ("1317042145.964389445", "1317042146.064389445")
    assert caplog.text == ""


def test_a_list_in_another_order_is_sorted(caplog: pytest.LogCaptureFixture) -> None:
    clock = read_clock("list", [str(k / FPS) for k in reversed(range(N))], FPS)
    assert clock.order == tuple(reversed(range(N)))
    assert "they are sorted" in caplog.text


def test_one_line_at_a_wrong_place_is_sorted() -> None:
    times = [0.0, 0.05, 0.1, 0.35, 0.15, 0.2, 0.25, 0.3, 0.4, 0.45, 0.5, 0.55]
    clock = read_clock("list", list(map(str, times)), FPS)
    assert [times[place] for place in clock.order] == sorted(times)


@pytest.mark.parametrize("back", [0.275, 3600.0])
def test_a_clock_that_was_set_back_goes_on(back: float, caplog: pytest.LogCaptureFixture) -> None:
    times = [5000 + k / FPS - (back if k >= 5 else 0) for k in range(12)]
    clock = read_clock("list", [f"{time:.3f}" for time in times], FPS)
    assert clock.order == tuple(range(12)), "never interleaved"
    assert np.diff(clock.nanoseconds).tolist() == [STEP] * 11
    assert f"set back by some {back:.6g} s after image 4" in caplog.text


def test_equal_times_are_spread_until_the_next(caplog: pytest.LogCaptureFixture) -> None:
    clock = read_clock("list", ["3"] * 4 + ["4"] * 4, FPS)
    assert clock.nanoseconds[:4] == tuple(3 * 10**9 + k * STEP for k in range(4))
    assert clock.nanoseconds[4] == 4 * 10**9
    assert "8 images have the time stamp of another one" in caplog.text
    assert read_clock("list", ["0"] * 3, FPS).nanoseconds == (0, STEP, 2 * STEP)


def test_times_that_contradict_the_frame_rate_are_told(caplog: pytest.LogCaptureFixture) -> None:
    read_clock("list", ["0", "0.0001", "0.0002"], FPS)
    assert "0.0001 s apart, but Camera.fps of the settings is 20" in caplog.text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("noon", "'noon' is not a number"),
        ("nan", "nan is not finite"),
        ("-inf", "-inf is not finite"),
        ("2011-13-26 13:02:25", "is no date"),
        ("2011-09-26", "is not a number"),
        ("", "is not a number"),
    ],
)
def test_what_is_no_time_is_refused(text: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        read_clock("list", ["0", text], FPS)


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=60))
def test_times_always_grow(times: list[int]) -> None:
    logging.disable(logging.WARNING)
    try:
        clock = read_clock("list", [f"{time}e-9" for time in times], None)
    finally:
        logging.disable(logging.NOTSET)
    assert sorted(clock.order) == list(range(len(times)))
    assert all(one <= other for one, other in itertools.pairwise(clock.nanoseconds))


@given(st.lists(st.integers(0, 1000), min_size=2, max_size=40))
def test_what_grows_was_not_set_back(times: list[int]) -> None:
    assert not was_set_back(sorted(times))


# ---- files of times ------------------------------------------------------------------------------
@pytest.mark.parametrize(
    "text",
    [
        "0\n50\n100\n",
        "frame,timestamp\n0,0\n1,0.05\n2,0.1\n",
        "timestamp;file\n".replace(";", ",") + "0,a.png\n0.05,b.png\n0.1,c.png\n",
        "1970-01-01 00:00:00.0\n1970-01-01 00:00:00.05\n1970-01-01 00:00:00.1\n",
    ],
)
def test_files_of_times(tmp_path: Path, text: str) -> None:
    path = tmp_path / "times.csv"
    path.write_text(text)
    stamps = read_time_file(path, 3, ["a.png", "b.png", "c.png"], FPS)
    assert stamps.seconds.tolist() == pytest.approx([0, 0.05, 0.1])


# ---- lists of images -----------------------------------------------------------------------------
def save(path: Path, value: int, *, deep: bool = False) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    kind = np.uint16 if deep else np.uint8
    cv2.imwrite(str(path), np.full((48, 64), 1000 * value if deep else 10 * value, kind))


@pytest.fixture
def tum(tmp_path: Path) -> Path:
    folder = tmp_path / "rgbd_dataset_freiburg1_made_up"
    for k in range(4):
        save(folder / "rgb" / f"{k}.png", k + 1)
        save(folder / "depth" / f"{k}.png", k + 1, deep=True)
    return folder


def lists(folder: Path, line: str) -> None:
    for name in ("rgb", "depth"):
        text = "".join(line.format(t=k / 20, kind=name, k=k) + "\n" for k in range(4))
        (folder / f"{name}.txt").write_text(text)


@pytest.mark.parametrize(
    "line",
    [
        "{t} /home/me/data/seq/{kind}/{k}.png",
        "{t} C:\\data\\seq\\{kind}\\{k}.png",
        "{t} ./{kind}/{k}.png",
    ],
)
def test_paths_of_another_computer(tum: Path, line: str) -> None:
    lists(tum, line)
    sequence = open_sequence(tum, Sensor.RGBD)
    images = sequence.load(2)
    assert images.image.flat[0] == 30
    assert images.depth is not None
    assert images.depth.flat[0] == 3000


def test_blanks_in_paths(tum: Path) -> None:
    for name in ("rgb", "depth"):
        (tum / name).rename(tum / f"my {name}")
    lists(tum, "{t} my {kind}/{k}.png")
    assert open_sequence(tum, Sensor.RGBD).load(1).image.flat[0] == 20
    text = "".join(f"{k / 20} my rgb/{k}.png {k / 20} my depth/{k}.png\n" for k in range(4))
    (tum / "associations.txt").write_text(text)
    assert open_sequence(tum, Sensor.RGBD).load(3).image.flat[0] == 40


@pytest.mark.parametrize("tells", [True, False])
def test_depth_first(tum: Path, caplog: pytest.LogCaptureFixture, tells: bool) -> None:
    colour, depth = "rgb", "depth"
    if not tells:
        colour, depth = "a", "b"
        (tum / "rgb").rename(tum / colour)
        (tum / "depth").rename(tum / depth)
    text = "".join(f"{k / 20} {depth}/{k}.png {k / 20} {colour}/{k}.png\n" for k in range(4))
    (tum / "associations.txt").write_text(text)
    images = open_sequence(tum, Sensor.RGBD).load(1)
    assert (images.image.flat[0], images.depth.flat[0]) == (20, 2000)  # type: ignore[union-attr]
    assert "the depth images stand first" in caplog.text


def test_lists_of_a_clock_that_was_set_back(tum: Path) -> None:
    for name in ("rgb", "depth"):
        times = [10.0, 10.05, 9.9, 9.95]
        lines = [f"{time} {name}/{k}.png\n" for k, time in enumerate(times)]
        (tum / f"{name}.txt").write_text("".join(lines))
    sequence = open_sequence(tum, Sensor.RGBD)
    assert [sequence.load(k).image.flat[0] for k in range(4)] == [10, 20, 30, 40]
    assert sequence.timestamps.tolist() == pytest.approx([10.0, 10.05, 10.1, 10.15])


def kitti(folder: Path, times: str, first: int = 0) -> Path:
    for camera in (0, 1):
        for k in range(3):
            save(folder / f"image_{camera}" / f"{first + k:06d}.png", k + 1)
    (folder / "times.txt").write_text(times)
    P = "700 0 32 {} 0 700 24 0 0 0 1 0"
    (folder / "calib.txt").write_text(f"P0: {P.format(0)}\nP1: {P.format(-84)}\n")
    return folder


def test_kitti_in_nanoseconds(tmp_path: Path) -> None:
    sequence = open_sequence(kitti(tmp_path, "0\n100000000\n200000000\n"), Sensor.STEREO)
    assert sequence.timestamps.tolist() == pytest.approx([0, 0.1, 0.2])
    assert sequence.settings.camera.fps == pytest.approx(10)


def test_a_piece_of_kitti(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    sequence = open_sequence(kitti(tmp_path, "0\n0.1\n0.2\n", 100), Sensor.STEREO)
    assert [sequence.load(k).image.flat[0] for k in range(3)] == [10, 20, 30]
    assert "have the numbers 000100 to 000102" in caplog.text


def test_kitti_out_of_order_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="time must grow from line to line"):
        open_sequence(kitti(tmp_path, "0.2\n0.1\n0.0\n"), Sensor.STEREO)


def euroc(folder: Path, names: list[list[str]], *, listed: bool) -> Path:
    for camera, stems in enumerate(names):
        place = folder / "mav0" / f"cam{camera}"
        for k, stem in enumerate(stems):
            save(place / "data" / f"{stem}.png", k + 1)
        if listed:
            (place / "data.csv").write_text("".join(f"{s},{s}.png\n" for s in stems))
    return folder


def test_euroc_counted(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    names = [[f"{k:06d}" for k in range(4)]]
    sequence = open_sequence(euroc(tmp_path, names, listed=False), Sensor.MONOCULAR)
    assert sequence.timestamps.tolist() == pytest.approx([0, 0.05, 0.1, 0.15])
    assert "they count frames at 20 Hz" in caplog.text


def test_euroc_reversed_list(tmp_path: Path) -> None:
    stems = [str(10**18 + k * STEP) for k in (3, 2, 1, 0)]
    folder = euroc(tmp_path, [stems], listed=True)
    sequence = open_sequence(folder, Sensor.MONOCULAR, settings="euroc")
    assert [sequence.load(k).image.flat[0] for k in range(4)] == [40, 30, 20, 10]


def test_euroc_pairs_by_the_nearest(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    left = [str(10**18 + k * STEP) for k in range(4)]
    right = [str(10**18 + k * STEP + 3000) for k in range(4)]
    sequence = open_sequence(
        euroc(tmp_path, [left, right], listed=True), Sensor.STEREO, settings="euroc"
    )
    assert len(sequence) == 4
    assert "up to 0.003 ms apart" in caplog.text
