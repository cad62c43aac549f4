# SPDX-License-Identifier: BSD-3-Clause
"""The live viewer: a page in the browser that shows a system while it works.

Drawing and serving happen in a separate process (`orbslam2py.viewer.process`): tracking sends plain
data ten times a second.
"""

from __future__ import annotations

import contextlib
import importlib.util
import logging
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

from orbslam2py._arguments import instance_of, shown
from orbslam2py._waiting import wait_for_event
from orbslam2py.errors import StateError
from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import Event, LoopClosed, MapsMerged
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.slam.system import System
from orbslam2py.trajectory import Trajectory
from orbslam2py.viewer.actions import ActionsOnSystem
from orbslam2py.viewer.controls import RunActions
from orbslam2py.viewer.frusta import vertical_angle
from orbslam2py.viewer.level_map import level_positions
from orbslam2py.viewer.process import Companion, CompanionError
from orbslam2py.viewer.process.messages import PathNow, Subject
from orbslam2py.viewer.publisher import Publisher
from orbslam2py.viewer.resting_maps import RestingMaps
from orbslam2py.viewer.server import LOOPBACK, open_page, require_viser
from orbslam2py.viewer.watching import FrameView

_log = logging.getLogger(__name__)

#: Images a second that are shown at most.
FRAME_RATE = 10.0


class LiveView:
    """A watcher that shows the run in a page of a separate process.

    This process has a low priority, ignores Ctrl-C, and ends with the main process. If it ends
    first, the run continues without it.

    Parameters
    ----------
    host : str
        Address of the page; by default only for this computer.
    port : int, optional
        The port, which must be free; by default 8080 or the next free one.
    title : str
        Title of the page.
    stand_back : bool
        Use only idle time of the processor, if the system supports this (Linux): for images in real
        time. If all cores are busy, little is shown.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.
    """

    name = "the viewer"

    def __init__(
        self,
        *,
        host: str = LOOPBACK,
        port: int | None = None,
        title: str = "orbslam2py",
        stand_back: bool = False,
    ) -> None:
        if importlib.util.find_spec("viser") is None:
            require_viser()  # what it says
        self._system: System | None = None
        self._control: RunActions | None = None
        self._answers: dict[str, Callable[..., object]] = {}
        self._n_dropped = 0
        self._latency = ""
        self._missed = False
        self._companion = Companion(
            host=host,
            port=port,
            title=title,
            stand_back=stand_back,
            answers=self._answers,
            on_end=self._ended,
        )

    @property
    def address(self) -> str:
        """Address of the page for a browser."""
        return self._companion.address

    @property
    def process_id(self) -> int:
        """Of the process that serves the page."""
        return self._companion.process_id

    def attach(
        self,
        system: System,
        *,
        truth: Trajectory | None = None,
        control: RunActions | None = None,
        stop: Callable[[], None] | None = None,
        folder: str | Path = ".",
    ) -> None:
        """Send the description of the system.

        Parameters
        ----------
        system : System
            The requests of the buttons.
        truth : Trajectory, optional
            Ground truth, drawn with the estimated trajectory.
        control : RunActions, optional
            Control that can pause the run, if it is recorded.
        stop : callable, optional
            The stop event of the run.
        folder : path
            The folder of saved maps.

        Raises
        ------
        StateError
            If `system` is no `System`, or `truth` no trajectory.
        """
        _require_system(system)
        if truth is not None:
            remedy = "an orbslam2py.Trajectory, or None"
            instance_of(truth, Trajectory, "truth", remedy, StateError)
        self._system, self._control = system, control
        actions = ActionsOnSystem(system, Path(folder))
        self._answers.update(
            path=self._path,
            neighbours=actions.neighbours,
            set_localization=actions.set_localization,
            reset=actions.reset,
            optimize=actions.optimize,
            save=actions.save,
        )
        if control is not None:
            self._answers.update(pause=control.pause, resume=control.resume, step=control.step)
        if stop is not None:
            self._answers.update(stop=stop)
        camera = system.settings.camera
        subject = Subject(
            fov=vertical_angle(camera),
            with_scale=not system.sensor.has_depth,
            truth=truth,
            can_hold=control is not None,
            can_stop=stop is not None,
        )
        with contextlib.suppress(CompanionError):  # the first image finds out
            self._companion.tell("attach", subject)

    # ---- as a watcher ----------------------------------------------------------------------------
    def on_frame(self, view: FrameView) -> None:
        """Show an image and its pose."""
        assert self._system is not None
        shown = replace(
            view,
            record=_light(view.record),
            earlier=tuple(_light(record) for record in view.earlier),
            queue=replace(view.queue, n_dropped=self._n_dropped, latency=self._latency),
        )
        self._show("on_frame", shown, self._system.localization_mode)

    def on_map(self, changes: MapChanges) -> None:
        """Show the changes of the map."""
        self._show("on_map", changes)

    def on_resting_maps(self, maps: RestingMaps) -> None:
        """Show the inactive maps beside the active one."""
        self._show("on_resting_maps", maps)

    def on_event(self, event: Event) -> None:
        """Report a loop closure or a merge."""
        if isinstance(event, LoopClosed | MapsMerged):
            self._show("on_event", event)

    def _show(self, *news: object) -> None:
        try:
            self._companion.show(*news)
        except CompanionError:
            self._missed = True  # the publisher tells it
            raise

    def close(self) -> None:
        """Show the final state; the page stays open."""
        with contextlib.suppress(CompanionError):  # it was said, or is when the page is missed
            self._companion.tell("close", self._n_dropped)

    def tell_end(self, text: str) -> None:
        """Show below the image that the run has ended."""
        with contextlib.suppress(CompanionError):
            self._companion.tell("tell_end", text)

    def look_from(self, eye: npt.NDArray[np.float64], target: npt.NDArray[np.float64]) -> None:
        """Fix the view of all browsers at a position (3,), looking at another, world."""
        if self._system is not None:
            slam_map = self._system.pipeline.back_end.map
            eye, target = level_positions(np.stack([eye, target]), slam_map)
        with contextlib.suppress(CompanionError):
            self._companion.tell("look_from", eye, target)

    def count_dropped(self) -> None:
        """Report an image that was dropped before tracking."""
        self._n_dropped += 1

    def tell_latency(self, text: str) -> None:
        """Say below the next image how long the last one took from exposure to pose."""
        self._latency = text

    def wait(self) -> None:
        """Keep the page until Ctrl-C, or until it is closed."""
        with contextlib.suppress(KeyboardInterrupt):
            wait_for_event(self._companion.ended)
            if not self._missed:
                _log.warning("the viewer stopped: %s", self._companion.why)

    def stop(self) -> None:
        """End the page."""
        self._companion.stop()

    def _ended(self) -> None:
        """Let a paused run continue: the page is closed and nobody else can."""
        # Also if the view is closed: an image that could not be shown may have been the first to
        # tell, and a run that has ended does not mind.
        if self._control is not None and self._control.paused:
            self._control.resume()

    def _path(self) -> PathNow:
        assert self._system is not None
        begin = time.perf_counter()
        path, slam_map = self._system.trajectory(), self._system.pipeline.back_end.map
        return PathNow(
            path.timestamps,
            np.ascontiguousarray(level_positions(path.positions, slam_map)),
            bool(slam_map.is_upright(slam_map.active_map)),
            path.lost,
            time.perf_counter() - begin,
        )


def _light(record: TrackingRecord) -> TrackingRecord:
    """A record without the keypoints, which the view contains itself."""
    return record if record.features is None else replace(record, features=None)


class Viewer:
    """Shows a running system in the browser.

    Only this computer can open the page, unless another host is given. It ends with the block;
    `wait` keeps it until Ctrl-C.

    Parameters
    ----------
    system : System
        The system to show.
    host : str
        Address of this computer to listen at. Anybody who can reach it sees the images and can use
        the buttons.
    port : int, optional
        The port, which must be free; by default 8080 or the next free one.
    truth : Trajectory, optional
        Ground truth, drawn with the estimated trajectory.
    open_browser : bool
        Open the page if there is a screen; its address is always printed.

    Attributes
    ----------
    address : str
        Address of the page for a browser.
    stopped : threading.Event
        Set when a user presses Stop: check it in the loop that reads the images.

    Raises
    ------
    StateError
        If `system` is no `System`, viser is not installed, or the page cannot be served there.

    Examples
    --------
    >>> with orb.System("tum1", "rgbd") as slam, orb.Viewer(slam):  # doctest: +SKIP
    ...     slam.run(sequence)
    """

    def __init__(
        self,
        system: System,
        *,
        host: str = LOOPBACK,
        port: int | None = None,
        truth: Trajectory | None = None,
        open_browser: bool = True,
    ) -> None:
        _require_system(system)
        self.stopped = threading.Event()
        self._publisher: Publisher | None = None
        self._view = LiveView(host=host, port=port)
        try:
            self.address = self._view.address
            self._view.attach(system, truth=truth, stop=self.stopped.set)
            self._publisher = Publisher(system, [self._view], frame_rate=FRAME_RATE)
            announce(self.address, open_browser=open_browser)
        except BaseException:  # a Ctrl-C as well: nobody else could end the page
            self.close()
            raise

    def look_from(self, eye: npt.ArrayLike, target: npt.ArrayLike) -> None:
        """Fix the view of all browsers at a position (3,), looking at another, world of the map."""
        self._view.look_from(np.asarray(eye, float), np.asarray(target, float))

    def wait(self) -> None:
        """Keep the page until Ctrl-C."""
        self._view.wait()

    def close(self) -> None:
        """End the page."""
        if self._publisher is not None:
            self._publisher.close()
        self._view.stop()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def _require_system(system: object) -> None:
    if not isinstance(system, System):
        raise StateError(f"a viewer shows a System, not {shown(system)}")


def announce(address: str, *, open_browser: bool) -> None:
    """Open the page if there is a screen, and print its address."""
    opened = open_browser and open_page(address)
    print(f"The viewer is at {address}" + ("" if opened else ": open it in a browser"), flush=True)
