# SPDX-License-Identifier: BSD-3-Clause
"""Latency and losses of pairs and IMU samples from another process, over DDS or Zenoh.

``python -m benchmarks.live.transport ros2 --minutes 10``: pairs of 752 x 480 pixels at 20 Hz and
samples of an IMU at 200 Hz, over the loopback interface. The latency is that from the moment a
pair is given to the publisher until its last image is decoded here.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.harness.process_memory import resident_mb
from orbslam2py import Sensor
from orbslam2py.live import Request
from orbslam2py.live.stream import LiveStream
from orbslam2py.synthetic import SyntheticOptions, SyntheticSequence

_SIZE, _RATE, _IMU_RATE = (752, 480), 20.0, 200.0
_DOMAIN, _ADDRESS = 97, "tcp/127.0.0.1:17448"
_FRAMES = 40
#: Frames that wait here: nothing is tracked, so only a busy computer lets them wait.
_ROOM = 10
#: Seconds before the figures begin.
_WARM_UP = 3.0


@contextlib.contextmanager
def _router() -> Iterator[str]:
    import zenoh  # noqa: PLC0415

    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{_ADDRESS}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    session = zenoh.open(config)
    print("ready", flush=True)
    yield _ADDRESS
    session.close()


def _open(kind: str) -> LiveStream:
    from orbslam2py.ros import dds_source, zenoh_source  # noqa: PLC0415

    module = dds_source if kind == "ros2" else zenoh_source
    address = str(_DOMAIN) if kind == "ros2" else _ADDRESS
    device = module.open_device(Request(address, Sensor.STEREO, imu=True))
    return LiveStream(device, Sensor.STEREO, room=_ROOM)


def measure(kind: str, seconds: float, folder: Path) -> None:
    """Print what came in the time."""
    options = SyntheticOptions(
        world="corridor", sensor=Sensor.STEREO, frames=_FRAMES, size=_SIZE, noise=2.0
    )
    bag = SyntheticSequence(options).write(folder / "bag", "mcap")
    source = f"ros2:{_DOMAIN}" if kind == "ros2" else f"zenoh:{_ADDRESS}"
    command = [sys.executable, "-m", "benchmarks.live.player", source, str(bag)]
    rates = ["--rate", str(_RATE), "--imu", str(_IMU_RATE), "--seconds", str(seconds + 20)]
    player = subprocess.Popen([*command, *rates], stdout=subprocess.PIPE, text=True)
    try:
        assert player.stdout is not None
        player.stdout.readline()
        _receive(_open(kind), seconds)
    finally:
        player.terminate()
        player.wait()


def _receive(stream: LiveStream, seconds: float) -> None:
    latencies, stamps, memory, n_imu = [], [], [], 0
    dropped_before = 0
    with stream:
        begin = time.monotonic()
        offset = time.time() - begin
        next_look = begin + _WARM_UP
        while (now := time.monotonic()) < begin + _WARM_UP + seconds:
            frame = stream.take(0.1)
            if now < begin + _WARM_UP:
                dropped_before = stream.n_dropped
                continue
            if frame is None:
                continue
            assert frame.times is not None
            assert frame.stamp is not None
            latencies.append((frame.times.complete + offset - frame.stamp) * 1e3)
            stamps.append(frame.stamp)
            n_imu += 0 if frame.imu is None else len(frame.imu)
            if now >= next_look:
                next_look = now + 5
                memory.append(resident_mb())
        dropped = stream.n_dropped - dropped_before
    steps = np.diff(stamps)
    lost = int(np.round(steps * _RATE).sum() - len(steps)) - dropped
    p50, p99, most = np.percentile(latencies, [50, 99, 100])
    print(f"pairs {len(stamps)}, lost on the way {lost}, dropped in the queue {dropped}")
    print(f"samples of the IMU {n_imu}, of {round((stamps[-1] - stamps[0]) * _IMU_RATE)}")
    print(f"latency [ms]: median {p50:.2f}, p99 {p99:.2f}, largest {most:.2f}")
    print(f"memory [MB]: {memory[0]:.0f} at the beginning, {memory[-1]:.0f} at the end")


def main() -> None:
    """Measure one transport."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=["ros2", "zenoh", "router"])
    parser.add_argument("--minutes", type=float, default=10.0)
    given = parser.parse_args()
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if given.kind == "router":
        with _router():
            time.sleep(60 * given.minutes + 60)
        return
    with contextlib.ExitStack() as stack:
        if given.kind == "zenoh":  # in a process of its own, as on a robot
            command = [sys.executable, "-m", "benchmarks.live.transport", "router"]
            router = subprocess.Popen(
                [*command, "--minutes", str(given.minutes)], stdout=subprocess.PIPE, text=True
            )
            stack.callback(router.terminate)
            assert router.stdout is not None
            router.stdout.readline()
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        measure(given.kind, 60 * given.minutes, Path(folder))


if __name__ == "__main__":
    main()
