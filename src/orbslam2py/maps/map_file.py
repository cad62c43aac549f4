# SPDX-License-Identifier: BSD-3-Clause
"""Map files: maps that remain after the program. The format: ``docs/reference/map_file.md``."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import replace

from orbslam2py import _core as core
from orbslam2py._arguments import choice_of, path_of
from orbslam2py.errors import MapFileError
from orbslam2py.maps.contents import MapContents, contents_of
from orbslam2py.maps.imu_states import check_states, put_states
from orbslam2py.maps.map_copies import remember_metric_roots, set_upright
from orbslam2py.maps.map_reader import check_contents, check_frames, opened, read_head
from orbslam2py.maps.map_rows import all_rows
from orbslam2py.maps.map_tables import MapTables
from orbslam2py.maps.map_writer import MapWriter
from orbslam2py.maps.saved_map import SavedMap, saved_of
from orbslam2py.settings.sensor import Sensor


class MapFile:
    """A map file that a system can begin in, without the copy that `load_map` makes.

    The description of the map is read at once, the map itself when a system is created.

    Parameters
    ----------
    path
        The file. The file; it is only read, and another program may write it.

    Attributes
    ----------
    settings, vocabulary, runs, images, source
        As in `SavedMap`.
    metric_roots, upright_roots : tuple of int
        As in `MapContents`.
    n_keyframes, n_points : int
        Of the map.

    Raises
    ------
    MapFileError
        The message names the file, the fault and a remedy.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.source = str(path)
        with opened(path) as (connection, tables):
            head = read_head(connection, tables, images=True)
            totals = connection.execute("SELECT name, rows, checksum FROM totals").fetchall()
            (n_points,) = connection.execute("SELECT sum(count) FROM map_points").fetchone()
            (n_keyframes,) = connection.execute("SELECT count(*) FROM keyframes").fetchone()
        self.settings, self.vocabulary = head.settings, head.vocabulary
        self.runs, self.images = head.runs, head.images
        self.metric_roots = head.metric_roots
        self.upright_roots = head.upright_roots
        self._totals = totals
        self.n_keyframes = int(n_keyframes)
        self.n_points = int(n_points or 0)

    @property
    def sensor(self) -> Sensor:
        """Camera, vocabulary and runs of the map."""
        return self.settings.sensor

    def check(self) -> None:
        """Read the whole file once as a check, without building the map.

        Raises
        ------
        MapFileError
            If the file is damaged.
        """
        with self._opened() as stored:
            rest = stored.without_keypoints()
            arrays = rest.as_dict()
            core.MapRestorer(arrays, stored.n_keypoints)
            self._check(rest)
            for _ in stored.keypoint_parts():
                pass  # their checksums and sizes are checked

    def restore(
        self,
        slam_map: core.Map,
        vocabulary: core.Vocabulary | None = None,
        index: core.KeyFrameIndex | None = None,
        inertial: core.InertialKeyframes | None = None,
    ) -> None:
        """Make the map.

        Parameters
        ----------
        slam_map
            An empty map to fill.
        vocabulary
            Vocabulary for the words of the keyframes; words in the file are used if they are of
            this vocabulary.
        index
            Gets the keyframes with their words.
        inertial
            Gets the states of the IMU.

        Raises
        ------
        MapFileError
            If the file is damaged or has been replaced since it was opened; nothing is changed
            then.
        """
        with self._opened() as stored:
            fits = vocabulary is not None and self.vocabulary.is_of(vocabulary)
            rest = stored.without_keypoints()
            arrays = rest.as_dict()
            restorer = core.MapRestorer(arrays, stored.n_keypoints, vocabulary, fits)
            self._check(rest)
            for part, n_keyframes in stored.keypoint_parts():
                restorer.add(part, n_keyframes)
            restorer.finish(slam_map, index)
            if inertial is not None:
                put_states(rest.imu_states, inertial)
        remember_metric_roots(slam_map, self.metric_roots)
        set_upright(slam_map, self.upright_roots)

    def _check(self, contents: MapContents) -> None:
        """Check what the core does not check."""
        keyframes = contents.keyframes
        check_frames(self.runs, keyframes.ids, contents.removed_keyframes.ids)
        check_states(contents.imu_states, keyframes.ids, keyframes.timestamps)

    @contextlib.contextmanager
    def _opened(self) -> Iterator[MapTables]:
        with opened(self.source) as (connection, tables):
            totals = connection.execute("SELECT name, rows, checksum FROM totals").fetchall()
            if totals == self._totals:
                yield MapTables(connection, tables)
                return
        # Outside of the block, in which every error is reported as damage.
        raise MapFileError(f"{self.source} was changed since it was opened; open it again")


def save_map(saved: SavedMap, path: str | os.PathLike[str], *, patches: bool = True) -> None:
    """Write a map file; it gets its name only after it is complete.

    Parameters
    ----------
    saved
        The map, with all that is needed to use it.
    path
        The file, by custom with the suffix ``.orbmap``; an existing map is replaced.
    patches
        Write the patches of points, a kilobyte each, and the sightings that were aligned to them.

    Raises
    ------
    MapFileError
        If the map has no keyframes or `load_map` would refuse it, if the file cannot be written, or
        if it exists and is no map; an existing file is kept.
    """
    contents_of(saved_of(saved).contents)
    if not choice_of(patches, "patches"):
        saved = replace(saved, contents=saved.contents.without_patches())
    path = path_of(path, "the map file", MapFileError)
    if not len(saved.contents.keyframes):
        raise MapFileError(
            f"cannot write {path}: there are no keyframes in the map yet; save it later"
        )
    try:
        check_contents(saved.contents, saved.runs)
    except MapFileError as error:
        raise MapFileError(
            f"cannot write {path}: no map can be made of it ({error}); give one that is whole, a "
            "file that was there is kept"
        ) from error
    MapWriter(path, once=True).commit(all_rows(saved))
