# SPDX-License-Identifier: BSD-3-Clause
"""What a run publishes to nodes of ROS 2 and to Foxglove: options, and its part in the run."""

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
#: Ending of recordings for Foxglove.
MCAP = ".mcap"
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
        help="Frame of the robot that is published; /tf_static or --base-transform gives the pose "
        "of the camera in it [base_link].",
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
FoxgloveFlag = Annotated[
    bool,
    typer.Option(
        "--foxglove",
        help="Serve pose, path, map and image with keypoints to Foxglove's app (needs "
        "orbslam2py[foxglove]); --record FILE.mcap writes the same.",
    ),
]
FoxglovePort = Annotated[
    int | None,
    typer.Option(help="Port for Foxglove's app [8765 or the next free one].", metavar="PORT"),
]
FoxgloveHost = Annotated[
    str | None,
    typer.Option(
        help="Address for Foxglove's app [127.0.0.1: this computer only]. Everyone who can "
        "reach another address sees the images.",
        metavar="ADDRESS",
    ),
]


@dataclass(frozen=True)
class PublishOptions:
    """Options of the command line for publishing.

    Raises
    ------
    DatasetError
        If an option is given that has no effect.
    """

    network: str | None = None
    base_frame: str | None = None
    base_transform: str | None = None
    foxglove: bool = False
    foxglove_port: int | None = None
    foxglove_host: str | None = None
    record: Path | None = None

    def __post_init__(self) -> None:
        for name in ("foxglove_port", "foxglove_host"):
            if getattr(self, name) is not None and not self.foxglove:
                option = name.replace("_", "-")
                raise DatasetError(f"--{option} is for Foxglove; give --foxglove as well")
        if self.network is None and not self.foxglove and self.record is None:
            for name in ("base_frame", "base_transform"):
                if getattr(self, name) is not None:
                    option = name.replace("_", "-")
                    raise DatasetError(
                        f"--{option} is for the poses that are published; give --publish ros2: as "
                        "well, or leave it out"
                    )


def network_of(source: str, publish: str | None) -> str | None:
    """Choose the network: the one named, or that of the images; None for none."""
    if publish is None:
        return source if source.startswith(_NETWORKS) else None
    return None if publish == _NOTHING else publish


@dataclass(frozen=True)
class _Output:
    """A connection and its publishers."""

    transport: Transport
    base: BaseFrame
    map_path: Path | None = None
    with_images: bool = False
    every_image: bool = False


class Publishing:
    """Publishes a run, if that is wanted; entered before it.

    Parameters
    ----------
    options
        Whether, and where to.
    sequence
        The sequence of the run.
    in_time
        Whether images come when they come: then some may be passed over.
    map_path
        File of the service that saves the map; None: one in the folder of the results.
    output
        That folder.

    Attributes
    ----------
    sequence
        The sequence to run in its place: it notes the stamps of the images.

    Raises
    ------
    OrbSlamError
        If a network cannot be reached, a file cannot be written, a package is missing, or the pose
        of the camera on the robot is unknown.
    """

    def __init__(
        self,
        options: PublishOptions,
        sequence: Sequence | LiveSource,
        *,
        in_time: bool,
        map_path: Path | None,
        output: Path,
    ) -> None:
        self.sequence = sequence
        self._outputs: list[_Output] = []
        self._options, self._map_path = options, map_path or output / _MAP_NAME
        with contextlib.ExitStack() as stack:
            stack.callback(self._close)
            if options.network is not None or options.foxglove or options.record is not None:
                self._connect(in_time=in_time)
            stack.pop_all()

    def _connect(self, *, in_time: bool) -> None:
        from orbslam2py.ros.base_frame import base_of_camera, choose_base, for_viewers  # noqa: PLC0415  # slow to load
        from orbslam2py.ros.connect import announce, connect, connect_foxglove  # noqa: PLC0415
        from orbslam2py.ros.device import TopicsDevice  # noqa: PLC0415
        from orbslam2py.ros.stamps import StampedSource, device_of, nanoseconds  # noqa: PLC0415

        options, sequence = self._options, self.sequence
        device = device_of(sequence)
        topics = device if isinstance(device, TopicsDevice) else None
        base = base_of_camera()
        if options.network is not None or options.base_transform or options.base_frame:
            base = choose_base(
                sequence.settings, topics, options.base_frame, options.base_transform
            )
        self._stamp_of: StampOf = nanoseconds
        if not is_sequence(sequence):
            stamped = StampedSource(cast(LiveSource, sequence))
            self._stamp_of, self.sequence = stamped.stamp_of, cast(LiveSource, stamped)
        if options.network is not None:
            transport = connect(options.network)
            self._outputs.append(_Output(transport, base, self._map_path))
            if topics is None or options.network != topics.name:
                announce(transport)  # the topics have given the sender
        if options.foxglove:
            app = connect_foxglove(options.foxglove_host, options.foxglove_port)
            self._outputs.append(_Output(app, for_viewers(base), with_images=True))
        if options.record is not None:
            file = connect_foxglove(file=options.record)
            shown = for_viewers(base)
            every = not in_time
            self._outputs.append(_Output(file, shown, with_images=True, every_image=every))

    @contextlib.contextmanager
    def watch(self, system: System) -> Iterator[None]:
        """Publish a system from its first image to its last."""
        if not self._outputs:
            yield
            return
        from orbslam2py.ros.output import RosOutput  # noqa: PLC0415

        with contextlib.ExitStack() as stack:
            for one in self._outputs:
                made = RosOutput(
                    *(one.transport, system, one.base, self._stamp_of, one.map_path),
                    with_images=one.with_images,
                    every_image=one.every_image,
                )
                stack.enter_context(made)
            yield

    def __enter__(self) -> Publishing:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        for one in self._outputs:
            one.transport.close()
