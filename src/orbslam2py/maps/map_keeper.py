# SPDX-License-Identifier: BSD-3-Clause
"""Keeping the map of a running system in files, at any moment or all the time."""

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
from orbslam2py.settings.settings import Settings

_log = logging.getLogger(__name__)

#: Seconds that saving keeps the interpreter's lock, and that it leaves to others after them.
_LONGEST_STRETCH, _BREAK = 0.0005, 0.0005

#: Gives the frames of a map that hang on known keyframes: ``recorded(map_index, keyframe_ids)``.
Recorded = Callable[[int, IntArray], RecordedFrames]


class MapKeeper:
    """Writes the map of a system, with all that must be known to use it.

    May be used from any thread, while images are tracked.

    Parameters
    ----------
    slam_map : orbslam2py._core.Map
        The map.
    recorded : callable
        Gives the frames that a file is to hold.
    settings : Settings
        Of the camera.
    vocabulary : callable
        Tells which visual words there are: only who saves needs to know.
    seed : int
        Of the present run.
    options : mapping
        Those of the system, by their names.
    earlier : SavedMap or MapFile, optional
        What the map was loaded from.

    Attributes
    ----------
    images : dict
        JPEG images of keyframes, by their ids; belong to the map of `images_of`.
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
    ) -> None:
        self._map = slam_map
        self._recorded = recorded
        self._settings = settings
        self._vocabulary = vocabulary
        self._earlier_runs = earlier.runs if earlier is not None else ()
        self._images: dict[int, bytes] = dict(earlier.images) if earlier is not None else {}
        self._first_map = slam_map.epoch
        self._images_of = self._first_map
        started = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        self._run = Run(f"orbslam2py {__version__}", started, seed, options)
        self._autosave: _Autosave | None = None

    def keep_image(self, keyframe: int, jpeg: bytes) -> None:
        """Remember the image of a keyframe of the present map."""
        if self._map.epoch != self._images_of:
            self._images, self._images_of = {}, self._map.epoch
        self._images[keyframe] = jpeg

    # ---- whole files -----------------------------------------------------------------------------
    def saved_map(self) -> SavedMap:
        """Everything that a map file holds, of this moment."""
        contents = take_contents(self._map)
        ids = set(contents.keyframes.ids.tolist())
        images = {i: self._images[i] for i in sorted(ids & self._images.keys())}
        if contents.map_index != self._images_of:
            images = {}
        runs = (*self._runs_before(contents), self._present_run(contents))
        return SavedMap(contents, self._settings, self._vocabulary(), runs, images)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a map file; see `orbslam2py.System.save_map`."""
        path = path_of(path, "the map file", MapFileError)
        autosave = self._autosave
        if autosave is not None and os.path.realpath(path) == os.path.realpath(autosave.path):
            autosave.save_now()
        else:
            save_map(self.saved_map(), path)

    def _runs_before(self, contents: MapContents) -> tuple[Run, ...]:
        # After a reset the map is another one, which the earlier runs know nothing of.
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

    def stop_autosave(self) -> None:
        """Save a last time and end; raises `MapFileError` if that does not work."""
        autosave, self._autosave = self._autosave, None
        if autosave is not None:
            autosave.finish()

    def update(
        self, writer: MapWriter, before: ChangedContents | None, *, gently: bool = False
    ) -> ChangedContents | None:
        """Bring a file up to date; returns what it holds then, or None as long as there is no map.

        Parameters
        ----------
        writer : MapWriter
            Of the file.
        before : ChangedContents, optional
            What the file holds: only what has changed since is looked at. None: everything.
        gently : bool
            Leave time to other threads all the while.
        """
        known = np.array(sorted(key[0] for key in writer.keys("keypoints")), np.int64)
        changes = take_changes(self._map, known, before)
        contents = changes.contents
        if gently:
            time.sleep(_BREAK)
        if not len(contents.keyframes):
            return None
        looked_at = set(zip(changes.pages.tolist(), strict=True))
        same = set(zip(contents.keyframes.ids[~changes.changed_keyframes].tolist(), strict=True))
        kept = {
            "keyframes": same,
            "covisibility": same,
            "map_points": writer.keys("map_points") - looked_at,
            "observations": writer.keys("observations") - looked_at,
        }
        rows = self._rows(changes, writer, partly=before is not None)
        n = writer.commit(_leaving_time(rows) if gently else rows, kept)
        _log.debug("%d rows written to %s", n, writer.path)
        return changes

    def _rows(
        self, changes: ChangedContents, writer: MapWriter, *, partly: bool
    ) -> Iterator[tuple[str, Row]]:
        contents = changes.contents
        yield from self._head
        runs = (*self._runs_before(contents), self._present_run(contents))
        for number, run in enumerate(runs):
            # Parts that are full change at the end alone; the last one is looked at again.
            parts = sum(key[0] == number for key in writer.keys("frames"))
            yield from run_rows(number, run, first_part=max(0, parts - 1) if partly else 0)
        yield from map_rows(contents, changes.changed_keyframes)
        keys = zip(contents.keyframes.ids.tolist(), strict=True)
        written = writer.keys("keypoints")
        yield from keypoint_rows(contents, [i for i, key in enumerate(keys) if key not in written])
        for keyframe, jpeg in list(self._images.items()):
            if self._images_of == contents.map_index and not writer.has("images", keyframe):
                yield from self._image_rows(contents, keyframe, jpeg)

    @cached_property
    def _head(self) -> list[tuple[str, Row]]:
        return list(settings_rows(self._settings, self._vocabulary()))

    @staticmethod
    def _image_rows(contents: MapContents, keyframe: int, jpeg: bytes) -> Iterator[tuple[str, Row]]:
        with contextlib.suppress(KeyError):
            contents.keyframes.row_of(keyframe)
            yield "images", (keyframe, jpeg)


class _Autosave:
    """Saves every so many seconds in a thread of its own; a failure is told and tried again.

    A new map after a reset goes into a file of its own: the old one's stays as it is.
    """

    def __init__(self, keeper: MapKeeper, path: str | os.PathLike[str], every: float) -> None:
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

    def save_now(self, *, everything: bool = True) -> None:
        """Commit the present state; `everything`: also the tracker's counters of points."""
        with self._lock:
            self._follow_reset()
            before = None if everything else self._held
            self._held = self._keeper.update(self._writer, before, gently=not everything)

    def finish(self) -> None:
        """Commit a last time and end the thread."""
        self._stop.set()
        self._thread.join()
        try:
            self.save_now()
        finally:
            with self._lock:
                self._writer.close()

    def _work(self) -> None:
        while not self._stop.wait(self._every):
            try:
                self.save_now(everything=False)
            except MapFileError as error:
                _log.warning("autosave failed and will be tried again: %s", error)

    def _follow_reset(self) -> None:
        epoch = self._keeper._map.epoch
        if epoch == self._map_index:
            return
        self._map_index, self._held = epoch, None
        if not self._writer.keys("map"):
            return  # nothing of the old map was written
        self._writer.close()
        path = self.path.with_stem(f"{self.path.stem}-{epoch - self._first_map}")
        self._writer = MapWriter(path)
        _log.warning("the map was given up; the new one is saved as %s, the old one stays", path)


def _leaving_time(rows: Iterable[tuple[str, Row]]) -> Iterator[tuple[str, Row]]:
    """Give the interpreter's lock to whoever waits for it, every fraction of a millisecond.

    A thread that only asks for the lock gets it after five milliseconds, which a frame would feel.
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
        Of the JPEG at most, in pixels.
    quality : int
        Of the JPEG, 0 to 100.
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
