# SPDX-License-Identifier: BSD-3-Clause
"""Saving the map of a running system, once or at intervals."""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import math
import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from orbslam2py import _core as core
from orbslam2py._arguments import path_of
from orbslam2py._arrays import IntArray
from orbslam2py._version import __version__
from orbslam2py.errors import MapFileError, StateError
from orbslam2py.maps.contents import MapContents
from orbslam2py.maps.map_copies import ChangedContents, take_changes, take_contents
from orbslam2py.maps.map_file import MapFile, save_map
from orbslam2py.maps.map_rows import Row, keypoint_rows, map_rows, run_rows, settings_rows
from orbslam2py.maps.map_writer import MapWriter
from orbslam2py.maps.saved_map import RecordedFrames, Run, SavedMap, VocabularyIdentity
from orbslam2py.maps.schema import IDS_PER_PAGE, PATCHES_PER_PAGE
from orbslam2py.settings.settings import Settings

_log = logging.getLogger(__name__)

#: Seconds that saving keeps the interpreter's lock, and that it leaves to others after them.
_LONGEST_STRETCH, _BREAK = 0.0005, 0.0005

#: Number of kept images from which it is checked whether their keyframes still exist.
_FEW_IMAGES = 100

#: Returns the frames of a map that refer to known keyframes: ``recorded(map_index, keyframe_ids)``.
Recorded = Callable[[int, IntArray], RecordedFrames]


class MapAutosave:
    """Writes the map of a system, with all that is needed to use it.

    May be called from any thread, also during tracking.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    recorded : callable
        Gives the frames for a file.
    settings : Settings
        Of the camera.
    vocabulary : callable
        Gives the vocabulary, which only saving needs.
    seed : int
        Of the present run.
    options : mapping
        Options of the system, by name.
    earlier : SavedMap or MapFile, optional
        The file that the map was loaded from.
    inertial : orbslam2py._core.InertialKeyframes, optional
        States of the IMU at the keyframes.
    patches : bool
        Keep the patches of points, and the sightings that were aligned to them.
    """

    def __init__(
        self,
        slam_map: core.Map,
        recorded: Recorded,
        settings: Settings,
        vocabulary: Callable[[], VocabularyIdentity],
        *,
        seed: int,
        options: Mapping[str, Any],
        earlier: SavedMap | MapFile | None,
        inertial: core.InertialKeyframes | None = None,
        patches: bool = True,
    ) -> None:
        self._map = slam_map
        self._inertial = inertial
        self._patches = patches
        self._recorded = recorded
        self._settings = settings
        self._vocabulary = vocabulary
        self._earlier_runs = earlier.runs if earlier is not None else ()
        self._first_map = slam_map.epoch
        #: JPEG images by the keyframes of the map that had this number.
        self._images: dict[int, bytes] = dict(earlier.images) if earlier is not None else {}
        self._images_of = self._first_map
        self._images_lock = threading.Lock()
        self._next_look = _FEW_IMAGES
        started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        self._run = Run(f"orbslam2py {__version__}", started, seed, options)
        self._autosave: _Autosave | None = None

    def keep_image(self, keyframe: int, jpeg: bytes) -> None:
        """Keep the image of a keyframe of the present map."""
        with self._images_lock:
            if self._map.epoch != self._images_of:
                self._images, self._images_of = {}, self._map.epoch
            self._images[keyframe] = jpeg
            if len(self._images) > self._next_look:
                self._drop_images(set())

    def _images_in(self, contents: MapContents) -> dict[int, bytes]:
        """Return the images of the keyframes of a map, by id; drop those of culled ones."""
        with self._images_lock:
            if contents.map_index != self._images_of or not self._images:
                return {}
            ids = contents.keyframes.ids.tolist()
            self._drop_images(set(ids))
            return {number: self._images[number] for number in ids if number in self._images}

    def _drop_images(self, but: set[int]) -> None:
        """Drop the images of culled keyframes, except some; the caller holds the lock."""
        # Those of keyframes that wait for mapping stay, which contents do not have yet.
        wanted = but | set(self._map.keyframe_ids().tolist())
        self._images = {k: jpeg for k, jpeg in self._images.items() if k in wanted}
        self._next_look = max(_FEW_IMAGES, 2 * len(self._images))

    # ---- whole files -----------------------------------------------------------------------------
    def contents(self) -> MapContents:
        """Return the map as arrays, at this moment."""
        return take_contents(self._map, self._inertial, patches=self._patches)

    def saved_map(self) -> SavedMap:
        """Return all that a map file contains, at this moment."""
        contents = self.contents()
        runs = (*self._runs_before(contents), self._present_run(contents))
        images = self._images_in(contents)
        return SavedMap(contents, self._settings, self._vocabulary(), runs, images)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a map file; see `orbslam2py.System.save_map`."""
        path = path_of(path, "the map file", MapFileError)
        autosave = self._autosave
        if autosave is not None and autosave.writes(path):
            autosave.save_now()
        else:
            save_map(self.saved_map(), path)

    def _runs_before(self, contents: MapContents) -> tuple[Run, ...]:
        # After a reset the map is a new one, without the earlier runs.
        return self._earlier_runs if contents.map_index == self._first_map else ()

    def _present_run(self, contents: MapContents) -> Run:
        known = np.concatenate([contents.keyframes.ids, contents.removed_keyframes.ids])
        frames = self._recorded(contents.map_index, known)
        return dataclasses.replace(self._run, frames=frames)

    # ---- all the time ----------------------------------------------------------------------------
    def autosave(self, path: str | os.PathLike[str], every: float) -> None:
        """Begin to save regularly; see `orbslam2py.System.autosave`."""
        if not (math.isfinite(every) and every > 0):
            raise StateError(f"autosave needs a positive number of seconds, got {every}")
        self.stop_autosave()
        self._autosave = _Autosave(self, path, every)

    @property
    def is_saving_here(self) -> bool:
        """Return whether the caller is the thread of the autosave."""
        return self._autosave is not None and self._autosave.is_here

    def stop_autosave(self) -> None:
        """Save a last time and stop; raises `MapFileError` if that fails.

        After a Ctrl-C, a further call saves again.
        """
        if self._autosave is None:
            return
        try:
            self._autosave.finish()
        except MapFileError:
            self._autosave = None
            raise
        self._autosave = None

    def changes(self, writer: MapWriter, before: ChangedContents | None) -> ChangedContents:
        """Copy the parts of the present map that a file lacks; the file may hold another map.

        Parameters
        ----------
        writer : MapWriter
            Of the file.
        before : ChangedContents, optional
            The state of the file: only later changes are examined. None: everything.
        """
        known = np.array(sorted(key[0] for key in writer.keys("keypoints")), np.int64)
        return take_changes(self._map, known, before, self._inertial, patches=self._patches)

    def update(
        self, writer: MapWriter, changes: ChangedContents, *, partly: bool, gently: bool = False
    ) -> bool:
        """Update a file; return False if there is no map to save yet.

        Parameters
        ----------
        writer : MapWriter
            Of the file.
        changes : ChangedContents
            The parts that the file lacks, from `changes`.
        partly : bool
            Whether only the changes were examined.
        gently : bool
            Release the lock for other threads regularly.
        """
        contents = changes.contents
        if gently:
            time.sleep(_BREAK)
        if not len(contents.keyframes):
            return False
        looked_at = _keys(changes.pages)
        same = _keys(contents.keyframes.ids[~changes.changed_keyframes])
        kept = {
            "keyframes": same,
            "covisibility": same,
            "imu_states": _keys(contents.imu_states.ids[~changes.changed_states]),
            "map_points": writer.keys("map_points") - looked_at,
            "observations": writer.keys("observations") - looked_at,
            "patches": {
                page
                for page in writer.keys("patches")
                if (page[0] * PATCHES_PER_PAGE // IDS_PER_PAGE,) not in looked_at
            },
            "aligned": same,
        }
        rows = self._rows(changes, writer, partly=partly)
        n = writer.commit(_leaving_time(rows) if gently else rows, kept)
        _log.debug("%d rows written to %s", n, writer.path)
        return True

    def _rows(
        self, changes: ChangedContents, writer: MapWriter, *, partly: bool
    ) -> Iterator[tuple[str, Row]]:
        contents = changes.contents
        yield from settings_rows(self._settings, self._identity, contents)
        runs = (*self._runs_before(contents), self._present_run(contents))
        for number, run in enumerate(runs):
            # Parts that are full change at the end alone; the last one is examined again.
            parts = sum(key[0] == number for key in writer.keys("frames"))
            yield from run_rows(number, run, first_part=max(0, parts - 1) if partly else 0)
        yield from map_rows(contents, changes.changed_keyframes, changes.changed_states)
        keys = zip(contents.keyframes.ids.tolist(), strict=True)
        written = writer.keys("keypoints")
        yield from keypoint_rows(contents, [i for i, key in enumerate(keys) if key not in written])
        for keyframe, jpeg in self._images_in(contents).items():
            if not writer.has("images", keyframe):
                yield "images", (keyframe, jpeg)

    @cached_property
    def _identity(self) -> VocabularyIdentity:
        return self._vocabulary()


def _keys(numbers: IntArray) -> set[Row]:
    """Keys of rows by their single number."""
    return set(zip(numbers.tolist(), strict=True))


class _Autosave:
    """Saves at a fixed interval in a separate thread; repeats failed saves, with a log entry.

    A new map after a reset gets a separate file; the file of the old one does not change.
    """

    def __init__(self, keeper: MapAutosave, path: str | os.PathLike[str], every: float) -> None:
        self.path = Path(path)
        self._keeper = keeper
        self._every = every
        self._stop = threading.Event()
        self._lock = threading.Lock()
        self._first_map = keeper._map.epoch
        self._map_index = self._first_map
        self._writer = MapWriter(self.path)
        self._held: ChangedContents | None = None
        self._thread = threading.Thread(target=self._work, name="autosave", daemon=True)
        self._thread.start()

    def writes(self, path: Path) -> bool:
        """Return whether a file is the requested one, or that of the present map."""
        return os.path.realpath(path) in (os.path.realpath(self.path), str(self._writer.path))

    @property
    def is_here(self) -> bool:
        """Return whether the caller is the thread that saves."""
        return threading.current_thread() is self._thread

    def save_now(self, *, everything: bool = True) -> None:
        """Commit the present state; `everything`: also the tracker's counters of points."""
        with self._lock:
            before = None if everything else self._held
            changes = self._keeper.changes(self._writer, before)
            while changes.contents.map_index != self._map_index:
                self._follow_reset(changes.contents.map_index)
                before = None
                changes = self._keeper.changes(self._writer, before)
            is_there = self._keeper.update(
                self._writer, changes, partly=before is not None, gently=not everything
            )
            self._held = changes if is_there else None

    def finish(self) -> None:
        """Commit a last time and end the thread; may be called again after a Ctrl-C."""
        self._stop.set()
        self._thread.join()
        try:
            self.save_now()
        except MapFileError:
            with contextlib.suppress(MapFileError):  # the first one says why
                self._close()
            raise
        self._close()

    def _close(self) -> None:
        with self._lock:
            self._writer.close()

    def _work(self) -> None:
        while not self._stop.wait(self._every):
            try:
                self.save_now(everything=False)
            except Exception as error:
                # For any error: without this thread nothing would be saved any more, unnoticed.
                told = str(error) if isinstance(error, MapFileError) else repr(error)
                _log.warning("autosave failed and will be tried again: %s", told)
                _log.debug("in full:", exc_info=error)

    def _follow_reset(self, map_index: int) -> None:
        """Give another map a separate file, if the present one is not empty."""
        old = self._writer
        if old.begun:
            path = self.path.with_stem(f"{self.path.stem}-{map_index - self._first_map}")
            self._writer = MapWriter(path)
            _log.warning(
                "the map was given up; the new one is saved as %s, the old one stays", path
            )
        # Only now: as long as the number is the old map's, nothing of the new one is written.
        self._held, self._map_index = None, map_index
        if old is not self._writer:
            try:
                old.close()
            except MapFileError as error:
                # Earlier commits stay; the new map must not wait for that.
                _log.warning("the old map: %s", error)


def _leaving_time(rows: Iterable[tuple[str, Row]]) -> Iterator[tuple[str, Row]]:
    """Release the interpreter's lock several times in a millisecond.

    Otherwise a waiting thread gets the lock only after five milliseconds, which would delay a
    frame.
    """
    since = time.perf_counter()
    for row in rows:
        yield row
        if time.perf_counter() - since > _LONGEST_STRETCH:
            time.sleep(_BREAK)
            since = time.perf_counter()


def encode_image(image: npt.NDArray[np.uint8], width: int = 320, quality: int = 75) -> bytes:
    """Make a small grey JPEG of an image.

    Parameters
    ----------
    image : array of uint8, (h, w) or (h, w, c)
        Grey or colour.
    width : int
        Largest width and height of the JPEG, in pixels.
    quality : int
        JPEG quality, 0 to 100.
    """
    import cv2  # noqa: PLC0415 - only those who keep images need it

    grey = image if image.ndim == 2 else image[..., : min(3, image.shape[2])].mean(2)
    grey = np.ascontiguousarray(grey, np.uint8)
    scale = width / grey.shape[1]
    if scale < 1:
        size = (width, max(1, round(scale * grey.shape[0])))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return bytes(data)
