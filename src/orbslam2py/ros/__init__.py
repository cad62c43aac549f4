# SPDX-License-Identifier: BSD-3-Clause
"""ROS 2 without ROS: topics in and out over DDS and Zenoh."""
