# SPDX-License-Identifier: BSD-3-Clause
"""A finished run in the viewer's page, with a slider for the time."""

from __future__ import annotations

import logging
import threading
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._files import describe_error
from orbslam2py.datasets import Sequence
from orbslam2py.errors import DatasetError, OrbSlamError
from orbslam2py.pictures.overlay import Status, fit_size, to_rgb
from orbslam2py.runs.report_page import RunFolder
from orbslam2py.runs.report_page.run_folder import Frames
from orbslam2py.slam.records import TrackingState
from orbslam2py.viewer.history import changes_until
from orbslam2py.viewer.left_panel import thumbnail
from orbslam2py.viewer.page import Page
from orbslam2py.viewer.paths import lay_truth, pieces
from orbslam2py.viewer.plots import SPAN, STAGES
from orbslam2py.viewer.server import LOOPBACK

_log = logging.getLogger(__name__)

_ROOM = (640, 480)
#: Images a second while it plays.
_RATE = 15.0


class Replay:
    """Shows a finished run.

    Parameters
    ----------
    run : RunFolder
        The system to show.
    sequence : Sequence, optional
        Its images and ground truth, which are not in the folder.
    host, port
        See `LiveView`.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.
    DatasetError
        If the run has no images, or the ground truth of its sequence cannot be read.
    MapFileError
        If the file of its map is incomplete.
    """

    def __init__(
        self,
        run: RunFolder,
        sequence: Sequence | None = None,
        *,
        host: str = LOOPBACK,
        port: int | None = None,
    ) -> None:
        if not len(run.frames):
            raise DatasetError(
                f"{run.folder} lists no frames; give the folder of a run that saw images"
            )
        self._run, self._sequence = run, sequence
        self._frames, self._map = run.frames, run.map
        if self._map is None:
            _log.warning(
                "no map.npz in %s: only the path is shown; run the sequence again to see its map",
                run.folder,
            )
        self._figures = _figures_of(run.frames)
        self._kept = np.array(sorted(run.images), np.int64)
        self._condition = threading.Condition()
        self._wanted, self._shown = len(run.frames) - 1, -1
        self._playing = self._stopping = False
        self._thread = threading.Thread(target=self._follow, name="viewer page", daemon=True)
        self.page = Page(
            host=host, port=port, title=f"{run.name} ({run.sensor})", on_client=self._show_now
        )
        try:
            self.page.neighbours = self._neighbours
            self._add_controls()
            self._draw_paths()
            self._thread.start()
        except BaseException:  # a Ctrl-C as well: nobody else could end the page
            self.stop()
            raise

    @property
    def address(self) -> str:
        """Address of the page for a browser."""
        return self.page.address

    @property
    def position(self) -> int:
        """Number of the shown image, from 0."""
        return self._shown

    def stop(self) -> None:
        """End the page."""
        with self._condition:
            self._stopping = True
            self._condition.notify_all()
        if self._thread.ident is not None:  # it was begun
            self._thread.join()
        self.page.stop()

    # ---- the slider ------------------------------------------------------------------------------
    def _add_controls(self) -> None:
        gui = self.page.server.gui
        last = max(1, len(self._frames) - 1)
        with gui.add_folder("Time", order=-1.0):
            self._slider = gui.add_slider("Image", min=0, max=last, step=1, initial_value=last)
            self._play = gui.add_button("Play")
        self._slider.on_update(lambda event: self._move_to(int(self._slider.value)))
        self._play.on_click(lambda _: self._toggle())

    def _move_to(self, position: int) -> None:
        with self._condition:
            self._wanted = position
            self._condition.notify_all()

    def _toggle(self) -> None:
        with self._condition:
            self._playing = not self._playing
            if self._playing and self._wanted >= len(self._frames) - 1:
                self._wanted = 0
            self._condition.notify_all()
        self._play.label = "Pause" if self._playing else "Play"

    def _follow(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(self._has_work, 1 / _RATE if self._playing else None)
                if self._stopping:
                    return
                if self._wanted == self._shown and self._playing:
                    self._wanted = min(self._wanted + 1, len(self._frames) - 1)
                position = self._wanted
                ended = self._playing and position == len(self._frames) - 1
            self._show(position)
            if ended:
                self._toggle()

    def _has_work(self) -> bool:
        return self._stopping or self._wanted != self._shown

    # ---- drawing ---------------------------------------------------------------------------------
    def _show_now(self) -> None:
        with self.page.lock:
            self.page.draw_map(at_most=None)

    def _show(self, position: int) -> None:
        page = self.page
        with page.lock:
            self._shown = position
            now = float(self._frames.timestamps[position])
            if self._map is not None:
                page.model.apply(changes_until(self._map, page.model, now))
            T_wc = self._pose_at(position)
            page.fit_size(np.zeros(0, np.int64), T_wc)
            page.draw_map(at_most=None)
            picture = self._picture(position)
            if picture is not None:
                page.left.show_image(picture)
            small = None if picture is None else thumbnail(picture)
            aspect = 4 / 3 if picture is None else picture.shape[1] / picture.shape[0]
            page.show_camera(T_wc, small, aspect)
            page.left.show_status(self._status(position), self._note(position))
            page.left.plots.draw(self._last_minute(position))
            if self._slider.value != position:
                slider: Any = self._slider
                slider.value = position

    def _draw_paths(self) -> None:
        run, page = self._run, self.page
        with page.lock:
            page.scene.draw_path("path", pieces(run.path.positions))
            page.scene.draw_path("online", pieces(run.online.positions))
            truth = None if self._sequence is None else self._sequence.ground_truth()
            if truth is not None:
                laid = lay_truth(
                    run.path.timestamps,
                    run.path.positions,
                    truth,
                    with_scale=not run.sensor.has_depth,
                )
                if laid is not None:
                    page.scene.draw_path("truth", pieces(laid.positions))

    def _pose_at(self, position: int) -> FloatArray | None:
        times = self._run.path.timestamps
        if not len(times):
            return None
        now = self._frames.timestamps[position]
        row = int(np.abs(times - now).argmin())
        return self._run.path.T_wc[row] if abs(times[row] - now) < 1e-4 else None

    def _picture(self, position: int) -> ByteArray | None:
        if self._sequence is None:
            return self._kept_picture(position)
        try:
            image = self._sequence.load(int(self._frames.index[position])).image
        except (OrbSlamError, OSError, IndexError) as error:
            _log.warning("the images cannot be shown: %s", describe_error(error))
            self._sequence = None
            return self._kept_picture(position)
        return _fitted(to_rgb(image, rgb=self._sequence.settings.camera.rgb))

    def _kept_image(self, position: int) -> int | None:
        """Return the number of the last image until then that is in the folder of the run."""
        row = int(np.searchsorted(self._kept, self._frames.index[position], side="right")) - 1
        return None if row < 0 else int(self._kept[row])

    def _kept_picture(self, position: int) -> ByteArray | None:
        number = self._kept_image(position)
        if number is None:
            return None
        data = np.frombuffer(self._run.images[number], np.uint8)
        decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
        return (
            None if decoded is None else _fitted(to_rgb(np.asarray(decoded, np.uint8), rgb=False))
        )

    def _status(self, position: int) -> Status:
        state = str(self._frames.state[position])
        known = state in TrackingState.__members__
        return Status(
            state=TrackingState[state] if known else TrackingState.NO_IMAGES_YET,
            reason=self._frames.reason[position],
            n_keyframes=len(self.page.model.keyframe_ids),
            n_points=self.page.model.n_points,
            n_matches=int(self._figures[position, 0]),
            skipped=not known,
        )

    def _note(self, position: int) -> str:
        seconds = float(self._frames.seconds[position])
        text = f"image {self._frames.index[position]}, {seconds:.2f} s after the first"
        if self._sequence is None:
            kept = self._kept_image(position)
            text += "" if kept is None else f"; shown is image {kept}, with its map points"
            text += "; to see the images, name the sequence with --sequence"
        return text

    def _last_minute(self, position: int) -> FloatArray:
        seconds = self._frames.timestamps - self._frames.timestamps[position]
        shown = (seconds <= 0) & (seconds > -SPAN)
        return np.column_stack([seconds[shown], self._figures[shown]])

    def _neighbours(self, keyframe: int) -> list[tuple[int, int | None]]:
        if self._map is None:
            return []
        points_of = self._map.covisibility
        pairs = points_of[(points_of == keyframe).any(axis=1)]
        return [(int(other), None) for other in pairs[pairs != keyframe]]


def _fitted(picture: ByteArray) -> ByteArray:
    """As large as the page has room for."""
    size = fit_size((picture.shape[1], picture.shape[0]), _ROOM)
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


def _figures_of(frames: Frames) -> FloatArray:
    """Return inliers, milliseconds in total and by stage (n, 2 + stages); 0 if unknown."""
    none = np.full(len(frames), np.nan)
    stages = [frames.milliseconds.get(stage, none) for stage in ("track", *STAGES)]
    return np.asarray(np.nan_to_num(np.column_stack([frames.inliers, *stages])))
