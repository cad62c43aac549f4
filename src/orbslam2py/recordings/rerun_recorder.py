# SPDX-License-Identifier: BSD-3-Clause
"""A recording of a run for Rerun's viewer: images, map, plots, events."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from orbslam2py._arrays import ByteArray, FloatArray
from orbslam2py._palette import (
    COVISIBILITY,
    KEYFRAME,
    LOOP,
    MAPPED,
    PATH,
    POINTS,
    STARTING,
    TRUTH,
    UNMATCHED,
    VISUAL_ODOMETRY,
    Colour,
)
from orbslam2py.errors import OrbSlamError
from orbslam2py.maps import MapChanges
from orbslam2py.recordings.growing_map import GrowingMap
from orbslam2py.recordings.output_file import OutputFile
from orbslam2py.settings import CameraModel, Settings
from orbslam2py.slam.events import (
    Event,
    KeyframeAdded,
    LoopClosed,
    MapChanged,
    MapsMerged,
    Relocalized,
    TrackingLost,
)
from orbslam2py.slam.records import TrackingRecord
from orbslam2py.trajectory import Trajectory
from orbslam2py.viewer.paths import lay_truth
from orbslam2py.viewer.watching import FrameView

#: Points and keyframes with neighbouring ids are one entity, which is written when one changes.
_POINT_PAGE, _KEYFRAME_PAGE = 4096, 64
#: Seconds of the recording between two states of the map, and between two states of the whole path.
_MAP_EVERY, _PATHS_EVERY = 0.25, 1.0
_JPEG_QUALITY = 85
#: Points of a border of the view of a fisheye lens, and the length of its rays in units of the map.
_BORDER_POINTS, _LENS_LENGTH = 24, 0.3
#: Number of images after which the free space is checked again.
_LOOK = 8
#: Half width, half height and depth of a camera's shape, relative to its size.
_CORNERS = np.array([(-1, -0.75, 1.2), (1, -0.75, 1.2), (1, 0.75, 1.2), (-1, 0.75, 1.2)])


class RerunRecorder:
    """Writes all data of a run into a file for `Rerun <https://rerun.io>`_'s viewer.

    Nothing is sent: the recording is written only to the file. Needs ``pip install
    "orbslam2py[rerun]"``.

    Parameters
    ----------
    path : str or Path
        Ends with ``.rrd``. The file appears when it is complete; it replaces an existing one.
    settings : Settings, optional
        For the shape of the camera.
    ground_truth : Trajectory, optional
        Ground truth, aligned with the estimate as it grows.
    with_scale : bool
        Whether the map has its own unit (a single camera): then the ground truth is scaled to it.

    Raises
    ------
    OrbSlamError
        If Rerun is not installed.
    OutputFileError
        If the file certainly cannot be written.
    """

    name = "the recording"

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        settings: Settings | None = None,
        ground_truth: Trajectory | None = None,
        with_scale: bool = False,
    ) -> None:
        self._rr = _import_rerun()
        self._file = OutputFile(path, "recording", [".rrd"])
        self._truth, self._with_scale = ground_truth, with_scale
        self._map = GrowingMap()
        self._stream = self._open(settings)
        self._begin: float | None = None
        self._now = 0.0
        self._n_images = self._n_records = 0
        self._closed = False
        self._map_due = self._paths_due = 0.0
        self._stale_points: set[int] = set()
        self._stale_keyframes: set[int] = set()
        self._last: tuple[str, str] = ("", "")

    @property
    def path(self) -> Path:
        """Path of the file."""
        return self._file.path

    # ---- notifications ---------------------------------------------------------------------------
    def on_map(self, changes: MapChanges) -> None:
        """Store the changes; they are written several times a second."""
        if changes.restarted:
            if self._n_records:
                self._log("world/map", self._rr.Clear(recursive=True))
            self._stale_points, self._stale_keyframes = set(), set()
        self._map.apply(changes)
        points = np.concatenate([changes.points_set.ids, changes.points_removed])
        keyframes = np.concatenate([changes.keyframes_set.ids, changes.keyframes_removed])
        self._stale_points.update(np.unique(points // _POINT_PAGE).tolist())
        self._stale_keyframes.update(np.unique(keyframes // _KEYFRAME_PAGE).tolist())

    def on_event(self, event: Event) -> None:
        """Record an event."""
        text, level = _in_words(event)
        self._say(text, level)

    def on_frame(self, view: FrameView) -> None:
        """Write an image and its keypoints."""
        for record in view.earlier:
            self._take(record)
        self._take(view.record)
        if self._n_images % _LOOK == 0:
            self._file.require_room()
        self._n_images += 1
        self._write_image(view)
        if self._now >= self._map_due:
            self._map_due = self._now + _MAP_EVERY
            self._write_map()
        if self._now >= self._paths_due:
            self._paths_due = self._now + _PATHS_EVERY
            self._write_paths()

    def close(self) -> None:
        """Finish the file and give it its name."""
        if self._closed:
            return
        self._closed = True
        try:
            if self._n_images:
                self._write_map()
                self._write_paths()
            self._stream.flush()
            self._stream.disconnect()  # closes the file
            if self._n_images:
                self._file.publish()
        finally:
            self._file.discard()

    # ---- to the file -----------------------------------------------------------------------------
    def _open(self, settings: Settings | None) -> Any:
        rr = self._rr
        # Without properties: these would hold the moment, and make two recordings differ.
        stream = rr.RecordingStream("orbslam2py", send_properties=False)
        stream.save(self._file.temporary, default_blueprint=_layout())
        stream.log("world", rr.ViewCoordinates.RDF, static=True)
        if settings is not None:
            camera = settings.camera
            known = camera.width is not None and camera.height is not None
            if camera.is_fisheye and camera.width is not None and camera.height is not None:
                # Rerun has pinholes only: the lines show what the fisheye sees.
                model = camera.camera_model(camera.width, camera.height)
                lines = rr.LineStrips3D(border_lines(model, _LENS_LENGTH), colors=UNMATCHED)
                stream.log("world/camera/view", lines, static=True)
            stream.log(
                "world/camera/image",
                rr.Pinhole(
                    image_from_camera=camera.matrix,
                    resolution=(camera.width, camera.height) if known else None,
                    camera_xyz=rr.ViewCoordinates.RDF,
                ),
                static=True,
            )
        return stream

    def _log(self, entity: str, what: object) -> None:
        self._stream.log(entity, what)

    def _take(self, record: TrackingRecord) -> None:
        """Set the time to that of an image, and write its figures and its pose."""
        rr = self._rr
        if self._begin is None:
            self._begin = record.timestamp
        self._now = record.timestamp - self._begin
        self._stream.set_time("time", duration=self._now)
        self._stream.set_time("frame", sequence=self._n_records)
        self._n_records += 1
        self._map.add_frame(record)
        self._log("plots/inliers", rr.Scalars(record.n_inliers))
        self._log("plots/matches", rr.Scalars(record.n_matches))
        for stage, took in record.milliseconds.items():
            self._log(f"plots/milliseconds/{stage}", rr.Scalars(took))
        if (record.state.name, str(record.reason)) != self._last:
            self._last = (record.state.name, str(record.reason))
            self._say(": ".join(part for part in self._last if part), "INFO")
        if record.T_wc is not None:
            T_wc = record.T_wc
            pose = rr.Transform3D(translation=T_wc[:3, 3], mat3x3=T_wc[:3, :3])
            self._log("world/camera", pose)

    def _say(self, text: str, level: str) -> None:
        self._log("events", self._rr.TextLog(text, level=level))

    def _write_image(self, view: FrameView) -> None:
        rr, pixels = self._rr, view.pixels
        jpeg = rr.EncodedImage(contents=_as_jpeg(view.image), media_type="image/jpeg")
        self._log("world/camera/image", jpeg)
        kinds = {
            "mapped": (view.matched, MAPPED, 3.0),
            "visual_odometry": (view.visual_odometry, VISUAL_ODOMETRY, 3.0),
            "unmatched": (~view.matched & ~view.visual_odometry, UNMATCHED, 1.0),
        }
        for name, (which, colour, radius) in kinds.items():
            marks = rr.Points2D(pixels[which], colors=colour, radii=radius)
            self._log(f"world/camera/image/keypoints/{name}", marks)
        lines = np.zeros((0, 4)) if view.start_lines is None else view.start_lines
        self._log(
            "world/camera/image/start",
            rr.LineStrips2D(lines.reshape(-1, 2, 2), colors=STARTING),
        )
        shown = self._map.picture(view.local_points, renew=False).local_points
        self._log("world/map/local_points", rr.Points3D(shown, colors=MAPPED, radii=_px(2.5)))

    def _write_map(self) -> None:
        rr = self._rr
        for page in sorted(self._stale_points):
            points = self._map.points_between(page * _POINT_PAGE, (page + 1) * _POINT_PAGE)
            drawn = rr.Points3D(points, colors=POINTS, radii=_px(1.5))
            self._log(f"world/map/points/{page}", drawn)
        size = self._camera_size()
        for page in sorted(self._stale_keyframes):
            T_wc = self._map.keyframes_between(page * _KEYFRAME_PAGE, (page + 1) * _KEYFRAME_PAGE)
            self._lines(f"world/map/keyframes/{page}", _camera_shapes(T_wc, size), KEYFRAME, 1.0)
        self._stale_points, self._stale_keyframes = set(), set()

    def _write_paths(self) -> None:
        scene = self._map.picture()
        pieces = np.split(scene.path, np.flatnonzero(scene.path_gaps)) if len(scene.path) else []
        self._lines("world/map/path", [piece for piece in pieces if len(piece)], PATH, 1.5)
        self._lines("world/map/covisibility", list(scene.covisibility), COVISIBILITY, 0.5)
        self._lines("world/map/loop_edges", list(scene.loop_edges), LOOP, 2.0)
        if self._truth is not None:
            laid = lay_truth(*self._map.path(), self._truth, with_scale=self._with_scale)
            if laid is not None:
                self._lines("world/map/ground_truth", [laid.positions], TRUTH, 1.5)

    def _lines(self, entity: str, strips: list[FloatArray], colour: Colour, width: float) -> None:
        lines = self._rr.LineStrips3D(strips, colors=colour, radii=_px(width))
        self._log(entity, lines)

    def _camera_size(self) -> float:
        """Return half the width of a keyframe's shape, relative to the trajectory."""
        T_wc = self._map.picture(renew=False).keyframes[:, :3, 3]
        steps = np.linalg.norm(np.diff(T_wc, axis=0), axis=1)
        return float(0.3 * np.median(steps)) if len(steps) else 0.05


def _import_rerun() -> Any:
    try:
        import rerun as module  # noqa: PLC0415
    except ImportError as error:
        raise OrbSlamError('recording needs rerun: pip install "orbslam2py[rerun]"') from error
    return module


def _layout() -> object:
    """Image, plots and events on the left, the map on the right."""
    import rerun.blueprint as layout  # noqa: PLC0415

    left = layout.Vertical(
        layout.Spatial2DView(origin="world/camera/image", name="image"),
        layout.TimeSeriesView(
            contents=["plots/inliers", "plots/matches"], origin="plots", name="matches"
        ),
        layout.TimeSeriesView(origin="plots/milliseconds", name="milliseconds"),
        layout.TextLogView(origin="events", name="events"),
        row_shares=[4, 2, 2, 2],
    )
    right = layout.Spatial3DView(origin="world", name="map")
    return layout.Blueprint(layout.Horizontal(left, right), collapse_panels=True)


def _px(width: float) -> float:
    """Return a radius in pixels of the screen, which Rerun marks by a negative sign."""
    return -width


def border_lines(camera: CameraModel, length: float) -> list[FloatArray]:
    """Lines (n, 3) that bound the view of a camera, in its frame.

    The first goes along the rays at the border of the image, the others from the camera to its
    corners. Where the lens shows nothing, there is no point.
    """
    width, height = camera.image_size
    u, v = np.linspace(0, width - 1, _BORDER_POINTS), np.linspace(0, height - 1, _BORDER_POINTS)
    border = np.concatenate(
        [
            np.column_stack([u, np.zeros_like(u)]),
            np.column_stack([np.full_like(v, width - 1), v]),
            np.column_stack([u[::-1], np.full_like(u, height - 1)]),
            np.column_stack([np.zeros_like(v), v[::-1]]),
        ]
    )
    rays = length * camera.unproject(border)
    corners = rays[::_BORDER_POINTS]
    known = [np.stack([np.zeros(3), one]) for one in corners if np.isfinite(one).all()]
    return [rays[np.isfinite(rays).all(axis=1)], *known]


def _as_jpeg(image: ByteArray) -> bytes:
    given = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    quality = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    return bytes(cv2.imencode(".jpg", given, quality)[1])


def _camera_shapes(T_wc: npt.NDArray[np.floating], size: float) -> list[FloatArray]:
    """Return one line per camera (9, 3), world, around its view."""
    apex = np.zeros(3)
    a, b, c, d = size * _CORNERS
    corners = np.array([apex, a, b, apex, c, d, apex, b, c, d, a])
    turned = np.einsum("kij,nj->kni", T_wc[:, :3, :3], corners)
    return list(turned + T_wc[:, None, :3, 3])


def _in_words(event: Event) -> tuple[str, str]:
    """Return the text of an event, and its level."""
    level = "WARN"
    if isinstance(event, LoopClosed):
        moved = f"{event.translation:.3g} and {event.rotation_deg:.2g} degrees"
        text = f"loop closed, {_evidence_of(event)}, moved by {moved}"
    elif isinstance(event, MapsMerged):
        maps = f"map {event.merged_map} is part of map {event.map_index} now"
        moved = f"{event.n_moved_keyframes} keyframes and {event.n_moved_points} points moved"
        text = f"{maps}, {_evidence_of(event)}: {moved}, scale {event.scale:.3g}"
    elif isinstance(event, TrackingLost):
        text, level = f"lost: {event.reason}", "ERROR"
    elif isinstance(event, Relocalized):
        text = "found again"
    elif isinstance(event, MapChanged):
        text = f"the map is another one: {event.cause}"
    elif isinstance(event, KeyframeAdded):
        size = f"{event.n_keyframes} keyframes, {event.n_map_points} points"
        text, level = f"keyframe {event.keyframe} mapped: {size}", "DEBUG"
    else:
        text, level = f"map {event.map_index} has begun", "INFO"
    return text, level


def _evidence_of(event: LoopClosed | MapsMerged) -> str:
    pair = f"keyframe {event.current_keyframe} to {event.matched_keyframe}"
    return f"{pair}, {event.n_inliers} inliers"
