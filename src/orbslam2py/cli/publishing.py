# SPDX-License-Identifier: BSD-3-Clause
"""What a run publishes to nodes of ROS 2: its options, and how it takes part in the run."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

import typer

from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import DatasetError
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.slam.system import System

if TYPE_CHECKING:
    from orbslam2py.ros.base_frame import BaseFrame
    from orbslam2py.ros.output import StampOf
    from orbslam2py.ros.transport import Transport

_NETWORKS = ("ros2:", "zenoh:")
_NOTHING = "none"
_MAP_NAME = "map.orbmap"

PublishOption = Annotated[
    str | None,
    typer.Option(
        help="Publish pose, odometry, path, map points and transforms to ROS 2 nodes: ros2:DOMAIN "
        "(DDS) or zenoh:ADDRESS; none: nothing [where the images come from, if these are topics].",
        metavar="NETWORK",
    ),
]
BaseFrameOption = Annotated[
    str | None,
    typer.Option(
        help="Frame of the robot that is published; /tf_static or --base-transform tells where the "
        "camera is in it [base_link].",
        metavar="NAME",
    ),
]
BaseTransformOption = Annotated[
    str | None,
    typer.Option(
        help="Where the camera is in the robot's frame: position of one that looks forward, or "
        "position and quaternion of its optical frame, or a file with these numbers.",
        metavar="X,Y,Z[,QX,QY,QZ,QW]",
    ),
]


@dataclass(frozen=True)
class PublishOptions:
    """What the command line says about publishing.

    Raises
    ------
    DatasetError
        If the frame of the robot is given, but nothing is published.
    """

    network: str | None = None
    base_frame: str | None = None
    base_transform: str | None = None

    @classmethod
    def of(
        cls, source: str, publish: str | None, base_frame: str | None, base_transform: str | None
    ) -> PublishOptions:
        """Choose the network: the one named, or that of the images."""
        network = publish
        if publish is None and source.startswith(_NETWORKS):
            network = source
        if publish == _NOTHING:
            network = None
        for option, given in (("base-frame", base_frame), ("base-transform", base_transform)):
            if given is not None and network is None:
                raise DatasetError(
                    f"--{option} is for the poses that are published; give --publish ros2: as "
                    "well, or leave it out"
                )
        return cls(network, base_frame, base_transform)


class Publishing:
    """Publishes a run, if that is wanted.

    Parameters
    ----------
    options
        Whether, and where to.
    sequence
        What is run.
    map_path
        File of the service that saves the map; None: one in the folder of the results.
    output
        That folder.

    Attributes
    ----------
    sequence
        What is to be run in its place: it notes the stamps of the images.

    Raises
    ------
    DatasetError
        If the network cannot be reached, or nothing tells where the camera is on the robot.
    """

    def __init__(
        self,
        options: PublishOptions,
        sequence: Sequence | LiveSource,
        map_path: Path | None,
        output: Path,
    ) -> None:
        self.sequence = sequence
        self._map_path = map_path or output / _MAP_NAME
        self._transport: Transport | None = None
        if options.network is None:
            return
        from orbslam2py.ros.base_frame import choose_base  # noqa: PLC0415  # slow to load
        from orbslam2py.ros.connect import connect  # noqa: PLC0415
        from orbslam2py.ros.device import TopicsDevice  # noqa: PLC0415
        from orbslam2py.ros.stamps import StampedSource, device_of, nanoseconds  # noqa: PLC0415

        device = device_of(sequence)
        topics = device if isinstance(device, TopicsDevice) else None
        self._base: BaseFrame = choose_base(
            sequence.settings, topics, options.base_frame, options.base_transform
        )
        self._stamp_of: StampOf = nanoseconds
        if not is_sequence(sequence):
            stamped = StampedSource(cast(LiveSource, sequence))
            self._stamp_of, self.sequence = stamped.stamp_of, cast(LiveSource, stamped)
        self._transport = connect(options.network)

    @contextlib.contextmanager
    def watch(self, system: System) -> Iterator[None]:
        """Publish a system from its first image to its last."""
        if self._transport is None:
            yield
            return
        from orbslam2py.ros.output import RosOutput  # noqa: PLC0415

        arguments = (self._transport, system, self._base, self._stamp_of, self._map_path)
        with RosOutput(*arguments):
            yield

    def __enter__(self) -> Publishing:
        return self

    def __exit__(self, *_: object) -> None:
        if self._transport is not None:
            self._transport.close()
