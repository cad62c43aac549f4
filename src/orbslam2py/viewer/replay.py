# SPDX-License-Identifier: BSD-3-Clause
"""A run long past in the viewer's page, with a slider for the time."""

from __future__ import annotations

import csv
import json
import logging
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from orbslam2py._arrays import ByteArray, FloatArray, IntArray
from orbslam2py._files import describe_error
from orbslam2py.datasets import Sequence
from orbslam2py.errors import DatasetError, OrbSlamError, SettingsError
from orbslam2py.maps.changes import KeyframesSet, MapChanges, PointsSet
from orbslam2py.maps.map_arrays import MapArrays
from orbslam2py.pictures.overlay import Status, fit_size, to_rgb
from orbslam2py.settings.sensor import Sensor
from orbslam2py.slam.records import TrackingState
from orbslam2py.trajectory import Trajectory, read_tum
from orbslam2py.viewer.left_panel import thumbnail
from orbslam2py.viewer.page import Page
from orbslam2py.viewer.paths import lay_truth, pieces
from orbslam2py.viewer.plots import SPAN, STAGES
from orbslam2py.viewer.server import LOOPBACK

_log = logging.getLogger(__name__)

_ROOM = (640, 480)
#: Images a second while it plays.
_RATE = 15.0


@dataclass(frozen=True, eq=False)
class RunFolder:
    """What is shown of a run, read from its folder."""

    name: str
    sensor: Sensor
    indices: IntArray
    """(n,) number of every image in its sequence."""
    timestamps: FloatArray
    """(n,) seconds."""
    states: list[str]
    reasons: list[str]
    figures: FloatArray
    """(n, 2 + stages) inliers, milliseconds in all and by stage; 0 where there are none."""
    path: Trajectory
    """After the last optimisation; the world is the first keyframe."""
    online: Trajectory
    """As first tracked."""
    map: MapArrays | None

    @classmethod
    def read(cls, folder: Path) -> RunFolder:
        """Read the files of a run.

        Raises
        ------
        DatasetError
            If it is no folder of a run, or a file in it is not whole.
        OSError
            If a file cannot be read.
        """
        if not (folder / "report.json").is_file() or not (folder / "frames.csv").is_file():
            raise DatasetError(
                f"{folder} is no folder of a run: it has no report.json and frames.csv; "
                "give one that orbslam2py run has written"
            )
        try:
            report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
            name, sensor = f"{report['sequence']} ({report['sensor']})", Sensor(report["sensor"])
        except (ValueError, KeyError, TypeError, SettingsError) as error:
            raise DatasetError(f"{folder / 'report.json'} is no report of a run") from error
        rows = _read_frames(folder / "frames.csv")
        if not (folder / "map.npz").is_file():
            _log.warning(
                "no map.npz in %s: only the path is shown; run the sequence again to see its map",
                folder,
            )
        return cls(
            name=name,
            sensor=sensor,
            indices=np.array([int(row["index"]) for row in rows], np.int64),
            timestamps=np.array([float(row["timestamp"]) for row in rows]),
            states=[row["state"] for row in rows],
            reasons=[row["reason"] for row in rows],
            figures=np.array([[_figure(row, key) for key in _FIGURES] for row in rows]),
            path=_read_path(folder / "trajectory.txt"),
            online=_read_path(folder / "trajectory_online.txt"),
            map=MapArrays.load(folder / "map.npz") if (folder / "map.npz").is_file() else None,
        )


_FIGURES = ("inliers", "ms_track", *(f"ms_{stage}" for stage in STAGES))


class Replay:
    """Shows a run that is over.

    Parameters
    ----------
    run : RunFolder
        What to show.
    sequence : Sequence, optional
        Its images and ground truth, which the folder does not hold.
    host, port
        See `LiveView`.

    Raises
    ------
    StateError
        If viser is not installed, or the page cannot be served there.
    """

    def __init__(
        self,
        run: RunFolder,
        sequence: Sequence | None = None,
        *,
        host: str = LOOPBACK,
        port: int | None = None,
    ) -> None:
        self._run, self._sequence = run, sequence
        self._condition = threading.Condition()
        self._wanted, self._shown = len(run.indices) - 1, -1
        self._playing = self._stopping = False
        self.page = Page(host=host, port=port, title=run.name, on_client=self._show_now)
        self.page.neighbours = self._neighbours
        self._add_controls()
        self._draw_paths()
        self._thread = threading.Thread(target=self._follow, name="viewer page", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """What a person types into a browser."""
        return self.page.address

    @property
    def position(self) -> int:
        """The image that is shown, from 0."""
        return self._shown

    def stop(self) -> None:
        """End the page."""
        with self._condition:
            self._stopping = True
            self._condition.notify_all()
        self._thread.join()
        self.page.stop()

    # ---- the slider ------------------------------------------------------------------------------
    def _add_controls(self) -> None:
        gui = self.page.server.gui
        last = max(1, len(self._run.indices) - 1)
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
            if self._playing and self._wanted >= len(self._run.indices) - 1:
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
                    self._wanted = min(self._wanted + 1, len(self._run.indices) - 1)
                position = self._wanted
                ended = self._playing and position == len(self._run.indices) - 1
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
        run, page = self._run, self.page
        with page.lock:
            self._shown = position
            now = float(run.timestamps[position])
            if run.map is not None:
                page.model.apply(_changes_until(run.map, page, now))
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
                laid = lay_truth(run.path, truth, with_scale=not run.sensor.has_depth)
                if laid is not None:
                    page.scene.draw_path("truth", pieces(laid.positions))

    def _pose_at(self, position: int) -> FloatArray | None:
        times = self._run.path.timestamps
        if not len(times):
            return None
        now = self._run.timestamps[position]
        row = int(np.abs(times - now).argmin())
        return self._run.path.T_wc[row] if abs(times[row] - now) < 1e-4 else None

    def _picture(self, position: int) -> ByteArray | None:
        if self._sequence is None:
            return None
        try:
            image = self._sequence.load(int(self._run.indices[position])).image
        except (OrbSlamError, OSError, IndexError) as error:
            _log.warning("the images cannot be shown: %s", describe_error(error))
            self._sequence = None
            return None
        picture = to_rgb(image, rgb=self._sequence.settings.camera.rgb)
        size = fit_size((picture.shape[1], picture.shape[0]), _ROOM)
        return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)

    def _status(self, position: int) -> Status:
        state = self._run.states[position]
        known = state in TrackingState.__members__
        return Status(
            state=TrackingState[state] if known else TrackingState.NO_IMAGES_YET,
            reason=self._run.reasons[position],
            n_keyframes=len(self.page.model.keyframe_ids),
            n_points=self.page.model.n_points,
            n_matches=int(self._run.figures[position, 0]),
            skipped=not known,
        )

    def _note(self, position: int) -> str:
        seconds = float(self._run.timestamps[position] - self._run.timestamps[0])
        text = f"image {self._run.indices[position]}, {seconds:.2f} s after the first"
        if self._sequence is None:
            text += "; to see the images, name the sequence with --sequence"
        return text

    def _last_minute(self, position: int) -> FloatArray:
        seconds = self._run.timestamps - self._run.timestamps[position]
        shown = (seconds <= 0) & (seconds > -SPAN)
        return np.column_stack([seconds[shown], self._run.figures[shown]])

    def _neighbours(self, keyframe: int) -> list[tuple[int, int | None]]:
        if self._run.map is None:
            return []
        points_of = self._run.map.covisibility
        pairs = points_of[(points_of == keyframe).any(axis=1)]
        return [(int(other), None) for other in pairs[pairs != keyframe]]


def _changes_until(arrays: MapArrays, page: Page, now: float) -> MapChanges:
    """What turns the map that a page shows into the last one as far as it was seen until a time."""
    model = page.model
    there = arrays.keyframe_timestamps <= now + 1e-6
    ids = arrays.keyframe_ids[there]
    new = np.flatnonzero(there & ~np.isin(arrays.keyframe_ids, model.keyframe_ids))
    shown_points = np.concatenate(
        [np.zeros(0, np.int64), *(part.ids for part in model.points.values())]
    )
    seen = np.isin(arrays.point_first_keyframes, ids)
    new_points = np.flatnonzero(seen & ~np.isin(arrays.point_ids, shown_points))
    tree = arrays.spanning_tree
    parents = dict(tree.tolist())
    return MapChanges(
        map_index=0,
        restarted=False,
        keyframes_set=KeyframesSet(
            arrays.keyframe_ids[new],
            arrays.keyframe_T_wc[new],
            arrays.keyframe_timestamps[new],
            np.array([parents.get(i, -1) for i in arrays.keyframe_ids[new].tolist()], np.int64),
        ),
        keyframes_removed=np.setdiff1d(model.keyframe_ids, ids),
        points_set=PointsSet(
            arrays.point_ids[new_points],
            arrays.point_positions[new_points],
            arrays.point_observations[new_points],
        ),
        points_removed=np.setdiff1d(shown_points, arrays.point_ids[seen]),
        covisibility=_between(arrays.covisibility, ids),
        loop_edges=_between(arrays.loop_edges, ids),
        spanning_tree=_between(tree, ids),
    )


def _between(pairs: IntArray, ids: IntArray) -> IntArray:
    found: IntArray = pairs[np.isin(pairs, ids).all(axis=1)]
    return found


def _read_frames(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    if not rows or not {"index", "timestamp", "state", "reason"} <= set(rows[0]):
        raise DatasetError(f"{path} lists no frames; give the folder of a run that saw images")
    return rows


def _figure(row: dict[str, str], key: str) -> float:
    text = row.get(key)
    return float(text) if text else 0.0


def _read_path(path: Path) -> Trajectory:
    if not path.is_file():
        return Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    return read_tum(path)
