# SPDX-License-Identifier: BSD-3-Clause
"""From the name of a network of nodes to a connection."""

from __future__ import annotations

import importlib

from orbslam2py.errors import DatasetError
from orbslam2py.ros.transport import Transport
from orbslam2py.ros.types import missing_extra

_KINDS = {
    "ros2": ("orbslam2py.ros.dds", "DdsTransport"),
    "zenoh": ("orbslam2py.ros.zenoh", "ZenohTransport"),
}


def connect(name: str) -> Transport:
    """Open the connection of a name: ``ros2:``, ``ros2:DOMAIN``, ``zenoh:`` or ``zenoh:ADDRESS``.

    Raises
    ------
    DatasetError
        If the name is none, its package is not installed, or nobody answers there.
    """
    prefix, colon, address = name.partition(":")
    if not colon or prefix not in _KINDS:
        raise DatasetError(
            f"'{name}' is no network of nodes; give ros2: or ros2:DOMAIN (DDS), or zenoh: or "
            "zenoh:tcp/ADDRESS:PORT"
        )
    module, kind = _KINDS[prefix]
    try:
        opened = getattr(importlib.import_module(module), kind)
    except ImportError as error:
        raise missing_extra(error.name or str(error), prefix) from error
    transport: Transport = opened(address)
    return transport
