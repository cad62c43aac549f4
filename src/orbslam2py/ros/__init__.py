# SPDX-License-Identifier: BSD-3-Clause
"""ROS 2 without ROS: topics in and out over DDS and Zenoh."""

from orbslam2py.ros.base_frame import choose_base
from orbslam2py.ros.connect import connect
from orbslam2py.ros.device import TopicsDevice
from orbslam2py.ros.output import RosOutput
from orbslam2py.ros.stamps import StampedSource
from orbslam2py.ros.transport import LiveTopic

__all__ = ["LiveTopic", "RosOutput", "StampedSource", "TopicsDevice", "choose_base", "connect"]
