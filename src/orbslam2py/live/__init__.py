# SPDX-License-Identifier: BSD-3-Clause
"""Live input: cameras, IMUs and topics that deliver while a program runs."""

from orbslam2py.live.device import Device, FoundDevice, Request, Sink, Stream

__all__ = ["Device", "FoundDevice", "Request", "Sink", "Stream"]
