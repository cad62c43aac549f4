# SPDX-License-Identifier: BSD-3-Clause
"""A recording for Rerun, read back; nothing goes over the network."""

from __future__ import annotations

import builtins
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from orbslam2py import OrbSlamError, OutputFileError, RerunRecorder, Sensor, System
from orbslam2py.recordings import output_file
from orbslam2py.recordings.rerun_recorder import _in_words
from orbslam2py.slam.events import MapsMerged, MapStarted
from orbslam2py.viewer import Publisher
from support.files import names_in
from support.small_sequences import new_system, play, sequence

pytestmark = pytest.mark.watchdog(90)


def record(path: Path, n: int = 12) -> System:
    with new_system(Sensor.RGBD, deterministic=True) as system:
        recorder = RerunRecorder(
            path,
            settings=sequence(Sensor.RGBD).settings,
            ground_truth=sequence(Sensor.RGBD).ground_truth(),
        )
        with Publisher(system, [recorder], every_frame=True):
            play(system, n)
            assert names_in(path.parent) != [path.name], "it appears when it is whole"
        return system


def chunks(path: Path) -> list:
    reader = pytest.importorskip("rerun.chunk", reason="an older Rerun reads in another way")
    return list(reader.RrdReader(str(path)).store().stream())


def last_length(found: list, entity: str, column: str) -> int:
    """How many things were last written to an entity."""
    at = []
    for chunk in found:
        if chunk.entity_path == entity and not chunk.is_static:
            batch = chunk.to_record_batch()
            values = batch.column(column).to_pylist()
            at += list(zip(batch.column("time").to_pylist(), map(len, values), strict=True))
    return max(at)[1] if at else 0


def test_all_of_a_run_is_in_the_file(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    n = 12
    path = tmp_path / "run.rrd"
    system = record(path, n)
    assert names_in(tmp_path) == ["run.rrd"]
    found = chunks(path)
    rows = Counter()
    for chunk in found:
        if not chunk.is_static:
            rows[chunk.entity_path] += chunk.num_rows
    for entity in (
        "/world/camera",
        "/world/camera/image",
        "/world/camera/image/keypoints/mapped",
        "/world/map/local_points",
        "/plots/inliers",
        "/plots/milliseconds/track",
    ):
        assert rows[entity] == n, entity
    assert rows["/events"] > 0
    snapshot = system.map_snapshot()
    pages = {entity for entity in rows if entity.startswith("/world/map/points/")}
    points = sum(last_length(found, page, "Points3D:positions") for page in pages)
    assert points == len(snapshot.point_ids)
    keyframes = last_length(found, "/world/map/keyframes/0", "LineStrips3D:strips")
    assert keyframes == len(snapshot.keyframe_ids)
    assert last_length(found, "/world/map/ground_truth", "LineStrips3D:strips") == 1


def test_images_are_small(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    record(tmp_path / "run.rrd", 5)
    for chunk in chunks(tmp_path / "run.rrd"):
        if chunk.entity_path == "/world/camera/image" and not chunk.is_static:
            (blob,) = chunk.to_record_batch().column("EncodedImage:blob").to_pylist()[0]
            assert np.array(blob[:2], np.uint8).tobytes() == b"\xff\xd8", "JPEG"
            assert len(blob) < 320 * 240


WATCHED_RECORDING = """
import os, re, socket, sys, threading
from pathlib import Path

class Forbidden(socket.socket):
    def __init__(self, *arguments, **more):
        raise AssertionError("a socket was opened")

seen, done = set(), threading.Event()

def sockets():
    for descriptor in Path("/proc/self/fd").iterdir():
        try:
            target = os.readlink(descriptor)
        except OSError:
            continue
        if target.startswith("socket:"):
            seen.add(target[8:-1])

def look():
    while not done.wait(0.001):
        sockets()

def internet():
    lines = [Path("/proc/self/net", name).read_text().splitlines()[1:]
             for name in ("tcp", "tcp6", "udp", "udp6")]
    return {line.split()[9] for table in lines for line in table}

socket.socket = Forbidden
watcher = threading.Thread(target=look)
watcher.start()
at_any_time = set()
from orbslam2py import RerunRecorder, Sensor
from orbslam2py.viewer import Publisher
from support.small_sequences import new_system, track
with new_system(Sensor.RGBD, deterministic=True) as system:
    with Publisher(system, [RerunRecorder(sys.argv[1])], every_frame=True):
        for i in range(6):
            track(system, i)
            at_any_time |= seen & internet()
at_any_time |= seen & internet()
done.set()
watcher.join()
home = [str(path) for path in Path.home().rglob("*") if "rerun" in str(path).lower()]
print("sockets:", sorted(at_any_time), "files:", home)
"""


def test_nothing_goes_over_the_network_and_nothing_is_left_at_home(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    home = tmp_path / "home"
    home.mkdir()
    tests = Path(__file__).parents[1]
    done = subprocess.run(
        [sys.executable, "-c", WATCHED_RECORDING, str(tmp_path / "a.rrd")],
        capture_output=True,
        text=True,
        check=False,
        env={"HOME": str(home), "PYTHONPATH": f"{tests}:{':'.join(sys.path)}"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "sockets: [] files: []"
    assert (tmp_path / "a.rrd").is_file()


def test_without_rerun_the_line_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    original = builtins.__import__

    def missing(name: str, *arguments: object, **more: object) -> object:
        if name.split(".", maxsplit=1)[0] == "rerun":
            raise ImportError(name)
        return original(name, *arguments, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(OrbSlamError, match=r'pip install "orbslam2py\[rerun\]"'):
        RerunRecorder(tmp_path / "a.rrd")
    assert names_in(tmp_path) == []


def test_places_that_cannot_be_written_are_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    for name, words in (
        ("a.mp4", r"does not end like a recording; name it with \.rrd"),
        ("none/a.rrd", "there is no folder"),
    ):
        with pytest.raises(OutputFileError, match=words):
            RerunRecorder(tmp_path / name)
    monkeypatch.setattr(output_file, "RESERVE", 2**60)
    with pytest.raises(OutputFileError, match="the disk is full"):
        RerunRecorder(tmp_path / "a.rrd")
    assert names_in(tmp_path) == []


def test_without_an_image_there_is_no_file(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk is not installed")
    recorder = RerunRecorder(tmp_path / "a.rrd")
    recorder.close()
    recorder.close()
    assert names_in(tmp_path) == []


def test_maps_that_begin_and_merge_are_said_in_words() -> None:
    merged = MapsMerged(0, 1, 40, 7, 2.0, 1.0, 55, 80, 30, 12, 340, np.eye(4), 1.25)
    assert _in_words(merged) == (
        "map 1 is part of map 0 now, keyframe 40 to 7, 55 inliers: 12 keyframes and 340 points "
        "moved, scale 1.25",
        "WARN",
    )
    assert _in_words(MapStarted(2, 90, 3.0)) == ("map 2 has begun", "INFO")
