# SPDX-License-Identifier: BSD-3-Clause
"""The page of a system that runs in another process."""

from __future__ import annotations

import threading
import time

import numpy as np

from orbslam2py._arguments import number_of
from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py.maps.changes import MapChanges
from orbslam2py.slam.events import LoopClosed, MapsMerged
from orbslam2py.viewer.actions import Neighbours
from orbslam2py.viewer.controls import RunControls, SystemControls
from orbslam2py.viewer.left_panel import overlaid, status_of, thumbnail
from orbslam2py.viewer.page import Page
from orbslam2py.viewer.paths import OnlinePath, lay_truth, pieces
from orbslam2py.viewer.plots import LastMinute
from orbslam2py.viewer.process.messages import PathNow, Subject
from orbslam2py.viewer.process.requests import Ask, RequestsToRun, RequestsToSystem
from orbslam2py.viewer.resting_maps import RestingMaps
from orbslam2py.viewer.watching import FrameView

#: Seconds between two drawings of what need not be drawn with every image.
_PATHS, _PLOTS, _LOCAL = 1.0, 0.5, 0.3
#: Seconds without news after which all of it is drawn.
_STILL = 0.4
#: Pause before the next request, as a multiple of the time that the answer took.
_REST = 30.0


class LivePage:
    """Draws the data of the other process, and sends it the user's requests.

    Parameters
    ----------
    ask : callable
        Calls a function in the other process: its name and arguments; returns the result.
    host, port, title
        See `LiveView`.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.
    """

    def __init__(self, ask: Ask, *, host: str, port: int | None, title: str) -> None:
        self._ask = ask
        self.page = Page(host=host, port=port, title=title, on_client=self._refresh)
        self._lock = self.page.lock
        self._minute = LastMinute()
        self._online = OnlinePath()
        self._subject: Subject | None = None
        self._run_controls: RunControls | None = None
        self._system_controls: SystemControls | None = None
        self._view: FrameView | None = None
        self._picture: ByteArray | None = None
        self._error = self._end = ""
        self._n_dropped = self._n_resting = 0
        self._next: dict[str, float] = {}
        self._shown_at: float | None = None
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._catch_up, name="catch up", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """Address of the page for a browser."""
        return self.page.address

    def attach(self, subject: Subject) -> None:
        """Get the description of the system."""
        with self._lock:
            self._subject = subject
            self.page.scene.fov = subject.fov
            self.page.neighbours = self._neighbours
            if subject.can_hold or subject.can_stop:
                run = RequestsToRun(self._ask)
                self._run_controls = RunControls(
                    self.page.server,
                    run if subject.can_hold else None,
                    run.stop if subject.can_stop else None,
                )
            self._system_controls = SystemControls(self.page.server, RequestsToSystem(self._ask))

    # ---- notifications ---------------------------------------------------------------------------
    def on_frame(self, view: FrameView, localization: bool) -> None:
        """Show an image, its pose, and the mode for the next one."""
        with self._lock:
            self._shown_at = time.perf_counter()
            self._n_dropped = view.queue.n_dropped
            if self._system_controls is not None:
                self._system_controls.show_localization(localization)
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
        """Show the changes of the map."""
        with self._lock:
            self._shown_at = time.perf_counter()
            self.page.model.apply(changes)
            if changes.restarted:
                self.page.restart()
            if self.page.is_watched:
                self.page.draw_map()
                self._draw_paths()

    def on_resting_maps(self, maps: RestingMaps) -> None:
        """Show the inactive maps beside the active one."""
        with self._lock:
            self._shown_at = time.perf_counter()
            self._n_resting = len(maps.there)
            self.page.take_resting_maps(maps)
            if self.page.is_watched:
                self.page.draw_map()
                self._show_status()

    def on_event(self, event: LoopClosed | MapsMerged) -> None:
        """Report a loop closure or a merge."""
        if isinstance(event, MapsMerged):
            self.page.tell(
                "Maps merged",
                f"Map {event.merged_map} is part of map {event.map_index} now: keyframe "
                f"{event.current_keyframe} is where keyframe {event.matched_keyframe} was.",
            )
            return
        self.page.tell(
            "Loop closed",
            f"Keyframe {event.current_keyframe} is where keyframe {event.matched_keyframe} "
            f"was: moved by {event.translation:.3g}, turned by {event.rotation_deg:.2g} deg.",
        )

    def close(self, n_dropped: int) -> None:
        """Show the final state; the page stays open."""
        with self._lock:
            self._n_dropped = n_dropped
            if self._run_controls is not None:
                self._run_controls.end()
            self._next.clear()
            self._refresh()

    def tell_end(self, text: str) -> None:
        """Show below the image that the run has ended."""
        with self._lock:
            self._end = text
            self._show_status()

    def look_from(self, eye: FloatArray, target: FloatArray) -> None:
        """Move the view of all browsers to a position, looking at another, and keep it there."""
        self.page.look_from(eye, target)

    def stop(self) -> None:
        """End the page."""
        self._stopping.set()
        self._thread.join()
        self.page.stop()

    def _catch_up(self) -> None:
        """Draw the parts that were postponed, when no messages come any more."""
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
        self._draw_paths()

    def _show_status(self) -> None:
        view, model = self._view, self.page.model
        resting = f"{number_of(self._n_resting, 'other map')} at rest" if self._n_resting else ""
        latency = "" if view is None else view.queue.latency
        note = "\n".join(text for text in (self._error, latency, resting, self._end) if text)
        if view is None:
            self.page.left.show_status(None, note)
            return
        status = status_of(view, len(model.keyframe_ids), model.n_points, self._n_dropped)
        self.page.left.show_status(status, note)

    def _overlaid(self, view: FrameView) -> ByteArray:
        if self._picture is None:
            self._picture = overlaid(view)
        return self._picture

    def _draw_paths(self) -> None:
        subject = self._subject
        if subject is None or not self._is_time("paths", _PATHS):
            return
        told = self._ask("path")
        if not isinstance(told, PathNow):
            return
        positions = told.positions if told.in_world else self._in_world(told.positions)
        gaps = np.concatenate([[True], told.lost[:-1]]) if len(told.lost) else told.lost
        known = ~told.lost
        scene = self.page.scene
        scene.draw_path("path", pieces(positions[known], gaps[known]))
        scene.draw_path("online", self._online.lines())
        if subject.truth is not None:
            laid = lay_truth(
                told.timestamps[known],
                positions[known],
                subject.truth,
                with_scale=subject.with_scale,
            )
            until = subject.truth.timestamps <= told.timestamps[-1:].max(initial=-np.inf)
            scene.draw_path(
                "truth", np.zeros((0, 2, 3)) if laid is None else pieces(laid.positions[until])
            )
            self._error = "" if laid is None else f"{laid.error:.3f} m from the ground truth (ATE)"
            self._show_status()
        self._next["paths"] += _REST * told.seconds

    def _in_world(self, positions: FloatArray) -> FloatArray:
        """Positions relative to the first keyframe of the map, in its world."""
        model = self.page.model
        roots = np.flatnonzero(~np.isin(model.keyframe_ids, model.spanning_tree[:, 0]))
        if not len(roots):
            return positions
        T_w0 = model.keyframe_T_wc[roots[0]]
        return np.asarray(positions @ T_w0[:3, :3].T + T_w0[:3, 3])

    def _neighbours(self, keyframe: int) -> Neighbours:
        found = self._ask("neighbours", keyframe)
        return found if isinstance(found, list) else []

    def _is_time(self, what: str, period: float) -> bool:
        now = time.perf_counter()
        if now < self._next.get(what, 0.0):
            return False
        self._next[what] = now + period
        return True


def _colours_of_points(view: FrameView) -> tuple[np.ndarray, ByteArray]:
    """Return ids of the matched points, and the colours of the image at them."""
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
