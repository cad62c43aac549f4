# SPDX-License-Identifier: BSD-3-Clause
"""``zenoh:``, topics over Zenoh, as a kind of live source."""

from __future__ import annotations

from functools import partial

from orbslam2py.live.device import Request
from orbslam2py.ros.connect import connect
from orbslam2py.ros.device import TopicsDevice

_PREFIX = "zenoh"


def open_device(request: Request) -> TopicsDevice:
    """Connect to the router of a request and choose its topics, without starting."""
    return TopicsDevice(partial(connect, f"{_PREFIX}:{request.address}"), _PREFIX, request)
