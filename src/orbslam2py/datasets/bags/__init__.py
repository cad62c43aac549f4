# SPDX-License-Identifier: BSD-3-Clause
"""Bags of ROS 1 and ROS 2, read without ROS."""

from orbslam2py.datasets.bags.bag import is_bag
from orbslam2py.datasets.bags.sequence import BagSequence
from orbslam2py.datasets.bags.topics import parse_topics

__all__ = ["BagSequence", "is_bag", "parse_topics"]
