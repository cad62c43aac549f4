# SPDX-License-Identifier: BSD-3-Clause
"""The live viewer of a run: its options, its start, and its end."""

from __future__ import annotations

import contextlib
import threading
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from orbslam2py.datasets.base import LiveSource, Sequence
from orbslam2py.errors import OrbSlamError
from orbslam2py.runs.control import RunControl
from orbslam2py.runs.feeds import is_sequence
from orbslam2py.runs.latency import latency_words
from orbslam2py.runs.result import DROPPED, FrameRow
from orbslam2py.slam.system import System
from orbslam2py.trajectory import Trajectory

if TYPE_CHECKING:
    from orbslam2py.viewer.live import LiveView

_LOOPBACK = "127.0.0.1"

ViewerFlag = Annotated[
    bool, typer.Option("--viewer", help="Show image and map in the browser while it runs.")
]
ViewerPort = Annotated[
    int | None,
    typer.Option(help="Port of the viewer's page [8080 or the next free one].", metavar="PORT"),
]
ViewerHost = Annotated[
    str | None,
    typer.Option(
        help="Address at which the page is served [127.0.0.1: to this computer only]. Everyone who "
        "can reach another address sees the images and can use the buttons.",
        metavar="ADDRESS",
    ),
]
ViewerExit = Annotated[
    bool, typer.Option("--viewer-exit", help="End the viewer with the run, not at Ctrl-C.")
]


@dataclass(frozen=True)
class ViewerOptions:
    """The options of the viewer on the command line."""

    wanted: bool = False
    port: int | None = None
    host: str | None = None
    exit: bool = False

    def __post_init__(self) -> None:
        for name, given in (
            ("--viewer-port", self.port is not None),
            ("--viewer-host", self.host is not None),
            ("--viewer-exit", self.exit),
        ):
            if given and not self.wanted:
                raise typer.BadParameter(f"{name} is for the viewer; give --viewer as well")


class Viewing:
    """The viewer of a run, if requested; entered before the run, left when the viewer ends.

    Parameters
    ----------
    options : ViewerOptions
        Whether, and where.
    sequence : Sequence or LiveSource
        The sequence.
    in_real_time : bool
        Images come in real time: drawing must not delay tracking.
    stop : threading.Event
        Ends the run when set.

    Attributes
    ----------
    control : RunControl or None
        Control that lets the viewer pause the run; None for a camera, and without a viewer.
    """

    def __init__(
        self,
        options: ViewerOptions,
        sequence: Sequence | LiveSource,
        stop: threading.Event,
        *,
        in_real_time: bool,
    ) -> None:
        self._options = options
        self._in_real_time = in_real_time
        self._sequence = sequence
        self._stop = stop
        self._view: LiveView | None = None
        self._stopped_in_page = False
        self.control = RunControl(stop)

    def __enter__(self) -> Viewing:
        if self._options.wanted:
            from orbslam2py.viewer.live import LiveView, announce  # noqa: PLC0415  # slow to load

            host = self._options.host or _LOOPBACK
            name = self._sequence.name
            self._view = LiveView(
                host=host, port=self._options.port, title=name, stand_back=self._in_real_time
            )
            try:
                announce(self._view.address, open_browser=not self._options.exit)
            except BaseException:  # a Ctrl-C as well: what is not entered is not left
                self._view.stop()
                raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._view is not None:
            self._view.stop()

    def watch(self, system: System) -> AbstractContextManager[object]:
        """Show a system; see `orbslam2py.run_sequence`."""
        if self._view is None:
            return contextlib.nullcontext()
        from orbslam2py.viewer.live import FRAME_RATE  # noqa: PLC0415
        from orbslam2py.viewer.publisher import Publisher  # noqa: PLC0415

        recorded = is_sequence(self._sequence)
        self._view.attach(
            system,
            truth=self._truth(),
            control=self.control if recorded else None,
            stop=self._stop_run,
            folder=Path("runs"),
        )
        return Publisher(system, [self._view], frame_rate=FRAME_RATE)

    def count(self, row: FrameRow) -> None:
        """Take note of a frame: whether it was dropped, and how long it took."""
        if self._view is not None and row.reason == DROPPED:
            self._view.count_dropped()
        if self._view is not None and row.latency is not None:
            self._view.tell_latency(latency_words(row.latency))

    def stay(self, console: Console, folder: Path | None) -> None:
        """Keep the page until Ctrl-C, unless it should end with the run."""
        interrupted = self._stop.is_set() and not self._stopped_in_page
        if self._view is None or self._options.exit or interrupted:
            return
        self._view.tell_end(f"The run has ended; its results are in {folder}.")
        text = f"The viewer stays at {self._view.address} until Ctrl-C."
        # Ctrl-C counts from the moment that the text is shown.
        with contextlib.suppress(KeyboardInterrupt):
            console.print(text, highlight=False, soft_wrap=True)
            self._view.wait()

    def _stop_run(self) -> None:
        self._stopped_in_page = True
        self._stop.set()

    def _truth(self) -> Trajectory | None:
        try:
            return self._sequence.ground_truth()
        except (OrbSlamError, OSError):
            return None  # the report says why
