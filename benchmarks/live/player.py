# SPDX-License-Identifier: BSD-3-Clause
"""Play a bag over DDS or Zenoh with stamps of now, as the driver of a camera does.

``python -m benchmarks.live.player zenoh:tcp/127.0.0.1:7447 BAG --seconds 60 --imu 200``
"""

from __future__ import annotations

import argparse
import struct
import sys
import time
from pathlib import Path

import numpy as np

from orbslam2py.datasets.bags.bag import Bag, Topic
from orbslam2py.datasets.bags.messages import CAMERA_INFO, IMAGE, IMU, read_head
from orbslam2py.ros.connect import connect
from orbslam2py.ros.transport import Publication, Transport
from orbslam2py.ros.types import message_class, to_cdr

_NANO = 10**9
#: Topic of the IMU, and its specific force when it is at rest and level [m/s^2].
_IMU_TOPIC, _GRAVITY = "/imu", 9.81


def restamped(content: bytes, stamp: int) -> bytes:
    """Put another stamp [ns] into the head of a message."""
    order = "<" if content[1] == 1 else ">"
    return content[:4] + struct.pack(f"{order}iI", stamp // _NANO, stamp % _NANO) + content[12:]


def imu_message(stamp: int) -> bytes:
    """Make a sample of an IMU at rest."""
    time_of = message_class("builtin_interfaces/msg/Time")(stamp // _NANO, stamp % _NANO)
    header = message_class("std_msgs/msg/Header")(time_of, "imu")
    vector = message_class("geometry_msgs/msg/Vector3")
    turned = message_class("geometry_msgs/msg/Quaternion")(0.0, 0.0, 0.0, 1.0)
    zeros = np.zeros(9)
    message = message_class(IMU)(
        *(header, turned, zeros, vector(0.0, 0.0, 0.0), zeros, vector(0.0, 0.0, _GRAVITY), zeros)
    )
    return to_cdr(message)


class Player:
    """Publishes the images and calibrations of a bag, to and fro until the time is over."""

    def __init__(self, transport: Transport, path: Path) -> None:
        self._bag = Bag(path)
        topics = [one for one in self._bag.topics if one.kind in (IMAGE, CAMERA_INFO)]
        self._moments = _moments(self._bag, topics)
        self._publications: dict[str, Publication] = {
            topic.name: transport.publish(topic.name, topic.kind) for topic in topics
        }
        self._transport = transport
        self.n_sent = 0

    def play(self, seconds: float, rate: float, imu_rate: float = 0.0) -> None:
        """Publish for some time, at a rate of images [1/s] and of samples of an IMU."""
        imu = self._transport.publish(_IMU_TOPIC, IMU) if imu_rate else None
        begin, number, n_imu = time.time_ns(), 0, 0
        while (due := number / rate) < seconds:
            while imu is not None and n_imu / imu_rate < due:
                _wait(begin, n_imu / imu_rate)
                imu.send(imu_message(begin + round(n_imu / imu_rate * _NANO)))
                n_imu += 1
            _wait(begin, due)
            self._send(self._place(number))
            number += 1

    def _place(self, number: int) -> int:
        last = len(self._moments) - 1
        number %= 2 * last
        return min(number, 2 * last - number)

    def _send(self, place: int) -> None:
        stamp = time.time_ns()
        for name, content in self._moments[place]:
            self._publications[name].send(restamped(content, stamp))
        self.n_sent += 1


def _wait(begin: int, due: float) -> None:
    left = due - (time.time_ns() - begin) / 1e9
    if left > 0:
        time.sleep(left)


def _moments(bag: Bag, topics: list[Topic]) -> list[list[tuple[str, bytes]]]:
    """Return the messages of each moment, calibrations first."""
    found: dict[int, list[tuple[str, bytes]]] = {}
    for topic in sorted(topics, key=lambda one: one.kind != CAMERA_INFO):
        for message in bag.messages(topic):
            content = bag.read(message)
            stamp = read_head(content, topic.kind, topic.encoding).stamp
            found.setdefault(stamp, []).append((topic.name, content))
    return [found[stamp] for stamp in sorted(found)]


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", help="ros2:DOMAIN or zenoh:ADDRESS")
    parser.add_argument("bag", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=20.0)
    parser.add_argument("--imu", type=float, default=0.0, help="samples of an IMU per second")
    return parser.parse_args()


def main() -> None:
    """Play, and say how many moments were sent."""
    given = _arguments()
    transport = connect(given.source)
    player = Player(transport, given.bag)
    print("ready", flush=True)
    time.sleep(1.0)  # those who listen find the topics
    player.play(given.seconds, given.rate, given.imu)
    print(player.n_sent, flush=True)
    transport.close()


if __name__ == "__main__":
    main()
    sys.exit(0)
