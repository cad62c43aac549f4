# SPDX-License-Identifier: BSD-3-Clause
"""The live viewer: a page in the browser that shows a system while it works."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray
from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import Event, LoopClosed
from orbslam2py.slam.system import System
from orbslam2py.trajectory import Trajectory
from orbslam2py.viewer.actions import ActionsOnSystem
from orbslam2py.viewer.controls import RunActions, RunControls, SystemControls
from orbslam2py.viewer.left_panel import overlaid, status_of, thumbnail
from orbslam2py.viewer.page import Page
from orbslam2py.viewer.paths import OnlinePath, lay_truth, pieces
from orbslam2py.viewer.plots import LastMinute
from orbslam2py.viewer.publisher import Publisher
from orbslam2py.viewer.server import LOOPBACK, open_page
from orbslam2py.viewer.watching import FrameView

_log = logging.getLogger(__name__)

#: Seconds between two drawings of what need not be drawn with every image.
_PATHS, _PLOTS, _LOCAL = 1.0, 0.5, 0.3
#: Images a second that are shown at most: they are drawn beside tracking, on the same cores.
FRAME_RATE = 10.0
#: Seconds without news after which all of it is drawn.
_STILL = 0.4
#: What takes a second is done again after so many.
_REST = 15.0


class LiveView:
    """A watcher that shows what it is told in a page.

    Parameters
    ----------
    host : str
        Where the page is served; by default only this computer is.
    port : int, optional
        The port, which must be free; by default 8080 or the next free one.
    title : str
        What is seen, for the head of the page.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.
    """

    name = "the viewer"

    def __init__(
        self, *, host: str = LOOPBACK, port: int | None = None, title: str = "orbslam2py"
    ) -> None:
        self.page = Page(host=host, port=port, title=title, on_client=self._refresh)
        self._lock = self.page.lock
        self._minute = LastMinute()
        self._online = OnlinePath()
        self._truth: Trajectory | None = None
        self._system: System | None = None
        self._actions: ActionsOnSystem | None = None
        self._run_controls: RunControls | None = None
        self._system_controls: SystemControls | None = None
        self._view: FrameView | None = None
        self._picture: ByteArray | None = None
        self._note = ""
        self._n_dropped = 0
        self._next: dict[str, float] = {}
        self._shown_at: float | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._catch_up, name="viewer page", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """What a person types into a browser."""
        return self.page.address

    def attach(
        self,
        system: System,
        *,
        truth: Trajectory | None = None,
        control: RunActions | None = None,
        stop: Callable[[], None] | None = None,
        folder: str | Path = ".",
    ) -> None:
        """Say whose page it is.

        Parameters
        ----------
        system : System
            What the buttons ask.
        truth : Trajectory, optional
            The true path, which is laid over the estimated one.
        control : RunActions, optional
            What can hold the run, if it is recorded.
        stop : callable, optional
            What ends the run.
        folder : path
            Where maps are saved.
        """
        with self._lock:
            self._system, self._truth = system, truth
            self._actions = ActionsOnSystem(system, Path(folder))
            self.page.scene.fov = _field_of_view(system)
            self.page.neighbours = self._actions.neighbours
            if control is not None or stop is not None:
                self._run_controls = RunControls(self.page.server, control, stop)
            self._system_controls = SystemControls(self.page.server, self._actions)

    # ---- as a watcher ----------------------------------------------------------------------------
    def on_frame(self, view: FrameView) -> None:
        """Show an image, and where it was taken."""
        with self._lock:
            self._shown_at = time.perf_counter()
            for record in (*view.earlier, view.record):
                self._minute.add(record)
                self._online.add(record)
            self._view, self._picture = view, None
            self.page.colour_points(*_colours_of_points(view))
            if view.record.is_keyframe:
                self.page.keep_keyframe(
                    view.record.reference_keyframe,
                    self._overlaid(view),
                    len(view.pixels),
                    int(np.count_nonzero(view.matched)),
                )
            if self.page.is_watched:
                self._show(view)

    def on_map(self, changes: MapChanges) -> None:
        """Show what has become of the map."""
        with self._lock:
            self._shown_at = time.perf_counter()
            self.page.model.apply(changes)
            if changes.restarted:
                self.page.restart()
            if self.page.is_watched:
                self.page.draw_map()
                self._draw_paths()

    def on_event(self, event: Event) -> None:
        """Tell that a loop was closed."""
        if isinstance(event, LoopClosed):
            self.page.tell(
                "Loop closed",
                f"Keyframe {event.current_keyframe} is where keyframe {event.matched_keyframe} "
                f"was: moved by {event.translation:.3g}, turned by {event.rotation_deg:.2g} deg.",
            )

    def close(self) -> None:
        """Show the last of it; the page stays."""
        with self._lock:
            if self._run_controls is not None:
                self._run_controls.end()
            self._next.clear()
            self._refresh()

    def tell_end(self, text: str) -> None:
        """Say below the image that the run has ended."""
        with self._lock:
            self._note = text
            self._show_status()

    def count_dropped(self) -> None:
        """An image was dropped before it came to the system."""
        self._n_dropped += 1

    def stop(self) -> None:
        """End the page."""
        self._stopping.set()
        self._thread.join()
        self.page.stop()

    def _catch_up(self) -> None:
        """When nothing comes any more, draw what was left out for want of time."""
        while not self._stopping.wait(_STILL):
            with self._lock:
                still = self._shown_at is not None and time.perf_counter() > self._shown_at + _STILL
                if still and self.page.is_watched:
                    self._shown_at = None
                    self._refresh()

    # ---- drawing ---------------------------------------------------------------------------------
    def _refresh(self) -> None:
        with self._lock:
            self.page.draw_map(at_most=None)
            self._next.clear()
            if self._view is not None:
                self._show(self._view)
            self._draw_paths()

    def _show(self, view: FrameView) -> None:
        picture = self._overlaid(view)
        page, record = self.page, view.record
        page.left.show_image(picture)
        self._show_status()
        if self._is_time("local", _LOCAL):
            page.fit_size(view.local_points, record.T_wc)
            page.scene.draw_local(view.local_points)
        aspect = view.image.shape[1] / view.image.shape[0]
        page.show_camera(record.T_wc, thumbnail(picture), aspect)
        if self._is_time("plots", _PLOTS):
            page.left.plots.draw(self._minute.table())
        page.draw_map()
        if self._actions is not None and self._system_controls is not None:
            self._system_controls.show_localization(self._actions.localization)

    def _show_status(self) -> None:
        view, model = self._view, self.page.model
        if view is None:
            self.page.left.show_status(None, self._note)
            return
        status = status_of(view, len(model.keyframe_ids), model.n_points, self._n_dropped)
        self.page.left.show_status(status, self._note)

    def _overlaid(self, view: FrameView) -> ByteArray:
        if self._picture is None:
            self._picture = overlaid(view)
        return self._picture

    def _draw_paths(self) -> None:
        if self._system is None or not self._is_time("paths", _PATHS):
            return
        begin = time.perf_counter()
        path = self._path(self._system)
        gaps = np.concatenate([[True], path.lost[:-1]]) if len(path) else path.lost
        known = ~path.lost
        scene = self.page.scene
        scene.draw_path("path", pieces(path.positions[known], gaps[known]))
        scene.draw_path("online", self._online.lines())
        if self._truth is not None:
            monocular = not self._system.sensor.has_depth
            laid = lay_truth(path, self._truth, with_scale=monocular)
            scene.draw_path(
                "truth", np.zeros((0, 2, 3)) if laid is None else pieces(laid.positions)
            )
            self._note = "" if laid is None else f"{laid.error:.3f} m from the ground truth (ATE)"
        self._next["paths"] += _REST * (time.perf_counter() - begin)

    def _path(self, system: System) -> Trajectory:
        """The path through the present map, in its world."""
        path = system.trajectory()
        model = self.page.model
        if len(model.keyframe_ids) and model.keyframe_ids[0] == 0:
            path = Trajectory(
                path.timestamps, model.keyframe_T_wc[0] @ path.T_wc, path.lost, path.indices
            )
        return path

    def _is_time(self, what: str, period: float) -> bool:
        now = time.perf_counter()
        if now < self._next.get(what, 0.0):
            return False
        self._next[what] = now + period
        return True


def _colours_of_points(view: FrameView) -> tuple[np.ndarray, ByteArray]:
    """Ids of the points that were matched, and the colours of the image there."""
    ids = view.features.map_point_ids
    seen = (ids >= 0) & ~view.visual_odometry
    pixels = np.rint(view.pixels[seen]).astype(np.int64)
    height, width = view.image.shape[:2]
    columns = np.clip(pixels[:, 0], 0, width - 1)
    rows = np.clip(pixels[:, 1], 0, height - 1)
    colours = view.image[rows, columns]
    if colours.ndim == 1:
        colours = np.repeat(colours[:, None], 3, axis=1)
    return ids[seen], colours


def _field_of_view(system: System) -> float:
    """Vertical, in radians; the height of the image is not told before the first one."""
    camera = system.settings.camera
    return float(2 * np.arctan(camera.cy / camera.fy))


class Viewer:
    """Shows a system in the browser while it works.

    The page can be opened from this computer only, unless another host is named. It ends with the
    block; `wait` keeps it until Ctrl-C.

    Parameters
    ----------
    system : System
        What to show.
    host : str
        Address of this computer to listen at. Whoever can reach it sees the images and can use the
        buttons.
    port : int, optional
        The port, which must be free; by default 8080 or the next free one.
    truth : Trajectory, optional
        The true path, which is laid over the estimated one.
    open_browser : bool
        Open the page where there is a screen; its address is printed in any case.

    Attributes
    ----------
    address : str
        What a person types into a browser.
    stopped : threading.Event
        Set when somebody presses Stop: look at it in the loop that reads the images.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.

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
        self.stopped = threading.Event()
        self._view = LiveView(host=host, port=port)
        self.address = self._view.address
        self._view.attach(system, truth=truth, stop=self.stopped.set)
        self._publisher = Publisher(system, [self._view], frame_rate=FRAME_RATE)
        announce(self.address, open_browser=open_browser)

    def look_from(self, eye: npt.ArrayLike, target: npt.ArrayLike) -> None:
        """Let all browsers look from a place (3,) to another, in the world of the map."""
        self._view.page.look_from(np.asarray(eye, float), np.asarray(target, float))

    def wait(self) -> None:
        """Keep the page until Ctrl-C."""
        wait_for_interrupt()

    def close(self) -> None:
        """End the page."""
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


def announce(address: str, *, open_browser: bool) -> None:
    """Open the page where there is a screen, and print where it is."""
    opened = open_browser and open_page(address)
    print(f"The viewer is at {address}" + ("" if opened else ": open it in a browser"), flush=True)


def wait_for_interrupt() -> None:
    """Return at Ctrl-C."""
    with contextlib.suppress(KeyboardInterrupt):
        threading.Event().wait()
