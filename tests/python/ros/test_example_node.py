# SPDX-License-Identifier: BSD-3-Clause
"""The example node for rclpy, with a stand-in of rclpy: it shares all but the transport."""

from __future__ import annotations

import runpy
import threading
import time
from pathlib import Path

import pytest

from orbslam2py import Sensor
from orbslam2py.ros import messages
from orbslam2py.ros.types import TRIGGER, from_cdr, to_cdr
from support import fake_rclpy
from support.memory_transport import MemoryNetwork
from support.ros_messages import START, STEP, camera_info, raw_image
from support.small_sequences import SIZE, images, sequence

pytestmark = pytest.mark.watchdog(60)

EXAMPLE = Path(__file__).parents[3] / "examples" / "ros2_node.py"
N = 12


def test_the_example_tracks_and_publishes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    network = MemoryNetwork()
    fake_rclpy.install(monkeypatch, network)
    kinds = {"image_rect": "sensor_msgs/msg/Image", "camera_info": "sensor_msgs/msg/CameraInfo"}
    for side in ("left", "right"):
        for name, kind in kinds.items():
            network.offer(f"/cam/{side}/{name}", kind)
    ended = threading.Event()
    camera = sequence(Sensor.STEREO).settings.camera

    def play() -> None:
        number = 0
        while not ended.wait(0.05):
            at, stamp = min(number, 70), START + number * STEP
            pair = images(Sensor.STEREO, at)
            for side, array, bf in (("left", pair.image, 0.0), ("right", pair.right, camera.bf)):
                info = camera_info(SIZE, stamp, f=camera.fx, bf=bf)
                network.send(f"/cam/{side}/camera_info", info)
                network.send(f"/cam/{side}/image_rect", raw_image(array, "mono8", stamp))
            number += 1

    player = threading.Thread(target=play, daemon=True)
    player.start()
    try:
        module = runpy.run_path(str(EXAMPLE))
        module["main"]("stereo", None, N)
    finally:
        ended.set()
        player.join()
    assert f"tracked {N} images" in capsys.readouterr().out
    time.sleep(0.1)
    poses = network.messages("/orbslam2py/pose", messages.POSE)
    assert len(poses) == N
    stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in poses]
    assert all((stamp - START) % STEP == 0 for stamp in stamps)  # every digit
    tree = network.messages("/tf", messages.TF)[-1]
    assert [one.child_frame_id for one in tree.transforms] == ["odom", "base_link"]
    request = b"\0\1\0\0\0"
    response = from_cdr(network.services["/orbslam2py/save_map"](request), f"{TRIGGER}_Response")
    assert response.success
    assert Path("map.orbmap").is_file()
    assert to_cdr(response)
