# SPDX-License-Identifier: BSD-3-Clause
"""Kinds of live sources by the prefix of their names."""

from __future__ import annotations

import importlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from orbslam2py.errors import DatasetError
from orbslam2py.live.device import Device, FoundDevice, Request
from orbslam2py.settings import Sensor

#: The text before the colon; a single letter is a drive of Windows.
_PREFIX = re.compile(r"[a-z][a-z0-9]+")


@dataclass(frozen=True)
class Kind:
    """A kind of live source.

    Attributes
    ----------
    prefix
        What its names begin with, without the colon.
    example
        A name as users write it.
    what
        Short description.
    module
        Module with ``open_device(request)``, which makes a `Device` (not started), and
        ``find_devices()``, which lists those that are plugged in. It is loaded on first use and
        may raise `ModuleNotFoundError` for a package that is not installed.
    extra
        Extra of the package that installs what the module needs; None if it needs nothing.
    sensors
        What its images can be used for, the one by default first.
    has_topics
        Whether ``--topics`` goes with it.
    can_be_listed
        Whether its module has ``find_devices()`` for it: cameras with addresses cannot be found.
    """

    prefix: str
    example: str
    what: str
    module: str
    extra: str | None = None
    sensors: tuple[Sensor, ...] = (Sensor.MONOCULAR,)
    has_topics: bool = False
    can_be_listed: bool = True

    def open(self, request: Request) -> Device:
        """Make a device, without starting it.

        Raises
        ------
        DatasetError
            If its package is not installed, or there is no such device, with the remedy.
        """
        opener = cast(Callable[[Request], Device], self._load("open_device"))
        return opener(request)

    def find(self) -> list[FoundDevice]:
        """List the devices that are plugged in.

        Raises
        ------
        DatasetError
            If its package is not installed, or cannot look.
        """
        return cast(Callable[[], list[FoundDevice]], self._load("find_devices"))()

    def _load(self, name: str) -> object:
        try:
            return getattr(importlib.import_module(self.module), name)
        except ImportError as error:
            raise DatasetError(self._missing(error)) from error

    def _missing(self, error: ImportError) -> str:
        if self.extra is None:
            return f"{self.prefix}: cannot be used: {error}"
        if not isinstance(error, ModuleNotFoundError):
            return (
                f"{self.prefix}: its Python package is installed but cannot be loaded: {error}; "
                "install the library of the system that is missing (for libusb-1.0.so.0 on Debian: "
                "sudo apt install libusb-1.0-0)"
            )
        return (
            f"{self.prefix}: needs the package {error.name or error}, which is not installed; "
            f'install it: pip install "orbslam2py[{self.extra}]"'
        )


#: A new kind is one entry here.
KINDS: tuple[Kind, ...] = (
    Kind(
        "realsense",
        "realsense:",
        "RealSense camera, by its serial number or the first one",
        "orbslam2py.live.realsense",
        "realsense",
        sensors=(Sensor.STEREO, Sensor.RGBD, Sensor.MONOCULAR),
    ),
    Kind(
        "oak",
        "oak:",
        "OAK camera, by its id or the first one",
        "orbslam2py.live.oak",
        "oak",
        sensors=(Sensor.STEREO, Sensor.RGBD, Sensor.MONOCULAR),
    ),
    Kind(
        "v4l",
        "v4l:0",
        "webcam or USB pair, by its number or device file",
        "orbslam2py.live.capture",
    ),
    Kind(
        "rtsp",
        "rtsp://HOST/PATH",
        "camera on the network",
        "orbslam2py.live.capture",
        can_be_listed=False,
    ),
    Kind(
        "http",
        "http://HOST/PATH",
        "camera on the network that sends MJPEG",
        "orbslam2py.live.capture",
        can_be_listed=False,
    ),
    Kind(
        "ros2",
        "ros2:",
        "topics of ROS 2 over DDS, of the domain in ROS_DOMAIN_ID or behind the colon",
        "orbslam2py.ros.dds_source",
        "ros2",
        sensors=(Sensor.STEREO, Sensor.RGBD, Sensor.MONOCULAR),
        has_topics=True,
        can_be_listed=False,
    ),
    Kind(
        "zenoh",
        "zenoh:tcp/HOST:7447",
        "topics of ROS 2 over Zenoh (rmw_zenoh), by the address of a router",
        "orbslam2py.ros.zenoh_source",
        "ros2",
        sensors=(Sensor.STEREO, Sensor.RGBD, Sensor.MONOCULAR),
        has_topics=True,
        can_be_listed=False,
    ),
)


def kind_of(source: str) -> tuple[Kind, str] | None:
    """Split the name of a live source into its kind and the address; None if it is none.

    Raises
    ------
    DatasetError
        If it begins like one, but there is no such kind.
    """
    prefix, colon, rest = source.partition(":")
    if not colon or _PREFIX.fullmatch(prefix) is None:
        return None
    kind = next((kind for kind in KINDS if kind.prefix == prefix), None)
    if kind is None:
        examples = ", ".join(kind.example for kind in KINDS)
        raise DatasetError(
            f"{source} does not exist, and '{prefix}:' is no kind of live source; there are: "
            f"{examples}"
        )
    return kind, source if rest.startswith("//") else rest
