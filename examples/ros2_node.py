# SPDX-License-Identifier: BSD-3-Clause
"""A ROS 2 node: images in, poses, odometry, map and transforms out, through rclpy.

For robots with ROS 2 installed; without it, ``orbslam2py run ros2:`` does the same over DDS alone.
Everything but the transport below is shared with that command: choice of topics, settings from
CameraInfo, pairs, REP 105 frames, services.

python examples/ros2_node.py stereo [left=/cam/left/image_raw,right=/cam/right/image_raw]

Tried: this file against a stand-in of rclpy with the calls that it uses
(tests/python/ros/test_example_node.py). Not tried: a real rclpy, because no package registry that
the project uses has one.
"""

import sys
import threading
from pathlib import Path

from orbslam2py import System
from orbslam2py.live import LiveStream, Request
from orbslam2py.ros import LiveTopic, RosOutput, StampedSource, TopicsDevice, choose_base
from orbslam2py.settings import Sensor

try:
    import rclpy
    from rclpy.executors import MultiThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
    from rclpy.serialization import deserialize_message, serialize_message
    from rosidl_runtime_py.utilities import get_message, get_service
except ImportError:
    rclpy = None


class RclpyTransport:
    """`orbslam2py.ros.transport.Transport` by a node: messages stay serialised (CDR)."""

    prefix, domain, where = "rclpy", 0, "the network of the node"

    def __init__(self, node):
        self._node = node

    def topics(self):
        """List the topics that other nodes publish."""
        found = []
        for name, kinds in self._node.get_topic_names_and_types():
            publishers = [
                one.qos_profile
                for one in self._node.get_publishers_info_by_topic(name)
                if one.node_name != self._node.get_name()
            ]
            if publishers:
                reliable = all(one.reliability == ReliabilityPolicy.RELIABLE for one in publishers)
                latched = all(
                    one.durability == DurabilityPolicy.TRANSIENT_LOCAL for one in publishers
                )
                found.append(LiveTopic(name, kinds[0], reliable, latched))
        return sorted(found)

    def subscribe(self, topic, receive):
        """Receive a topic as bytes."""
        depth = 2000 if topic.kind == "sensor_msgs/msg/Imu" else 100 if topic.latched else 10
        made = self._node.create_subscription(
            *(get_message(topic.kind), topic.name, receive),
            _quality(depth, reliable=topic.reliable, latched=topic.latched),
            raw=True,
        )
        return _Subscription(self._node, made)

    def publish(self, name, kind, *, latched=False):
        """Publish a topic from bytes."""
        quality = _quality(1 if latched else 10, latched=latched)
        return _Publication(self._node.create_publisher(get_message(kind), name, quality))

    def serve(self, name, kind, answer):
        """Answer the requests of a service."""
        service = get_service(kind)

        def respond(request, _):
            return deserialize_message(answer(serialize_message(request)), service.Response)

        self._node.create_service(service, name, respond)

    def close(self):
        """Do nothing: the node ends in main."""


class _Subscription:
    def __init__(self, node, made):
        self._node, self._made = node, made

    def close(self):
        if self._made is not None:
            self._node.destroy_subscription(self._made)
            self._made = None


class _Publication:
    def __init__(self, made):
        self._made = made

    def send(self, content, stamp=None):
        self._made.publish(content)


def _quality(depth, *, reliable=True, latched=False):
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def main(sensor, topics=None, max_frames=None):
    """Track what the topics deliver until Ctrl-C, and publish it."""
    rclpy.init()
    node = rclpy.create_node("orbslam2py")
    executor = MultiThreadedExecutor()
    executor.add_node(node)
    threading.Thread(target=executor.spin, daemon=True).start()
    transport = RclpyTransport(node)
    request = Request(sensor=Sensor(sensor), topics=topics)
    device = TopicsDevice(lambda: transport, "rclpy", request)
    stream = LiveStream(device, sensor)
    source = StampedSource(stream)
    base = choose_base(stream.settings, device, None, None)
    n_tracked = 0
    try:
        with System(stream.settings, sensor) as slam:
            out = RosOutput(transport, slam, base, source.stamp_of, Path("map.orbmap"))
            with out, source:
                for frame in source:
                    record = slam.track(frame.images, frame.timestamp)
                    n_tracked += record.T_wc is not None
                    if max_frames is not None and record.frame_id + 1 >= max_frames:
                        break
    except KeyboardInterrupt:
        pass
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown()
    print(f"tracked {n_tracked} images")


USAGE = (
    "usage: python examples/ros2_node.py stereo "
    "[left=/cam/left/image_raw,right=/cam/right/image_raw]"
)

if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(USAGE)
    if rclpy is None:
        sys.exit(
            "rclpy is not found: source /opt/ros/DISTRIBUTION/setup.bash; without ROS 2 take "
            "'orbslam2py run ros2:'"
        )
    main(*sys.argv[1:])
