# SPDX-License-Identifier: BSD-3-Clause
"""The small parts of a run: reading ahead, stage times, records, files, pictures."""

from __future__ import annotations

import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import cv2
import numpy as np
import pytest
from rich.progress import Progress, TextColumn

import orbslam2py
from orbslam2py.cli.run import _Display
from orbslam2py.errors import DatasetError
from orbslam2py.runs.outputs import link_latest, prepare_output_folder, write_ply
from orbslam2py.runs.plots import draw_trajectory
from orbslam2py.runs.prefetch import Prefetcher
from orbslam2py.runs.report import peak_memory_mb
from orbslam2py.runs.result import FrameRow, RunOptions
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.records import Reason, TrackingRecord, TrackingState
from orbslam2py.slam.system import System
from orbslam2py._timing import StageStatistics, StageTimer
from watchdog import worker_threads

pytestmark = pytest.mark.watchdog(20)


# ---- reading ahead -------------------------------------------------------------------------------
class Loader:
    """Squares; some raise."""

    def __init__(self, bad: tuple[int, ...] = ()) -> None:
        self.loaded: list[int] = []
        self._bad = bad

    def load(self, index: int, /) -> int:
        self.loaded.append(index)
        if index in self._bad:
            raise OSError(f"no {index}")
        return index**2


def test_items_come_in_order() -> None:
    with Prefetcher[int](Loader(), range(3, 300, 3)) as items:
        assert list(items) == [(i, i**2) for i in range(3, 300, 3)]


def test_an_exception_takes_the_place_of_its_item() -> None:
    with Prefetcher[int](Loader(bad=(0, 2, 4)), range(5)) as items:
        got = list(items)
    assert [index for index, _ in got] == [0, 1, 2, 3, 4]
    assert [isinstance(item, OSError) for _, item in got] == [True, False, True, False, True]


def test_reads_only_a_few_ahead() -> None:
    loader = Loader()
    with Prefetcher[int](loader, range(1000), ahead=3) as items:
        iterator = iter(items)
        next(iterator)
        time.sleep(0.05)
        assert 1 <= len(loader.loaded) <= 5
    assert len(loader.loaded) <= 6


def test_leaving_early_ends_the_thread() -> None:
    with pytest.raises(ZeroDivisionError), Prefetcher[int](Loader(), range(1000)) as items:
        for index, _ in items:
            _ = 1 / (index - 3)
    assert worker_threads() == []


def test_stop_ends_a_wait_for_an_item() -> None:
    release, stop = threading.Event(), threading.Event()

    class Stuck:
        def load(self, index: int, /) -> int:
            if index == 2:
                release.wait(15)
            return index

    got = []
    with Prefetcher[int](Stuck(), range(5), stop=stop) as items:
        threading.Timer(0.1, stop.set).start()
        got = [index for index, _ in items]
        release.set()
    assert got == [0, 1]


# ---- times ---------------------------------------------------------------------------------------
def test_timer_adds_up_and_counts_failing_blocks() -> None:
    timer = StageTimer()
    for _ in range(2):
        with timer("a"):
            time.sleep(0.002)
    with pytest.raises(KeyError), timer("b"):
        raise KeyError
    assert timer.milliseconds["a"] >= 4.0
    assert timer.milliseconds["b"] >= 0.0


def test_statistics() -> None:
    statistics = StageStatistics()
    for value in range(1, 102):
        statistics.add({"a": float(value)})
    statistics.add({"b": 2.0})
    summary = statistics.summary()
    expected = {"median": 51.0, "mean": 51.0, "p99": 100.0, "count": 101}
    assert expected.items() <= summary["a"].items()
    assert summary["b"]["median"] == 2.0
    assert StageStatistics().summary() == {}


def test_statistics_hold_the_latest_values_of_a_long_run() -> None:
    statistics = StageStatistics(capacity=10)
    for value in range(100):
        statistics.add({"a": float(value)})
    assert statistics.summary()["a"]["mean"] == pytest.approx(94.5)
    assert statistics.summary()["a"]["count"] == 100


def test_peak_memory_is_in_megabytes() -> None:
    assert 20 < peak_memory_mb() < 20_000


# ---- records and options -------------------------------------------------------------------------
def test_record_inverts_its_pose() -> None:
    T_cw = np.eye(4)
    T_cw[:3, :3] = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    T_cw[:3, 3] = [1, 2, 3]
    values = {"covariance": None, "n_matches": 0, "n_inliers": 0, "is_keyframe": False}
    record = TrackingRecord(
        *(0, 0.0, 0, TrackingState.OK, Reason.NONE, T_cw), reference_keyframe=0, **values
    )
    np.testing.assert_allclose(record.T_wc, np.linalg.inv(T_cw), atol=1e-15)
    lost = TrackingRecord(
        *(0, 0.0, 0, TrackingState.LOST, Reason.NONE, None), reference_keyframe=0, **values
    )
    assert lost.T_wc is None


def test_progress_tells_why_there_is_no_pose() -> None:
    record = TrackingRecord(
        *(0, 0.0, 0, TrackingState.NOT_INITIALIZED, Reason.LOW_PARALLAX),
        *(None, None, 0, 0, False, -1),
    )
    status = []
    for reason in (str(record.reason), ""):
        bar = Progress(TextColumn("{task.fields[status]}"), get_time=lambda: 1.0)
        row = FrameRow(0, "0.0", record, reason)
        _Display(bar, 10).show(row, cast(System, SimpleNamespace(n_keyframes=0, n_map_points=0)))
        status.append(bar.tasks[0].fields["status"])
    assert "NOT_INITIALIZED" in status[0]
    assert "(low parallax between the two views)" in status[0]
    assert "(" not in status[1]


def test_reasons_print_as_text() -> None:
    assert str(Reason.NONE) == ""
    assert f"{Reason.TOO_FEW_DEPTHS}" == "too few keypoints with depth"


@pytest.mark.parametrize(
    ("options", "indices"),
    [
        ({}, [0, 1, 2, 3, 4]),
        ({"start": 4}, [4]),
        ({"stride": 2}, [0, 2, 4]),
        ({"start": 1, "stride": 3, "max_frames": 1}, [1]),
        ({"max_frames": 99}, [0, 1, 2, 3, 4]),
    ],
)
def test_indices(options: dict[str, int], indices: list[int]) -> None:
    assert RunOptions(Sensor.RGBD, **options).indices(5) == indices  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "options",
    [
        {"start": 5},
        {"start": -1},
        {"stride": 0},
        {"max_frames": 0},
        {"deterministic": True, "realtime": True},
    ],
)
def test_options_that_make_no_sense(options: dict[str, int]) -> None:
    with pytest.raises(DatasetError, match="--"):
        RunOptions(Sensor.RGBD, **options).indices(5)  # type: ignore[arg-type]


def names(folder: str | Path) -> list[str]:
    return sorted(path.name for path in Path(folder).iterdir())


# ---- files ---------------------------------------------------------------------------------------
def test_output_folder_is_made_with_its_parents(tmp_path: Path) -> None:
    folder = prepare_output_folder(tmp_path / "a" / "b", "name", force=False)
    assert folder.is_dir()
    assert list(folder.iterdir()) == []
    assert prepare_output_folder(folder, "name", force=False) == folder, "empty: taken"
    (folder / "x").touch()
    with pytest.raises(DatasetError, match="not empty"):
        prepare_output_folder(folder, "name", force=False)
    assert prepare_output_folder(folder, "name", force=True) == folder


def test_link_to_the_latest_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("first", "second"):
        folder = Path("runs") / name
        folder.mkdir(parents=True)
        link_latest(folder)
        assert Path("runs/latest").readlink() == Path(name)
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    link_latest(elsewhere)
    assert Path("runs/latest").readlink() == Path("second")
    assert names("runs") == ["first", "latest", "second"]


def test_a_real_folder_called_latest_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs" / "latest").mkdir(parents=True)
    (tmp_path / "runs" / "one").mkdir()
    link_latest(Path("runs/one"))
    assert not Path("runs/latest").is_symlink()
    assert names("runs") == ["latest", "one"], "nothing else is left behind"


@pytest.mark.parametrize("n", [0, 1, 1000])
def test_ply(tmp_path: Path, n: int) -> None:
    points = np.random.default_rng(0).normal(size=(n, 3))
    write_ply(tmp_path / "p.ply", points)
    header, _, body = (tmp_path / "p.ply").read_bytes().partition(b"end_header\n")
    assert header.startswith(b"ply\nformat binary_little_endian 1.0\n")
    assert f"element vertex {n}\n".encode() in header
    np.testing.assert_array_equal(
        np.frombuffer(body, "<f4").reshape(n, 3), points.astype(np.float32)
    )


@pytest.mark.parametrize("n", [1, 2, 200])
@pytest.mark.parametrize("with_truth", [False, True])
def test_picture(tmp_path: Path, n: int, with_truth: bool) -> None:
    angles = np.linspace(0, 2 * np.pi, n)
    positions = np.stack([10 * np.cos(angles), 0 * angles, 10 * np.sin(angles)], axis=1)
    path = tmp_path / "t.png"
    draw_trajectory(
        path,
        title="a $strange_ name [x]",
        positions=positions,
        seconds=np.arange(float(n)),
        keyframes=positions[::20],
        points=np.vstack([positions + 1, [[1e9, 0, 0]]]),
        truth=(np.arange(float(n)), positions + 0.1) if with_truth else None,
    )
    picture = cv2.imread(str(path))
    assert picture is not None
    assert picture.shape[0] > 500
    # The estimate's blue is there.
    blue = (picture[:, :, 0] > 140) & (picture[:, :, 2] < 80)
    assert blue.sum() > 100
    assert names(tmp_path) == ["t.png"]


def test_axes_tell_the_unit(tmp_path: Path) -> None:
    pictures = []
    for unit in ("m", "units"):
        draw_trajectory(
            tmp_path / unit,
            title="t",
            positions=np.eye(3),
            seconds=np.arange(3.0),
            keyframes=np.eye(3),
            points=np.zeros((0, 3)),
            unit=unit,
        )
        picture = cv2.imread(str(tmp_path / unit))
        assert picture is not None
        pictures.append(picture)
    rows, columns = np.nonzero((pictures[0] != pictures[1]).any(axis=2))
    height, width = pictures[0].shape[:2]
    # The labels differ, left and below; and with their size, a little, the axes.
    assert columns.min() < 0.05 * width
    assert rows.max() > 0.5 * height


# ---- the package ---------------------------------------------------------------------------------
def test_everything_offered_is_there() -> None:
    for name in orbslam2py.__all__:
        assert getattr(orbslam2py, name) is not None
        assert name in dir(orbslam2py)
    with pytest.raises(AttributeError, match="Slam"):
        _ = orbslam2py.Slam  # type: ignore[attr-defined]
    assert not hasattr(orbslam2py, "path")
