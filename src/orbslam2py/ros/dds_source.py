# SPDX-License-Identifier: BSD-3-Clause
"""``ros2:``, topics over DDS, as a kind of live source."""

from __future__ import annotations

from functools import partial

from orbslam2py.live.device import Request
from orbslam2py.ros.connect import connect
from orbslam2py.ros.device import TopicsDevice

_PREFIX = "ros2"


def open_device(request: Request) -> TopicsDevice:
    """Join the domain of a request and choose its topics, without starting."""
    return TopicsDevice(partial(connect, f"{_PREFIX}:{request.address}"), _PREFIX, request)
