# SPDX-License-Identifier: BSD-3-Clause
"""From the name of a network of nodes to a connection."""

from __future__ import annotations

import importlib
import logging
from pathlib import Path

from orbslam2py.errors import DatasetError
from orbslam2py.ros.transport import Transport
from orbslam2py.ros.types import missing_extra, type_store

_log = logging.getLogger(__name__)

_KINDS = {
    "ros2": ("orbslam2py.ros.dds", "DdsTransport"),
    "zenoh": ("orbslam2py.ros.zenoh", "ZenohTransport"),
}


def connect(name: str) -> Transport:
    """Open the connection of a name: ``ros2:``, ``ros2:DOMAIN``, ``zenoh:`` or ``zenoh:ADDRESS``.

    Raises
    ------
    DatasetError
        If the name is invalid, its package is not installed, or there is no answer.
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


def announce(transport: Transport) -> None:
    """Tell the user where a run is published."""
    _log.info(
        "%s: published in domain %d, on %s",
        *(transport.prefix, transport.domain, transport.where),
    )


def connect_foxglove(
    host: str | None = None, port: int | None = None, *, file: Path | None = None
) -> Transport:
    """Serve to Foxglove's app, or write an MCAP file if one is given.

    Parameters
    ----------
    host, port
        Where to serve; by default to this computer only, at port 8765 or the next free one.
    file
        What to write in place of serving.

    Raises
    ------
    DatasetError
        If Foxglove's package is not installed, or the port is taken.
    OutputFileError
        If the file cannot be written.
    """
    try:
        module = importlib.import_module("orbslam2py.ros.foxglove")
        type_store()
    except ImportError as error:
        raise DatasetError(
            f"foxglove: needs the package {error.name}, which is not installed; install it: "
            'pip install "orbslam2py[foxglove]"'
        ) from error
    serving = None if file is not None else module.Serving(host or module.LOOPBACK, port)
    transport: Transport = module.FoxgloveTransport(serving, file)
    return transport
