# SPDX-License-Identifier: BSD-3-Clause
"""Live input: cameras, IMUs and topics that deliver while a program runs."""

from orbslam2py.live.camera import LiveCamera
from orbslam2py.live.device import Device, FoundDevice, Request, Sink, Stream
from orbslam2py.live.open_source import open_source
from orbslam2py.live.recorder import InputRecorder
from orbslam2py.live.registry import KINDS, Kind
from orbslam2py.live.stream import LiveStream

__all__ = [
    "KINDS",
    "Device",
    "FoundDevice",
    "InputRecorder",
    "Kind",
    "LiveCamera",
    "LiveStream",
    "Request",
    "Sink",
    "Stream",
    "open_source",
]
