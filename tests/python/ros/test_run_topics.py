# SPDX-License-Identifier: BSD-3-Clause
"""``orbslam2py run`` on topics of another process, over DDS and over Zenoh, to a trajectory."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbslam2py.ros import messages
from orbslam2py.ros.connect import connect
from orbslam2py.ros.transport import Transport
from orbslam2py.ros.types import TRIGGER, from_cdr, type_hash
from orbslam2py.trajectory import read_tum
from orbslam2py.trajectory.robot_frames import RobotBase, pose_of_forward_camera
from support.command_line import CommandLine, Results

pytestmark = pytest.mark.watchdog(100)
pytest.importorskip("cyclonedds")

ROOT = Path(__file__).parents[3]
#: Images that are tracked; fewer than are played until the run has begun.
N = 30
RATE = 15.0


class Robot:
    """A process that plays a bag until it is stopped."""

    def __init__(self, source: str, bag: Path) -> None:
        command = [sys.executable, "-m", "benchmarks.live.player", source, str(bag)]
        options = ["--seconds", "60", "--rate", str(RATE)]
        self._process = subprocess.Popen(
            [*command, *options], cwd=ROOT, stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == "ready\n"

    def stop(self) -> None:
        self._process.terminate()
        self._process.communicate(timeout=10)


class Listener:
    """Keeps what a run publishes."""

    def __init__(self, transport: Transport) -> None:
        self.heard: dict[str, list[Any]] = defaultdict(list)
        self.kinds: dict[str, str] = {}
        self._transport = transport
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._ended.wait(0.05):
            for topic in self._transport.topics():
                ours = topic.name.startswith(("/orbslam2py", "/tf"))
                if ours and topic.name not in self.kinds:
                    self.kinds[topic.name] = topic.kind
                    self._transport.subscribe(topic, self._keeper(topic.name, topic.kind))

    def _keeper(self, name: str, kind: str) -> Callable[[bytes], None]:
        return lambda content: self.heard[name].append(from_cdr(content, kind))

    def close(self) -> None:
        time.sleep(0.5)  # what is under way
        self._ended.set()
        self._thread.join()
        self._transport.close()


@pytest.fixture
def run_here(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> CommandLine:
    return CommandLine(monkeypatch, capsys, tmp_path)


@pytest.fixture(params=["ros2", "zenoh"])
def source(request: pytest.FixtureRequest) -> str:
    if request.param == "ros2":
        return f"ros2:{request.getfixturevalue('domain')}"
    return f"zenoh:{request.getfixturevalue('router')}"


def _stamp(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def test_topics_to_a_trajectory_and_back_to_topics(
    source: str, bag: Path, run_here: CommandLine
) -> None:
    robot = Robot(source, bag)
    listener = Listener(connect(source))
    try:
        done = run_here(
            *("run", source, "--sensor", "stereo", "--max-frames", N, "--output", "out"),
            *("--base-transform", "0.5,0,0.3", "--no-report"),
        )
    finally:
        robot.stop()
        listener.close()
    assert done.code == 0, done.err
    first = done.err.splitlines()[0]
    assert first.startswith(f"Note: {source}: domain ")
    assert ("on lo (127.0.0.1)" if source.startswith("ros2") else "no port of its own") in first
    assert Results(Path("out")).report["tracked"] == N
    trajectory = read_tum(Path("out/trajectory_online.txt"))
    assert len(trajectory.timestamps) == N
    heard = listener.heard
    poses = {_stamp(one): one for one in heard["/orbslam2py/pose"]}
    assert len(poses) > N - 12  # a listener that comes late misses the first ones
    assert listener.kinds["/orbslam2py/odom"] == messages.ODOMETRY
    T_bc = pose_of_forward_camera()
    T_bc[:3, 3] = 0.5, 0, 0.3
    base = RobotBase(T_bc)
    n_compared = 0
    for seconds, T_wc in zip(trajectory.timestamps, trajectory.T_wc, strict=True):
        near = [one for stamp, one in poses.items() if abs(stamp / 1e9 - seconds) < 2e-6]
        for one in near:
            n_compared += 1
            assert one.header.frame_id == "map"
            at, expected = one.pose.position, base.pose(T_wc)[:3, 3]
            np.testing.assert_allclose([at.x, at.y, at.z], expected, atol=1e-3)
    assert n_compared == len(poses)
    trees = {
        (one.header.frame_id, one.child_frame_id)
        for tree in heard["/tf"]
        for one in tree.transforms
    }
    assert trees == {("map", "odom"), ("odom", "base_link")}
    (fixed,) = heard["/tf_static"][0].transforms
    assert (fixed.header.frame_id, fixed.child_frame_id) == ("base_link", "left")
    assert heard["/orbslam2py/points"][-1].width > 100
    assert heard["/orbslam2py/state"][-1].data == "OK"


def test_a_map_is_saved_on_request(router: str, bag: Path, run_here: CommandLine) -> None:
    source = f"zenoh:{router}"
    robot = Robot(source, bag)
    asking = connect(source)
    replies: list[Any] = []

    def ask() -> None:
        key = f"0/orbslam2py/save_map/std_srvs::srv::dds_::Trigger_/{type_hash(TRIGGER)}"
        end = time.monotonic() + 60
        while time.monotonic() < end and not replies:
            for reply in asking._session.get(key, payload=b"\0\1\0\0\0", timeout=5.0):
                read = from_cdr(reply.ok.payload.to_bytes(), f"{TRIGGER}_Response")
                if read.success:
                    replies.append(read)
            time.sleep(0.2)

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        done = run_here(
            *("run", source, "--sensor", "stereo", "--max-frames", 2 * N, "--output", "out"),
            "--no-report",
        )
    finally:
        robot.stop()
        thread.join(5)
        asking.close()
    assert done.code == 0, done.err
    assert replies[0].message == f"saved in {Path('out/map.orbmap').resolve()}"
    assert Path("out/map.orbmap").stat().st_size > 10_000


def test_a_bag_is_published_on_request_and_says_where(
    router: str, bag: Path, run_here: CommandLine
) -> None:
    source = f"zenoh:{router}"
    listener = Listener(connect(source))
    done = run_here(
        *("run", bag, "--sensor", "stereo", "--max-frames", 8, "--output", "out", "--no-report"),
        *("--publish", source, "--realtime"),
    )
    listener.close()
    assert done.code == 0, done.err
    told = f"Note: zenoh: published in domain 0, on a connection to {router}, no port of its own"
    assert told in done.err.splitlines()
    assert "base_link is assumed to be at the camera" in done.err
    assert listener.heard["/orbslam2py/path"][-1].header.frame_id == "map"
